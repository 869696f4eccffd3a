"""Best point of a small room: it depends on what lies around the room, not on the rest of the floor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from benchmarks.floors import copies
from stopgo.mission.settings import Settings
from stopgo.planner.candidates.fallback import best_point
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.stop_feasibility import StopFeasibility
from tests.planner.worlds import shared


def _best_points(feasibility: StopFeasibility) -> dict[str, np.ndarray | None]:
    floor, rooms = feasibility.space.floor, enumerate(feasibility.space.rooms)
    return {
        floor.rooms[room.room].id: best_point(feasibility, k) for k, room in rooms if room.room is not None
    }


def test_a_room_has_the_same_best_point_in_each_copy_of_its_floor() -> None:
    floor = shared("layered/duplex-l1.dxf")
    alone = _best_points(StopFeasibility(navigable(floor, Settings())))
    first = _best_points(StopFeasibility(navigable(copies(floor, 4), Settings())))
    assert sum(point is not None for point in alone.values()) >= 5
    for room, point in alone.items():
        found = first[f"0-{room}"]
        assert (point is None) == (found is None)
        assert point is None or np.allclose(point, found, atol=1e-6)


def test_only_what_lies_near_a_room_is_widened_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    feasibility = StopFeasibility(navigable(copies(shared("layered/duplex-l1.dxf"), 6), Settings()))
    around, corners = StopFeasibility.around, []

    def counted(self: StopFeasibility, shape: Any, margin: float) -> tuple[Any, Any]:
        found = around(self, shape, margin)
        corners.append(shapely.get_num_coordinates(found).sum())
        return found

    monkeypatch.setattr(StopFeasibility, "around", counted)
    _best_points(feasibility)
    whole = shapely.get_num_coordinates([feasibility.obstacles, feasibility.outline]).sum()
    assert np.median(corners) < whole / 10
