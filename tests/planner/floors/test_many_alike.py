"""Floods of shapes that are alike take time and memory as their number grows, not as its square."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions, dxf, read_floor, rings
from stopgo.planner.floors.linework.wall_gaps import _facing


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


def test_walls_that_cross_as_a_pattern_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dxf, "MOST_CROSSING", 2000)
    drawing = ezdxf.new("R2010", units=6)
    for k in range(50):
        drawing.modelspace().add_line((0, 0.1 + k), (50, 0.1 + k), dxfattribs={"layer": "A-WALL"})
        drawing.modelspace().add_line((0.1 + k, 0), (0.1 + k, 50), dxfattribs={"layer": "A-WALL"})
    drawing.saveas(tmp_path / "net.dxf")
    with pytest.raises(InputError, match="cross more than 2000 times"):
        read_floor(tmp_path / "net.dxf", FloorOptions(units="m"))
