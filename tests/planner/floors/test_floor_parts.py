"""Layers become the floor's outline, rooms, openings and elements."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
import shapely
from ezdxf.layouts import Modelspace
from ezdxf.math import Matrix44
from ezdxf.xclip import XClip
from floor_drawings import Read, codes, rectangle

from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings.element_kinds import KINDS
from tests.faults.sizes import some


def lines_around(model: Modelspace, layer: str, corners: list[tuple[float, float]]) -> None:
    for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        model.add_line(start, end, dxfattribs={"layer": layer})


def names(plan: FloorPlan) -> dict[str, float]:
    return {room.name: round(room.area, 6) for room in plan.rooms}


# The outline


def test_rings_in_the_floor_are_holes_whatever_their_direction(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 1, 1, 3, 3)
        rectangle(model, "FLOOR", 5, 5, 6, 6, clockwise=True)

    plan = read(draw)
    assert plan.area == pytest.approx(80 - 4 - 1)
    assert len(plan.outline[0].holes) == 2


def test_a_ring_in_a_hole_is_floor_again(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 1, 1, 7, 7)
        rectangle(model, "FLOOR", 3, 3, 5, 5)

    plan = read(draw)
    assert plan.area == pytest.approx(80 - 36 + 4)
    assert len(plan.outline) == 2


def test_floor_parts_that_overlap_are_one(read: Read) -> None:
    plan = read(lambda m: rectangle(m, "FLOOR", 8, 0, 14, 4))
    assert plan.area == pytest.approx(80 + 4 * 4)
    assert len(plan.outline) == 1


def test_floor_parts_that_lie_apart_stay_apart(read: Read) -> None:
    plan = read(lambda m: rectangle(m, "FLOOR", 12, 0, 14, 4))
    assert [round(part.area) for part in plan.outline] == [80, 8]


JOINTS = {0.0004: "0.4 mm", 0.004: "4.0 mm", 0.02: "20.0 mm"}


def beside(model: Modelspace, joint: float, degrees: float = 0.0) -> None:
    """A slab of 6 by 8 m next to the floor of 10 by 8 m, all turned round 0, 0."""
    for x0, x1 in ((0.0, 10.0), (10.0 + joint, 16.0 + joint)):
        rectangle(model, "FLOOR", x0, 0, x1, 8)
    turn = Matrix44.z_rotate(math.radians(degrees))
    for slab in model:
        slab.transform(turn)


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0, 200.0])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_joint_between_slabs_is_closed_and_reported(read: Read, joint: float, degrees: float) -> None:
    plan = read(lambda model: beside(model, joint, degrees), floor=False)
    assert len(plan.outline) == 1
    assert plan.area == pytest.approx((16 + joint) * 8, abs=1e-6)
    assert [finding.code for finding in plan.findings] == ["joint_closed"]
    assert JOINTS[joint] in plan.findings[0].message
    assert plan.findings[0].at is not None


@pytest.mark.parametrize("degrees", [0.0, 53.0])
def test_a_joint_that_widens_is_closed_as_far_as_it_is_one(read: Read, degrees: float) -> None:
    """From 0.4 mm in the south to 4 mm, and next to another slab to 40 mm in the north."""

    def draw(model: Modelspace) -> None:
        for corners in (
            [(0, 0), (10, 0), (10, 8), (0, 8)],
            [(10.0004, 0), (16, 0), (16, 8), (10.004, 8)],
            [(16.0004, 0), (20, 0), (20, 8), (16.04, 8)],
        ):
            model.add_lwpolyline(corners, close=True, dxfattribs={"layer": "FLOOR"})
        for slab in model:
            slab.transform(Matrix44.z_rotate(math.radians(degrees)))

    plan = read(draw, floor=False)
    assert len(plan.outline) == 1
    # The second gap is 20 mm wide at y = 3.96, and open from there on: a trapezoid.
    left_open = (0.02 + 0.04) / 2 * (8 - (0.02 - 0.0004) / (0.04 - 0.0004) * 8)
    assert plan.area == pytest.approx(20 * 8 - left_open, abs=1e-3)
    assert codes(plan) == ["joint_closed"] * 2


@pytest.mark.parametrize("degrees", some(range(0, 360, 10), every=4))
def test_slabs_that_touch_are_one_at_any_angle(read: Read, degrees: int) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 0, 0, 3.3, 8)
        for y in (0, 2.7, 5.1):
            rectangle(model, "FLOOR", 3.3, y, 10, y + 2.7 if y < 5 else 8)
        turn = Matrix44.z_rotate(math.radians(degrees))
        for slab in model:
            slab.transform(turn)

    plan = read(draw, floor=False)
    assert plan.area == pytest.approx(80)
    assert sum(len(part.rings) for part in plan.outline) == 1
    assert codes(plan) == []


def test_a_gap_wider_than_a_joint_stays_open(read: Read) -> None:
    plan = read(lambda model: beside(model, 0.021), floor=False)
    assert [round(part.area) for part in plan.outline] == [80, 48]
    assert codes(plan) == []


def test_where_joints_cross_no_hole_is_left(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        for x in (0, 5.02):
            for y in (0, 4.02):
                rectangle(model, "FLOOR", x, y, x + 5, y + 4)

    plan = read(draw, floor=False)
    assert plan.area == pytest.approx(10.02 * 8.02)
    assert [len(part.holes) for part in plan.outline] == [0]


def test_a_joint_that_ends_within_the_floor_is_closed(read: Read) -> None:
    """The slabs are one in the north: the joint is a slot in it."""

    def draw(model: Modelspace) -> None:
        slot = [(5, 0), (5, 6), (5.004, 6), (5.004, 0)]
        corners = [(0, 0), *slot, (10, 0), (10, 8), (0, 8)]
        model.add_lwpolyline(corners, close=True, dxfattribs={"layer": "FLOOR"})

    plan = read(draw, floor=False)
    assert plan.area == pytest.approx(80)
    assert codes(plan) == ["joint_closed"]


def test_a_joint_as_a_hole_is_closed_and_a_shaft_is_not(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 5, 1, 5.01, 7)
        rectangle(model, "FLOOR", 8, 1, 8.3, 1.3)

    plan = read(draw)
    assert plan.area == pytest.approx(80 - 0.09)
    assert codes(plan) == ["joint_closed"]


def test_slabs_that_cross_keep_their_corners(read: Read) -> None:
    """Edges that meet at right angles, inwards or outwards, are no joint."""

    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 4, -3, 6, 11)
        rectangle(model, "COLUMNS", 1, 1, 2, 2)

    plan = read(draw)
    assert plan.area == pytest.approx(80 + 2 * 2 * 3, abs=1e-9)
    assert codes(plan) == []


def test_lines_turned_by_an_unusual_angle_still_meet(read: Read) -> None:
    """Ends on the middle of a slanted line are never exactly on it in floating point."""

    def turned(x: float, y: float) -> tuple[float, float]:
        return (x * math.cos(0.3) - y * math.sin(0.3), x * math.sin(0.3) + y * math.cos(0.3))

    def draw(model: Modelspace) -> None:
        lines_around(model, "FLOOR", [turned(*corner) for corner in [(0, 0), (10, 0), (10, 8), (0, 8)]])
        lines_around(model, "ROOMS", [turned(*corner) for corner in [(0, 0), (10, 0), (10, 8), (0, 8)]])
        for x in (3, 4.7, 8.1):
            model.add_line(turned(x, 0), turned(x, 8), dxfattribs={"layer": "ROOMS"})

    plan = read(draw, floor=False)
    assert sorted(room.area for room in plan.rooms) == pytest.approx([13.6, 15.2, 24, 27.2], abs=0.01)
    assert plan.findings == ()


def test_a_floor_of_single_lines_is_joined(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        lines_around(model, "FLOOR", [(0, 0), (10, 0), (10, 8), (0, 8)])
        lines_around(model, "FLOOR", [(2, 2), (3, 2), (3, 3), (2, 3)])
        model.add_line((5, 0), (5, 8), dxfattribs={"layer": "FLOOR"})

    plan = read(draw, floor=False)
    assert plan.area == pytest.approx(79)
    assert plan.findings == ()


@pytest.mark.parametrize(("gap", "closed"), [(0.0005, True), (0.04, True), (0.06, False)])
def test_a_gap_of_up_to_5_cm_is_closed(read: Read, gap: float, closed: bool) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", 20, 0, 30, 10)
        corners = [(0, 0), (10, 0), (10, 8), (0, 8), (0, gap)]
        for start, end in pairwise(corners):
            model.add_line(start, end, dxfattribs={"layer": "FLOOR"})
        polyline = [(40 + x, y) for x, y in corners]
        model.add_lwpolyline(polyline, dxfattribs={"layer": "FLOOR"})

    plan = read(draw, floor=False)
    assert len(plan.outline) == (3 if closed else 1)
    expected = ["open_outline"] if not closed else ["gap_closed"] * 2 if gap > 0.001 else []
    assert codes(plan) == expected


def test_a_ring_that_crosses_itself_is_repaired(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        bow_tie = [(1, 1), (3, 3), (3, 1), (1, 3)]
        model.add_lwpolyline(bow_tie, close=True, dxfattribs={"layer": "COLUMNS"})

    plan = read(draw)
    assert [solid.area for solid in plan.elements[0].solids] == pytest.approx([1, 1])
    assert codes(plan) == ["repaired"]
    assert plan.findings[0].element == "columns-001"
    assert plan.findings[0].at == (1.0, 1.0)


def test_what_a_ring_goes_round_twice_is_filled(read: Read) -> None:
    """By the parity of crossings 6 m² of these 19 would be free to drive on."""

    def draw(model: Modelspace) -> None:
        corners = [(1, 1), (5, 1), (5, 4), (2, 4), (2, 2), (6, 2), (6, 5), (1, 5)]
        model.add_lwpolyline(corners, close=True, dxfattribs={"layer": "COLUMNS"})

    (column,) = read(draw).elements
    assert sum(solid.area for solid in column.solids) == pytest.approx(19)


def test_a_ring_without_area_is_a_line(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_lwpolyline([(1, 1), (3, 1)], close=True, dxfattribs={"layer": "WALLS"})
        model.add_lwpolyline([(1, 2), (3, 2), (2, 2)], close=True, dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert [len(element.lines) for element in plan.elements] == [1, 1]
    assert plan.elements[0].solids == ()


def test_repeated_points_are_dropped(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_lwpolyline([(1, 1), (3, 1), (3, 1), (3, 2)], close=True, dxfattribs={"layer": "WALLS"})

    plan = read(draw)
    assert len(plan.elements[0].solids[0].exterior) == 3
    assert codes(plan) == ["repeated_points"]


# Rooms


def test_a_text_names_the_room_it_stands_in(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "ROOMS", 0, 0, 4, 8)
        rectangle(model, "ROOMS", 4, 0, 10, 8)
        model.add_text("101", dxfattribs={"layer": "ROOMS", "insert": (1, 5)})
        model.add_text("Büro", dxfattribs={"layer": "ROOMS", "insert": (1, 4)})
        model.add_mtext("{\\fArial;Open\\Poffice}", dxfattribs={"layer": "ROOMS", "insert": (6, 5)})
        model.add_text("north", dxfattribs={"layer": "ROOMS", "insert": (50, 5)})

    plan = read(draw)
    assert names(plan) == {"101 Büro": 32, "Open office": 48}
    assert codes(plan) == ["text_outside_rooms"]
    assert plan.findings[0].at == (50.0, 5.0)


def test_a_text_may_stand_in_a_block(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "ROOMS", 0, 0, 4, 8)
        model.doc.blocks.new("tag").add_text("101", dxfattribs={"insert": (0.5, 0.5)})
        insert = model.add_blockref("tag", (1, 1), dxfattribs={"layer": "ROOMS"})
        insert.add_attrib("NAME", "Store", (2, 1), dxfattribs={"layer": "ROOMS"})

    assert names(read(draw)) == {"101 Store": 32}


def test_a_room_in_a_room_is_cut_out_of_it(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "ROOMS", 0, 0, 10, 8)
        rectangle(model, "ROOMS", 2, 2, 4, 4, clockwise=True)
        model.add_text("hall", dxfattribs={"layer": "ROOMS", "insert": (6, 5)})
        model.add_text("booth", dxfattribs={"layer": "ROOMS", "insert": (3, 3)})

    assert names(read(draw)) == {"hall": 76, "booth": 4}


def test_a_nameless_ring_against_its_room_is_a_hole(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "ROOMS", 0, 0, 10, 8)
        rectangle(model, "ROOMS", 2, 2, 4, 4, clockwise=True)
        model.add_text("hall", dxfattribs={"layer": "ROOMS", "insert": (6, 5)})

    plan = read(draw)
    assert names(plan) == {"hall": 76}
    assert len(plan.rooms[0].polygons[0].holes) == 1


def test_a_ring_with_its_rooms_global_id_is_a_hole_though_a_text_stands_in_it(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        for ring in (rectangle(model, "ROOMS", 0, 0, 10, 8), rectangle(model, "ROOMS", 2, 2, 4, 4)):
            ring.set_xdata("IFC", [(1000, "04Sq57eS5FffNezn2ilgmy")])  # type: ignore[attr-defined]
        model.add_text("hall", dxfattribs={"layer": "ROOMS", "insert": (3, 3)})

    plan = read(draw)
    assert names(plan) == {"hall": 76}
    assert plan.rooms[0].global_id == "04Sq57eS5FffNezn2ilgmy"


def test_rings_of_one_global_id_are_one_room(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        for ring in (rectangle(model, "ROOMS", 0, 0, 4, 8), rectangle(model, "ROOMS", 6, 0, 10, 8)):
            ring.set_xdata("IFC", [(1000, "04Sq57eS5FffNezn2ilgmy")])  # type: ignore[attr-defined]

    plan = read(draw)
    assert [len(room.polygons) for room in plan.rooms] == [2]


def test_rooms_that_overlap_are_parted_and_reported(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "ROOMS", 0, 0, 6, 8)
        rectangle(model, "ROOMS", 5, 0, 10, 8)

    plan = read(draw)
    assert [room.area for room in plan.rooms] == pytest.approx([40, 40])
    assert codes(plan) == ["rooms_overlap"]
    assert plan.findings[0].element == "room-001"


@pytest.mark.parametrize("others", [[(1, 1, 4, 5), (4, 1, 7, 5)], [(0.5, 0.5, 4, 6), (4, 0.5, 8, 6)]])
def test_a_room_that_others_fill_is_left_out_and_reported(
    read: Read, others: list[tuple[float, float, float, float]]
) -> None:
    """They lie in it, or stick out of it."""

    def draw(model: Modelspace) -> None:
        for ring in ((1, 1, 7, 5), *others):
            rectangle(model, "ROOMS", *ring)

    plan = read(draw)
    assert len(plan.rooms) == 2
    assert "no_area" in codes(plan)


def test_rooms_may_be_drawn_as_lines(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        lines_around(model, "ROOMS", [(0, 0), (10, 0), (10, 8), (0, 8)])
        model.add_line((4, 0), (4, 8), dxfattribs={"layer": "ROOMS"})

    assert [room.area for room in read(draw).rooms] == pytest.approx([32, 48])


def test_a_room_off_the_floor_is_reported(read: Read) -> None:
    plan = read(lambda m: rectangle(m, "ROOMS", 9, 0, 20, 8))
    assert codes(plan) == ["room_off_floor"]


# Openings


def test_doors_and_passages_are_lines_across(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_line((4, 1), (4, 1.9), dxfattribs={"layer": "DOORS"})
        model.add_lwpolyline([(3, 8), (2.5, 8.1), (2, 8)], dxfattribs={"layer": "DOORS"})
        model.add_line((7, 5), (5, 5), dxfattribs={"layer": "PASSAGES"})

    openings = read(draw).openings
    assert [(item.id, item.kind, item.line.tolist()) for item in openings] == [
        ("door-001", "door", [[2, 8], [3, 8]]),
        ("door-002", "door", [[4, 1], [4, 1.9]]),
        ("passage-001", "passage", [[5, 5], [7, 5]]),
    ]


def test_openings_without_length_are_dropped_and_counted(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_line((4, 1), (4, 1), dxfattribs={"layer": "DOORS"})
        model.add_line((5, 1), (5, 1), dxfattribs={"layer": "DOORS"})
        model.add_line((4, 1), (4, 1.9), dxfattribs={"layer": "DOORS"})

    plan = read(draw)
    assert len(plan.openings) == 1
    assert codes(plan) == ["no_length"]
    assert plan.findings[0].message.endswith("(2 times)")
    assert plan.findings[0].at == (4.0, 1.0)


def test_a_door_leafs_swing_is_no_opening(read: Read) -> None:
    plan = read(lambda m: m.add_arc((4, 1), 0.9, 0, 90, dxfattribs={"layer": "DOORS"}))
    assert plan.openings == ()
    assert codes(plan) == ["not_an_opening"]


def test_a_door_drawn_as_a_box_is_the_line_along_its_middle(read: Read) -> None:
    plan = read(lambda m: rectangle(m, "DOORS", 4, 1, 4.2, 2))
    assert plan.openings[0].line.tolist() == [[4.1, 1], [4.1, 2]]
    assert codes(plan) == ["closed_opening"]


# Elements


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "other"])
def test_each_kind_means_what_the_table_of_kinds_says(read: Read, kind: str) -> None:
    (element,) = read(lambda m: rectangle(m, kind.upper(), 1, 1, 3, 2)).elements
    means = KINDS[kind]
    assert (element.id, element.kind) == (f"{kind}-001", kind)
    assert (element.occludes, element.obstacle, element.target) == (
        means.occludes,
        means.obstacle,
        means.target,
    )


@pytest.mark.parametrize(
    "layer", ["walls", "Walls", "xref-BLDG-A$0$WALLS", "site$0$bldg$1$walls", "plan|WALLS"]
)
def test_layer_names_lose_case_and_prefix(read: Read, layer: str) -> None:
    def draw(model: Modelspace) -> None:
        # A bar is not allowed in the name of a layer that is entered, only in one that is referred to.
        model.add_line((1, 1), (4, 5)).dxf.layer = layer

    (element,) = read(draw).elements
    assert element.kind == "walls"


def test_a_ring_against_the_one_around_it_is_a_hole_in_a_wall(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "WALLS", 1, 1, 5, 5)
        rectangle(model, "WALLS", 2, 2, 4, 4, clockwise=True)

    (wall,) = read(draw).elements
    assert wall.solids[0].area == pytest.approx(16 - 4)


def test_two_faces_of_a_wall_around_a_core_leave_it_hollow(read: Read) -> None:
    """Both drawn in one direction, as people draw them."""

    def draw(model: Modelspace) -> None:
        rectangle(model, "WALLS", 1, 1, 4, 4)
        rectangle(model, "WALLS", 1.2, 1.2, 3.8, 3.8)

    (wall,) = read(draw).elements
    assert wall.solids[0].area == pytest.approx(9 - 2.6**2)


def test_a_thin_wall_within_another_is_solid(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "WALLS", 1, 1, 7, 1.4)
        rectangle(model, "WALLS", 2, 1.1, 6, 1.3)

    walls = read(draw).elements
    assert [wall.solids[0].area for wall in walls] == pytest.approx([2.4, 0.8])


def test_a_ring_around_rooms_is_a_line_and_not_solid(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "WALLS", 0, 0, 10, 8)
        rectangle(model, "WALLS", 4, 0, 4.2, 5)
        rectangle(model, "ROOMS", 0.2, 0.2, 4, 7.8)

    plan = read(draw)
    assert [len(element.lines) for element in plan.elements] == [1, 0]
    assert plan.elements[0].lines[0].tolist() == [[0, 0], [10, 0], [10, 8], [0, 8], [0, 0]]
    assert codes(plan) == ["outline_not_solid"]


def test_single_line_walls_around_a_room_leave_it_free(read: Read) -> None:
    plan = read(lambda m: lines_around(m, "WALLS", [(1, 1), (4, 1), (4, 4), (1, 4)]))
    assert [element.solids for element in plan.elements] == [()] * 4


def test_a_column_of_single_lines_is_solid(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        lines_around(model, "COLUMNS", [(1, 1), (1.4, 1), (1.4, 1.4), (1, 1.4)])
        model.add_line((1, 1), (1.4, 1.4), dxfattribs={"layer": "COLUMNS"})
        model.add_line((3, 1), (3, 2), dxfattribs={"layer": "COLUMNS"})

    column, line = read(draw).elements
    assert column.solids[0].area == pytest.approx(0.16)
    assert line.lines[0].tolist() == [[3, 1], [3, 2]]


def test_treads_drawn_against_their_flight_do_not_free_it(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "STAIRS", 1, 1, 2.5, 4)
        for y in (1, 2, 3):
            rectangle(model, "STAIRS", 1, y, 2.5, y + 1, clockwise=True)

    flight = shapely.union_all(
        [
            shapely.Polygon(solid.exterior, solid.holes)
            for item in read(draw).elements
            for solid in item.solids
        ]
    )
    assert flight.area == pytest.approx(4.5)


def test_a_railing_around_a_place_leaves_it_free(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "RAILINGS", 1, 1, 4, 4)
        rectangle(model, "RAILINGS", 1.05, 1.05, 3.95, 3.95, clockwise=True)

    (railing,) = read(draw).elements
    assert railing.solids[0].area == pytest.approx(9 - 2.9**2)


def test_treads_stay_lines(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "STAIRS", 1, 1, 2, 4)
        for y in (2, 3):
            model.add_line((1, y), (2, y), dxfattribs={"layer": "STAIRS"})

    plan = read(draw)
    assert sorted(len(element.lines) for element in plan.elements) == [0, 1, 1]


def test_closed_shapes_of_an_unknown_layer_are_obstacles(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "A-FURN", 1, 1, 2, 2)
        rectangle(model, "A-FURN", 3, 1, 4, 2)
        model.add_line((5, 5), (6, 6), dxfattribs={"layer": "A-FURN"})
        model.add_text("desk", dxfattribs={"layer": "A-FURN", "insert": (1, 1)})

    plan = read(draw)
    assert [(item.kind, item.obstacle, item.occludes, item.target) for item in plan.elements] == [
        ("other", True, False, False)
    ] * 2
    assert codes(plan) == ["unknown_layer"]
    assert "2 closed shapes" in plan.findings[0].message
    assert "1 open lines and 1 texts" in plan.findings[0].message


def test_frames_around_the_floor_and_shapes_next_to_it_are_no_obstacles(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        rectangle(model, "SHEET", -5, -5, 15, 13)
        rectangle(model, "SHEET", 16, -5, 20, 13)
        rectangle(model, "DEFPOINTS", 1, 1, 2, 2)

    plan = read(draw)
    assert plan.elements == ()
    assert set(codes(plan)) == {"unknown_layer", "outline_not_solid", "off_floor"}


def test_dimensions_are_no_obstacles(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_linear_dim((1, 1), (1, 2), (5, 2), dxfattribs={"layer": "A-DIMS"}).render()

    plan = read(draw)
    assert plan.elements == ()
    assert codes(plan) == ["unknown_layer"]


@pytest.mark.parametrize("state", ["off", "freeze"])
def test_hidden_layers_count_only_if_their_name_is_known(read: Read, state: str) -> None:
    def draw(model: Modelspace) -> None:
        for name in ("WALLS", "A-FURN"):
            getattr(model.doc.layers.add(name), state)()
            rectangle(model, name, 1, 1, 3, 2)

    plan = read(draw)
    assert [element.kind for element in plan.elements] == ["walls"]
    assert codes(plan) == ["hidden_layer"]


def test_entities_that_were_made_invisible_are_left_out_and_reported(read: Read) -> None:
    """Those in a block are not: a dynamic block holds every other state of itself as invisible entities."""

    def draw(model: Modelspace) -> None:
        for x in (1, 4):
            rectangle(model, "WALLS", x, 1, x + 1, 2)
        state = model.doc.blocks.new("state")
        rectangle(state, "WALLS", 7, 1, 8, 2)
        model.add_blockref("state", (0, 0))
        for entity in (*list(model)[-2:-1], *state):
            entity.dxf.invisible = 1

    plan = read(draw)
    assert [element.kind for element in plan.elements] == ["walls"]
    assert codes(plan) == ["invisible"]
    assert "layer WALLS: 1 invisible entity left out" in plan.findings[0].message


def test_a_polyline_drawn_as_a_band_is_reported(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.add_lwpolyline([(1, 1), (4, 1)], dxfattribs={"layer": "WALLS", "const_width": 0.24})

    plan = read(draw)
    assert codes(plan) == ["wide_line"]
    assert "0.24 m wide" in plan.findings[0].message


def test_a_clipped_block_is_read_whole_and_reported(read: Read) -> None:
    def draw(model: Modelspace) -> None:
        model.doc.blocks.new("bay").add_line((0, 0), (3, 0))
        insert = model.add_blockref("bay", (2, 2), dxfattribs={"layer": "WALLS"})
        XClip(insert).set_block_clipping_path([(0, 0), (1, 1)])

    plan = read(draw)
    assert plan.elements[0].lines[0].tolist() == [[2, 2], [5, 2]]
    assert codes(plan) == ["clipped_block"]
