"""Times of tours are those of the paths that are driven."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stopgo.mission.console.plugins import Variant
from stopgo.mission.document.schedule import leg_times, turn_time
from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import Settings
from stopgo.planner.routing.legs import Legs
from stopgo.planner.task_allocation.tour_times import TourTimes


def test_corners_of_the_paths_that_are_driven_take_time() -> None:
    """A shift would be longer than it may be, if its paths counted as straight."""
    points, line = frozen([[4.0, 3.0], [0.0, 0.0]]), frozen([[4.0, 3.0], [4.0, 0.0], [0.0, 0.0]])
    lengths = np.array([[0.0, 7.0], [7.0, 0.0]])
    paths: Any = SimpleNamespace(lengths=lengths, path=lambda a, b: line if a < b else line[::-1])
    robot = robot_of(Settings())
    clock = TourTimes(
        legs=Legs(Variant("graph = lab", "lab", None, ours=False), paths, points),
        points=points, stops=1, robot=robot, pause_s=0.0, heading=np.empty(0), start_heading=(0.0,),
        closed=True,
    )  # fmt: skip
    there, turned, heading = leg_times(line[::-1].tolist(), heading=0.0, robot=robot)
    back, turned_back, _ = leg_times(line.tolist(), heading=heading, robot=robot)
    assert turn_time(np.pi, turn_rate=robot.turn_rate) < turned + turned_back
    assert clock.seconds((0,)) == pytest.approx(there + turned + back + turned_back, abs=1e-4)
