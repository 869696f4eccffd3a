"""Floods of shapes that are alike take time and memory as their number grows, not as its square."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions, read_floor, rings, rooms
from stopgo.planner.floors.linework import patterns
from stopgo.planner.floors.linework.wall_gaps import _facing
from stopgo.planner.geometry import shapes


def test_equal_outlines_are_not_compared_with_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    def compared(one: shapely.Polygon, other: shapely.Polygon) -> bool:
        raise AssertionError("equal outlines were compared")

    monkeypatch.setattr(rings, "_same", compared)
    boxes = [shapely.box(0, 0, 1, 1), shapely.box(5, 5, 6, 6)] * 50
    assert rings.distinct(boxes) == [0, 1] * 50


def test_outlines_that_nearly_equal_copies_are_copies_too() -> None:
    near = shapely.box(0, 0, 1, 1 + 1e-7)
    box = shapely.box(0, 0, 1, 1)
    assert rings.distinct([near, box, shapely.box(3, 0, 4, 1), box, near]) == [0, 0, 2, 0, 0]


def test_ends_of_very_many_walls_are_paired_in_little_memory() -> None:
    count = 3000
    left = np.column_stack((np.zeros(count), 5.0 * np.arange(count)))
    middles = np.concatenate((left, left + np.array((1.0, 0.0))))
    directions = np.repeat(((1.0, 0.0), (-1.0, 0.0)), count, axis=0)
    tracemalloc.start()
    pairs = list(_facing(middles, directions))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert pairs == [(k, k + count) for k in range(count)]
    assert peak < 50e6


def in_rows(teeth: int) -> np.ndarray:
    """A comb as one line: teeth of 9 m, 5 mm wide and apart (n, 2)."""
    x = np.repeat(0.005 * np.arange(2 * teeth), 2)
    y = np.tile([1.0, 10.0, 10.0, 1.0], teeth)
    return np.column_stack([x, y])


def test_very_many_lines_are_noded_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines that cross, meet, overlap, and lie in a row."""
    random = np.random.default_rng(4)
    lines = [shapely.LineString(line) for line in random.integers(0, 12, (40, 3, 2)) / 2]
    lines += [shapely.LineString(in_rows(30)), shapely.Point(0, 0).buffer(2).boundary]
    faces = []
    for most in (10**9, 10):
        monkeypatch.setattr(shapes, "MANY_POINTS", most)
        noded = shapes.noded_lines(lines, grid_size=1e-4)
        assert shapely.get_parts(noded).size > 500
        areas = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded).tolist()))
        faces.append(sorted(shapely.to_wkb(shapely.normalize(areas)).tolist()))
    assert faces[0] == faces[1]


@pytest.mark.parametrize("layer", ["WALLS", "FLOOR"])
def test_lines_of_very_great_length_or_with_very_many_crossings_are_refused(
    tmp_path: Path, layer: str
) -> None:
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_lwpolyline(
        [(0, 0), (50, 0), (50, 20), (0, 20)], close=True, dxfattribs={"layer": "FLOOR"}
    )
    turns = np.linspace(0, 2 * np.pi * 1000, 2001)[:-1] + np.arange(2000) * 1e-3
    star = np.column_stack([25 + 9 * np.cos(turns), 10 + 9 * np.sin(turns)])
    for line in (in_rows(1000), star) if layer == "WALLS" else (star,):
        drawing.modelspace().add_lwpolyline(line.tolist(), close=True, dxfattribs={"layer": layer})
    drawing.saveas(tmp_path / "comb.dxf")
    told = "m of lines of walls within 10 m around" if layer == "WALLS" else "lines of floor cross more than"
    with pytest.raises(InputError, match=told):
        read_floor(tmp_path / "comb.dxf", FloorOptions(units="m"))


def test_a_line_with_very_many_vertices_is_refused(tmp_path: Path) -> None:
    drawing = ezdxf.new("R2010", units=6)
    angle = np.linspace(0, 2 * np.pi, patterns.MOST_VERTICES + 2)
    circle = np.column_stack([10 + 5 * np.cos(angle), 10 + 5 * np.sin(angle)])
    drawing.modelspace().add_lwpolyline(circle.tolist(), close=True, dxfattribs={"layer": "FLOOR"})
    drawing.saveas(tmp_path / "round.dxf")
    with pytest.raises(InputError, match="a line of floor has 20002 vertices, more than 20000; simplify it"):
        read_floor(tmp_path / "round.dxf", FloorOptions(units="m"))


def test_a_curve_without_end_is_left_out_when_it_is_longer_than_any(tmp_path: Path) -> None:
    drawing = ezdxf.new("R2010", units=6)
    drawing.modelspace().add_lwpolyline(
        [(0, 0), (50, 0), (50, 20), (0, 20)], close=True, dxfattribs={"layer": "FLOOR"}
    )
    places = np.random.default_rng(1).random((3000, 2)) * (50, 20)
    drawing.modelspace().add_open_spline(places.tolist(), dxfattribs={"layer": "WALLS"})
    drawing.saveas(tmp_path / "spline.dxf")
    floor = read_floor(tmp_path / "spline.dxf", FloorOptions(units="m"))
    assert any("longer than any building's" in finding.message for finding in floor.findings)


def test_a_room_around_very_many_is_compared_with_those_that_overlap_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 100 rooms in a room, cut out of it, one reaches 10 cm into it."""
    small = [shapely.box(3 * k, 0, 3 * k + 2, 2) for k in range(100)]
    around = shapely.box(-1, -1, 301, 3).difference(shapely.union_all(small))
    small[40] = shapely.box(120, 0, 122, 2.1)
    regions = [*small, around]
    found = []
    for most in (10**9, rooms.MANY):
        monkeypatch.setattr(rooms, "MANY", most)
        apart = rooms._apart([rooms._Room(region, "", None, ()) for region in regions])
        found.append([(shapely.to_wkb(room.region), len(room.anomalies)) for room in apart])
    assert found[0] == found[1]
    assert sum(overlaps for _, overlaps in found[1]) == 1
    touching = np.arange(100)
    assert rooms._overlapping(around, touching, np.array(regions)).tolist() == [40]


@pytest.mark.parametrize("layer", ["A-WALL", "0"])
def test_walls_that_cross_as_a_pattern_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, layer: str
) -> None:
    """Also where no layer shows walls, and the lines are only tried as walls."""
    monkeypatch.setattr(patterns, "MOST_CROSSING", 2000)
    drawing = ezdxf.new("R2010", units=6)
    for k in range(50):
        drawing.modelspace().add_line((0, 0.1 + k), (50, 0.1 + k), dxfattribs={"layer": layer})
        drawing.modelspace().add_line((0.1 + k, 0), (0.1 + k, 50), dxfattribs={"layer": layer})
    drawing.saveas(tmp_path / "net.dxf")
    with pytest.raises(InputError, match="cross more than 2000 times"):
        read_floor(tmp_path / "net.dxf", FloorOptions(units="m"))
