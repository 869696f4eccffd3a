"""The differential drive: times and places checkable on paper."""

from __future__ import annotations

import math
import os
from itertools import pairwise
from pathlib import Path

import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.motion import Straight, along
from stopgo.bridge.robot.simulator import SimulatedBase, World, read_world, write_world
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Pose

ORIGIN = Pose(x=0.0, y=0.0, heading=0.0)


@pytest.mark.parametrize(
    ("length", "seconds"),
    [(2.0, 2 / 0.5 + 0.5 / 0.5), (0.5, 2.0), (0.125, 2 * math.sqrt(0.125 / 0.5)), (0.0, 0.0)],
)
def test_a_straight_takes_trapezoid_or_triangle_time(length: float, seconds: float) -> None:
    assert Straight(ORIGIN, length, 0.5, 0.5).duration == pytest.approx(seconds)


def test_a_corner_is_turned_in_place() -> None:
    motion = along(ORIGIN, [(1, 0), (1, 1)], 0.0, speed=1.0, turn_rate=math.pi / 2, acceleration=1.0)
    assert motion.duration == pytest.approx(2 + 1 + 2 + 1)
    turning, speed = motion.at(2.5)
    assert (turning.x, turning.y, speed) == pytest.approx((1.0, 0.0, 0.0))
    assert turning.heading == pytest.approx(math.pi / 4)
    end, speed = motion.at(100.0)
    assert (end.x, end.y, end.heading, speed) == pytest.approx((1.0, 1.0, 0.0, 0.0))


def test_a_straight_is_continuous_and_never_faster_than_allowed() -> None:
    straight = Straight(ORIGIN, 1.7, 0.5, 0.4)
    places = [straight.at(step * 0.01) for step in range(500)]
    for (a, _), (b, speed) in pairwise(places):
        assert 0 <= b.x - a.x <= 0.5 * 0.01 + 1e-9
        assert speed <= 0.5
    assert places[-1][0].x == pytest.approx(1.7)


def test_a_robot_that_was_only_stopped_may_still_be_put_at_the_start() -> None:
    base = SimulatedBase(clock=SimulatedClock())
    base.stop()
    base.stand_at_start(Pose(x=3.0, y=4.0, heading=0.0))
    assert (base.pose().x, base.pose().y) == (3.0, 4.0)
    base.stand_at_start(ORIGIN)
    assert (base.pose().x, base.pose().y) == (3.0, 4.0)


def test_a_broken_note_of_where_the_robot_stands_is_refused_in_one_line(tmp_path: Path) -> None:
    keep = tmp_path / "world.json"
    keep.write_text("{")
    with pytest.raises(InputError, match="remove it"):
        read_world(keep)


def test_where_the_robot_stands_is_synced_before_it_replaces_the_old_pose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    sync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda number: (calls.append("sync"), sync(number))[1])
    monkeypatch.setattr(os, "replace", lambda old, new: (calls.append("replace"), replace(old, new))[1])
    write_world(tmp_path / "world.json", World(pose=ORIGIN, battery=0.5, placed=True))
    assert calls == ["sync", "replace"]
    assert read_world(tmp_path / "world.json").battery == 0.5
