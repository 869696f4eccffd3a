"""Every scan of a plan that registers carries its predicted error, which `check --floor` counts again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from stopgo.mission.document import Mission, PositionError
from stopgo.mission.document.problems import problems_of
from stopgo.mission.stages import NavigableSpace
from stopgo.planner import plan
from stopgo.planner.checking.network_claims import network_overclaims
from stopgo.planner.overlap.network_error import error_ellipses
from stopgo.planner.overlap.registered import predicted_errors
from tests.planner.overlap.test_plans_that_register import ASKED, LOOSE, three_rooms
from tests.planner.worlds import planned


@pytest.fixture(scope="module")
def made() -> tuple[Mission, NavigableSpace]:
    mission, nouns = planned(three_rooms(), replace(ASKED, range=3.0))
    return mission, nouns[NavigableSpace]


def with_error(mission: Mission, index: int, **change: float) -> Mission:
    """The mission with another predicted error of one scan."""
    stops = list(mission.stops)
    before = stops[index].error
    assert isinstance(before, PositionError)
    stops[index] = msgspec.structs.replace(stops[index], error=msgspec.structs.replace(before, **change))
    return msgspec.structs.replace(mission, stops=tuple(stops))


def errors_of(mission: Mission) -> list[PositionError]:
    found = [stop.error for stop in mission.stops]
    assert all(isinstance(error, PositionError) for error in found)
    return found  # type: ignore[return-value]


def test_every_scan_of_a_network_has_an_ellipse_and_one_holds_the_frame(
    made: tuple[Mission, NavigableSpace],
) -> None:
    mission, space = made
    errors = errors_of(mission)
    assert len(errors) > 2
    assert sum(error.major_m == 0 for error in errors) == 1
    assert all(0 <= error.minor_m <= error.major_m < 0.01 for error in errors)
    assert not list(network_overclaims(mission, space))
    assert not list(problems_of(mission))


def test_a_plan_that_need_not_register_claims_no_errors() -> None:
    assert all(stop.error is msgspec.UNSET for stop in plan(three_rooms(), LOOSE).mission.stops)


@pytest.mark.parametrize("change", [{"major_m": 0.0}, {"minor_m": 0.0, "major_m": 1e-5}])
def test_a_smaller_error_than_the_network_gives_is_a_problem(
    made: tuple[Mission, NavigableSpace], change: dict[str, float]
) -> None:
    mission, space = made
    worst = int(np.argmax([error.major_m for error in errors_of(mission)]))
    problems = [problem.path for problem in network_overclaims(with_error(mission, worst, **change), space)]
    assert any(path.startswith(f"$.stops[{worst}].error") for path in problems)


def test_errors_without_pairs_that_hold_them_are_problems(made: tuple[Mission, NavigableSpace]) -> None:
    mission, space = made
    for network in ((), msgspec.UNSET):
        bare = msgspec.structs.replace(mission, network=network)
        problems = [item.message for item in network_overclaims(bare, space)]
        assert any("no pair of the network holds s" in message for message in problems)


@pytest.mark.parametrize(
    "change",
    [{"major_m": -1.0}, {"major_m": math.inf}, {"minor_m": 9.0}, {"direction": 4.0}, {"direction": math.nan}],
)
def test_an_error_that_is_none_is_named(made: tuple[Mission, NavigableSpace], change: dict[str, Any]) -> None:
    mission, _ = made
    (key, *_) = change
    paths = [problem.path for problem in problems_of(with_error(mission, 0, **change))]
    assert any(path.startswith("$.stops[0].error.") for path in paths), key


def test_the_ellipse_of_a_covariance_has_its_axes_and_direction() -> None:
    turned = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    covariance = turned @ np.diag([9e-6, 1e-6]) @ turned.T
    nothing = np.full((2, 2), np.inf)
    found = error_ellipses(np.array([covariance, nothing]))
    assert found[0] == pytest.approx([3e-3, 1e-3, 0.5])
    assert np.isinf(found[1]).all()


def test_the_mission_carries_what_the_report_reports() -> None:
    made = plan(three_rooms(), replace(ASKED, range=3.0)).first
    told = predicted_errors(made.route)
    assert [error.major_m for error in errors_of(made.mission)] == pytest.approx(told.m.tolist(), abs=1e-5)
