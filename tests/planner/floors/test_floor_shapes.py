"""Every kind of entity becomes the shape that is drawn, wherever its blocks put it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from ezdxf.layouts import Modelspace
from ezdxf.render.forms import cube
from floor_drawings import Read, codes, rectangle
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.curves import circle_count
from tests.faults.sizes import size


def only(plan: FloorPlan) -> Element:
    (element,) = plan.elements
    return element


def area(plan: FloorPlan) -> float:
    return sum(solid.area for element in plan.elements for solid in element.solids)


def edges(ring: FloatArray) -> FloatArray:
    return np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)


def test_a_line_is_an_open_wall(read: Read) -> None:
    wall = only(read(lambda m: m.add_line((1, 1), (4, 5), dxfattribs={"layer": "WALLS"})))
    assert wall.solids == ()
    assert wall.lines[0].tolist() == [[1, 1], [4, 5]]
    assert (wall.kind, wall.occludes, wall.obstacle, wall.target) == ("walls", True, True, True)


@pytest.mark.parametrize(("radius", "count"), [(0.2, 26), (0.5, 63), (1.0, 126), (0.02, 8)])
def test_a_circle_has_as_many_edges_as_equation_1_says(read: Read, radius: float, count: int) -> None:
    """Angular step at most d_dis / radius: ceil(2 pi r / 0.05), at least 8."""
    column = only(read(lambda m: m.add_circle((5, 4), radius, dxfattribs={"layer": "COLUMNS"})))
    assert len(column.solids[0].exterior) == count


def test_a_circle_is_circumscribed(read: Read) -> None:
    """Edges touch the circle at their middles, so that no clearance is overestimated."""
    column = only(read(lambda m: m.add_circle((5, 4), 0.3, dxfattribs={"layer": "COLUMNS"})))
    ring = column.solids[0].exterior - (5, 4)
    middles = (ring + np.roll(ring, -1, axis=0)) / 2
    assert np.hypot(*middles.T) == pytest.approx(0.3)
    assert np.hypot(*ring.T) == pytest.approx(0.3 / math.cos(math.pi / len(ring)))


@given(radius=st.floats(0.01, 5.0), chord=st.floats(0.01, 0.2))
def test_no_edge_of_a_circle_is_longer_than_a_unit(radius: float, chord: float) -> None:
    count = circle_count(radius, chord=chord)
    assert math.tau / count <= chord / radius * (1 + 1e-9) or count == 8
    assert 2 * radius * math.tan(math.pi / count) <= chord * (1 + 1e-9)


def test_a_polyline_of_two_half_circles_is_a_circle(read: Read) -> None:
    drawn = read(lambda m: m.add_circle((5, 4), 0.3, dxfattribs={"layer": "COLUMNS"}))
    half_circles = [(4.7, 4, 1), (5.3, 4, 1)]
    bulged = read(
        lambda m: m.add_lwpolyline(half_circles, "xyb", close=True, dxfattribs={"layer": "COLUMNS"})
    )
    assert np.allclose(only(bulged).solids[0].exterior, only(drawn).solids[0].exterior, atol=1e-9)


def test_a_bulge_is_an_arc(read: Read) -> None:
    """A quarter disc of radius 2: two straight sides and an arc with bulge tan(90 deg / 4)."""
    corners = [(3, 3, 0), (5, 3, math.tan(math.pi / 8)), (3, 5, 0)]
    wall = only(read(lambda m: m.add_lwpolyline(corners, "xyb", close=True, dxfattribs={"layer": "WALLS"})))
    ring = wall.solids[0].exterior
    arc = ring[np.isclose(np.hypot(*(ring - (3, 3)).T), 2.0)]
    assert len(arc) == math.ceil(math.pi / 0.05) + 1
    assert wall.solids[0].area == pytest.approx(math.pi, abs=1e-3)


@settings(
    max_examples=size(short=10, full=30),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(radius=st.floats(0.05, 30.0), start=st.floats(0, 360), sweep=st.floats(10, 300))
def test_arcs_are_cut_no_farther_than_a_millimetre(
    read: Read, radius: float, start: float, sweep: float
) -> None:
    plan = read(lambda m: m.add_arc((5, 4), radius, start, start + sweep, dxfattribs={"layer": "WALLS"}))
    line = only(plan).lines[0]
    chords = np.hypot(*np.diff(line, axis=0).T)
    middles = (line[1:] + line[:-1]) / 2 - (5, 4)
    assert chords.max() <= 0.05 + 1e-9
    assert np.hypot(*(line - (5, 4)).T) == pytest.approx(radius)
    assert (radius - np.hypot(*middles.T)).max() <= 0.001 + 1e-9
    assert chords.sum() == pytest.approx(math.radians(sweep) * radius, rel=2e-2)


def test_an_ellipse_is_a_solid(read: Read) -> None:
    plan = read(lambda m: m.add_ellipse((5, 4), (2, 0), 0.5, dxfattribs={"layer": "COLUMNS"}))
    assert area(plan) == pytest.approx(math.pi * 2 * 1, rel=1e-3)
    assert edges(only(plan).solids[0].exterior).max() <= 0.05 + 1e-9


def test_a_spline_is_a_line_of_short_chords(read: Read) -> None:
    points = [(1, 1), (3, 4), (5, 1), (7, 4)]
    line = only(read(lambda m: m.add_spline(points, dxfattribs={"layer": "RAILINGS"}))).lines[0]
    assert np.hypot(*np.diff(line, axis=0).T).max() <= 0.05 + 1e-9
    for point in points:
        assert np.hypot(*(line - point).T).min() < 0.03


def test_a_hatch_leaves_its_holes_free(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        hatch = model.add_hatch(dxfattribs={"layer": "STAIRS"})
        hatch.paths.add_polyline_path([(1, 1), (4, 1), (4, 4), (1, 4)])
        hatch.paths.add_polyline_path([(2, 2), (3, 2), (3, 3), (2, 3)])

    assert area(read(draw)) == pytest.approx(8)


def test_a_hatch_that_fills_a_drawn_outline_is_the_same_solid(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "WALLS", 1, 1, 4, 1.2)
        hatch = model.add_hatch(dxfattribs={"layer": "WALLS"})
        hatch.paths.add_polyline_path([(1, 1), (2, 1), (2, 1.2), (1, 1.2)])

    assert area(read(draw)) == pytest.approx(0.6)
    assert len(read(draw).elements) == 1


@pytest.mark.parametrize("add", ["add_solid", "add_trace", "add_3dface"])
def test_a_filled_quadrilateral_is_a_solid(read: Read, add: str) -> None:
    """SOLID and TRACE number their corners in zigzag, 3DFACE around."""
    corners = [(1, 1), (3, 1), (1, 2), (3, 2)] if add != "add_3dface" else [(1, 1), (3, 1), (3, 2), (1, 2)]
    plan = read(lambda m: getattr(m, add)(corners, dxfattribs={"layer": "COLUMNS"}))
    assert area(plan) == pytest.approx(2)
    assert plan.findings == ()


def test_old_polylines_read_as_new_ones(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        for layer, long in (("FLOOR", 8), ("WALLS", 2)):
            corners = [(0, 0), (long, 0), (long, 1), (0, 1)]
            model.add_polyline2d(corners, close=True, dxfattribs={"layer": layer})

    plan = read(draw, version="R12", floor=False)
    assert plan.area == pytest.approx(8)
    assert area(plan) == pytest.approx(2)


def test_a_mirroring_extrusion_puts_a_shape_on_the_other_side(read: Read) -> None:
    """With extrusion -Z the drawn x counts from right to left."""

    def draw(model: Modelspace) -> None:
        attributes = {"layer": "WALLS", "extrusion": (0, 0, -1)}
        model.add_lwpolyline([(-4, 1), (-1, 1), (-1, 2), (-4, 2)], close=True, dxfattribs=attributes)
        model.add_circle((-6, 4), 0.2, dxfattribs={"layer": "COLUMNS", "extrusion": (0, 0, -1)})

    wall, column = read(draw).elements
    assert wall.solids[0].exterior.min(axis=0) == pytest.approx([1, 1])
    assert wall.solids[0].exterior.max(axis=0) == pytest.approx([4, 2])
    assert column.solids[0].exterior.mean(axis=0) == pytest.approx([6, 4])


def with_block(model: Modelspace, name: str = "leaf", *, layer: str = "0") -> None:
    block = model.doc.blocks.new(name, base_point=(1, 0))
    block.add_lwpolyline([(1, 0), (3, 0), (3, 1)], close=True, dxfattribs={"layer": layer})


def test_a_block_is_placed_by_its_base_point(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        with_block(model)
        model.add_blockref("leaf", (5, 5), dxfattribs={"layer": "WALLS"})

    assert only(read(draw)).solids[0].exterior.tolist() == [[5, 5], [7, 5], [7, 6]]


def test_a_mirrored_scaled_and_turned_block_lands_where_it_is_drawn(read: Read) -> None:
    """Mirrored in x and doubled in y: (2, 1) becomes (-2, 2); turned by 90 deg: (-2, -2)."""

    def draw(model: Modelspace) -> None:
        with_block(model)
        place = {"layer": "WALLS", "xscale": -1, "yscale": 2, "rotation": 90}
        model.add_blockref("leaf", (5, 5), dxfattribs=place)

    ring = only(read(draw)).solids[0].exterior
    assert sorted(map(tuple, ring.round(9).tolist())) == [(3.0, 3.0), (5.0, 3.0), (5.0, 5.0)]


def test_content_on_layer_0_takes_the_inserts_layer(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        with_block(model, "inner")
        with_block(model, "own", layer="STAIRS")
        outer = model.doc.blocks.new("outer")
        outer.add_blockref("inner", (0, 0), dxfattribs={"layer": "0"})
        outer.add_blockref("own", (3, 3), dxfattribs={"layer": "0"})
        model.add_blockref("outer", (2, 2), dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert [element.kind for element in plan.elements] == ["walls", "stairs"]
    assert plan.elements[0].solids[0].exterior[0].tolist() == [2, 2]
    assert plan.elements[1].solids[0].exterior[0].tolist() == [5, 5]


def test_a_block_in_rows_and_columns_is_drawn_as_often(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.doc.blocks.new("post").add_circle((0, 0), 0.1)
        grid = {"row_count": 2, "column_count": 3, "row_spacing": 2, "column_spacing": 3}
        model.add_blockref("post", (1, 1), dxfattribs={"layer": "COLUMNS", **grid})

    centres = [element.solids[0].exterior.mean(axis=0).round(6).tolist() for element in read(draw).elements]
    assert sorted(centres) == [[1, 1], [1, 3], [4, 1], [4, 3], [7, 1], [7, 3]]


def test_a_squeezed_circle_is_an_ellipse(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.doc.blocks.new("post").add_circle((0, 0), 1.0)
        model.add_blockref("post", (5, 4), dxfattribs={"layer": "COLUMNS", "xscale": 0.2, "yscale": 0.4})

    solid = only(read(draw)).solids[0]
    assert solid.area == pytest.approx(math.pi * 0.2 * 0.4, rel=1e-2)
    assert edges(solid.exterior).max() <= 0.05 + 1e-9


def test_a_block_that_holds_itself_is_not_followed(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        with_block(model, "loop", layer="WALLS")
        model.doc.blocks.get("loop").add_blockref("loop", (1, 1))
        model.add_blockref("loop", (5, 5))

    plan = read(draw)
    assert codes(plan) == ["endless_block"]
    assert len(plan.elements) == 1


def test_a_block_that_is_not_there_is_reported(read: Read) -> None:
    plan = read(lambda m: m.add_blockref("site", (5, 5), dxfattribs={"layer": "WALLS"}))
    assert codes(plan) == ["missing_block"]
    assert "site" in plan.findings[0].message


def test_invisible_entities_are_not_drawn(read: Read) -> None:
    """The other states of a dynamic block are in the file, invisible."""
    plan = read(lambda m: m.add_line((1, 1), (4, 5), dxfattribs={"layer": "WALLS", "invisible": 1}))
    assert plan.elements == ()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e300])
def test_an_impossible_coordinate_drops_its_entity_with_its_place(read: Read, value: float) -> None:
    def draw(model: Modelspace) -> None:
        model.add_line((2, 3), (value, 3), dxfattribs={"layer": "WALLS"})
        model.add_line((2, 5), (4, 5), dxfattribs={"layer": "WALLS"})
        model.add_circle((2, 3), value, dxfattribs={"layer": "COLUMNS"})
        model.add_lwpolyline([(2, 3), (3, 3), (3, value)], close=True, dxfattribs={"layer": "WALLS"})
        model.add_spline([(2, 3), (3, value), (5, 5)], dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert only(plan).lines[0].tolist() == [[2, 5], [4, 5]]
    assert codes(plan) == ["bad_coordinates"] * 4
    assert {finding.at for finding in plan.findings} <= {(2.0, 3.0), None}
    assert any("LINE #" in finding.message and "on WALLS" in finding.message for finding in plan.findings)


def test_a_coordinate_too_small_to_divide_by_is_zero(read: Read) -> None:
    plan = read(lambda m: m.add_line((5e-324, -1e-13), (4, 5), dxfattribs={"layer": "WALLS"}))
    assert only(plan).lines[0].tolist() == [[0, 0], [4, 5]]


def test_a_solid_body_is_reported_with_explode_as_the_remedy(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        for _ in range(2):
            cube().render_mesh(model, dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert codes(plan) == ["no_outline"]
    assert "2 MESH" in plan.findings[0].message


def test_global_ids_are_read_from_extended_data(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        wall = model.add_line((1, 1), (4, 5), dxfattribs={"layer": "WALLS"})
        wall.set_xdata("IFC", [(1000, "1Uma8nuu1Frxm4jZQJyULl")])
        with_block(model)
        insert = model.add_blockref("leaf", (5, 5), dxfattribs={"layer": "WALLS"})
        insert.set_xdata("IFC", [(1000, "2Az8t8nqb9NxbeJ36pqfbs")])

    ids = [element.global_id for element in read(draw).elements]
    assert sorted(filter(None, ids)) == ["1Uma8nuu1Frxm4jZQJyULl", "2Az8t8nqb9NxbeJ36pqfbs"]
