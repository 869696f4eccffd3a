"""A standstill in AUTO that neither a wait nor a motion explains is a stall, whatever the item is."""

from __future__ import annotations

import pytest

from stopgo.mission.mavlink.following.listed_mission import listed_mission
from stopgo.mission.mavlink.following.progress_watch import STALLED_S, ProgressWatch
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Pose
from tests.mission.mavlink.following.worlds import tour

LISTED = listed_mission(tour(), translate(tour(), "ardupilot"))
HERE = Pose(x=1.0, y=0.0, heading=0.0)


def stalled_s(
    place: int, *, lasts_s: float, moves: float = 0.0, turns: float = 0.0, drives: bool = True, x: float = 1.0
) -> float:
    """Stall that is reported after so long at an item; motion per second."""
    watch = ProgressWatch()
    for tenth in range(round(lasts_s * 10) + 1):
        pose = Pose(x=x + moves * tenth / 10, y=0.0, heading=turns * tenth / 10)
        watch.take(pose, LISTED, place, tenth * 10**8, drives=drives)
    return watch.stalled_s(LISTED)


def test_a_vehicle_that_stands_on_a_leg_is_stalled() -> None:
    assert stalled_s(LISTED.stops[1].at, lasts_s=20.0, x=-5.0) == pytest.approx(20.0)


@pytest.mark.parametrize("motion", [{"moves": 0.02}, {"turns": 0.02}, {"moves": 0.5}])
def test_a_vehicle_that_creeps_or_turns_is_not(motion: dict[str, float]) -> None:
    assert stalled_s(LISTED.stops[1].at, lasts_s=60.0, **motion) < STALLED_S


@pytest.mark.parametrize(
    "place", [place for items in LISTED.stops for place in range(items.scan, items.after)]
)
def test_a_wait_of_the_list_explains_its_own_time_and_no_more(place: int) -> None:
    wait_s = LISTED.wait_s(place, place + 1)
    assert stalled_s(place, lasts_s=wait_s) == 0.0
    assert stalled_s(place, lasts_s=wait_s + STALLED_S) == pytest.approx(STALLED_S)


def test_the_hold_of_a_waypoint_explains_a_standstill_at_it_and_not_on_the_leg() -> None:
    at, stop = LISTED.stops[0].at, LISTED.mission.stops[0]
    hold_s = LISTED.wait_s(at, at + 1)
    assert hold_s > 0
    assert stalled_s(at, lasts_s=10.0, x=stop.x) == pytest.approx(10.0 - hold_s)
    assert stalled_s(at, lasts_s=10.0, x=stop.x + 5.0) == pytest.approx(10.0)


def test_another_mode_the_end_and_an_unknown_list_explain_a_standstill() -> None:
    assert stalled_s(LISTED.stops[1].at, lasts_s=60.0, drives=False) == 0.0
    assert stalled_s(LISTED.end, lasts_s=60.0) == 0.0
    watch = ProgressWatch()
    watch.take(HERE, None, None, 0, drives=True)
    watch.take(HERE, None, None, 10**11, drives=True)
    assert watch.stalled_s(LISTED) == 0.0
