"""Position in a list as a process sees it that begins to look at any moment."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from stopgo.mission.mavlink.following.list_position import ListPosition
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.states import Run
from tests.mission.mavlink.following.worlds import tour


@pytest.fixture
def listed() -> ListedMission:
    mission = tour(settle_s=6.0)
    return listed_mission(mission, translate(mission, "px4"))


def current(listed: ListedMission, place: int) -> Any:
    return SimpleNamespace(seq=listed.sequence(place), mission_state=3, total=listed.end)


def seen(listed: ListedMission, *reports: tuple[int, float, int]) -> bool:
    """True if the run's first stop was jumped over, by reports of place, time and the vehicle's own time."""
    position = ListPosition()
    for place, at_s, boot_ms in reports:
        position.take_current(current(listed, place), listed, boot_ms=boot_ms, now_ns=round(at_s * 1e9))
    return position.is_jumped(Run(state="RUNNING", at=0), listed)


def test_a_jump_is_seen_by_a_process_whose_first_report_came_before_the_vehicles_clock(
    listed: ListedMission,
) -> None:
    first, after = listed.stops[0].first, listed.stops[0].after
    assert seen(listed, (first, 1.0, 0), (first, 1.1, 90_000), (after, 2.0, 90_900))


def test_the_rest_of_a_wait_that_began_before_anybody_looked_is_no_jump(listed: ListedMission) -> None:
    wait = listed.stops[0].after - 1
    assert listed.wait_s(wait, wait + 1) > 1.0
    assert not seen(listed, (wait, 1.0, 90_000), (wait + 1, 1.5, 90_500))


def test_a_wait_that_was_seen_to_begin_and_is_cut_short_is_a_jump(listed: ListedMission) -> None:
    settle = listed.stops[0].at + 1
    assert listed.wait_s(settle, settle + 1) == 6.0
    reports = ((settle - 1, 0.5, 89_500), (settle, 1.0, 90_000), (listed.stops[0].after, 2.0, 91_000))
    assert seen(listed, *reports)
