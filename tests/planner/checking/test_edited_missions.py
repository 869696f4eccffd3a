"""Missions edited after planning: `check --floor` recomputes every claim, and names the one that is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec import UNSET

from stopgo.command_line import main
from stopgo.mission.document import Mission, stop_names, with_digest
from stopgo.mission.files import mission_json
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.checking.claims import overclaims, recount
from stopgo.planner.checking.fit import misfits_on, other_machine
from stopgo.planner.checking.network_claims import network_overclaims
from tests.planner.worlds import hall, mission_of_hall, planned, two_rooms

change = msgspec.structs.replace
REGISTERING = Settings(overlap=0.1, range=2.5)


def first_stop(mission: Mission, **details: Any) -> Mission:
    return change(mission, stops=(change(mission.stops[0], **details), *mission.stops[1:]))


def paths(problems: Any) -> list[str]:
    return [problem.path for problem in problems]


def without_last_stop(mission: Mission) -> Mission:
    """The mission that ends one stop earlier; the pairs of that stop are gone too."""
    gone = mission.stops[-1].id
    shorter = change(mission, stops=mission.stops[:-1])
    if mission.network is UNSET:
        return shorter
    pairs = tuple(pair for pair in mission.network if gone not in (pair.a, pair.b))
    return change(shorter, network=pairs)


def test_a_dropped_stop_leaves_a_room_below_its_required_fraction() -> None:
    settings = Settings(coverage=0.3, kind_coverage=0.0, register=False)
    mission, nouns = planned(two_rooms(0.9), settings)
    space = nouns[NavigableSpace]
    assert list(overclaims(mission, recount(mission, space), None)) == []
    one = without_last_stop(mission)
    problems = list(overclaims(one, recount(one, space), None))
    assert paths(problems) == ["$.origin.parameters.room_coverage"]
    assert "is 0.7, but the stops see" in problems[0].message


def test_a_dropped_stop_leaves_a_kind_below_its_required_fraction() -> None:
    mission, nouns = planned(two_rooms(0.9), Settings(coverage=0.3, room_coverage=0.0, kind_coverage=0.9))
    one = without_last_stop(mission)
    problems = overclaims(one, recount(one, nouns[NavigableSpace]), None)
    assert paths(problems) == ["$.origin.parameters.kind_coverage"]


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"speed": 60.0}, "$.robot.speed"),
        ({"turn_rate": 9.0}, "$.robot.turn_rate"),
        ({"acceleration": 60.0}, "$.robot.acceleration"),
    ],
)
def test_a_robot_faster_than_planned_is_reported(changes: dict[str, float], path: str) -> None:
    mission = mission_of_hall()
    assert list(other_machine(mission, Settings())) == []
    bold = change(mission, robot=change(mission.robot, **changes))
    assert paths(other_machine(bold, Settings())) == [path]
    slow = change(mission, robot=change(mission.robot, speed=0.1))
    assert list(other_machine(slow, Settings())) == []


def test_no_parameters_excuse_what_no_robot_does() -> None:
    settings = Settings(speed=60.0, tolerance=8.0)
    mission, _ = planned(hall(6, 4), settings)
    assert "$.robot.speed" in paths(other_machine(mission, settings))
    assert "$.stops[0].tolerance_m" in paths(other_machine(mission, settings))


def test_a_scan_shorter_than_planned_is_reported() -> None:
    mission = mission_of_hall()
    scan = mission.stops[0].scan
    empty = first_stop(mission, scan=change(scan, duration_s=0.0))
    (problem,) = other_machine(empty, Settings())
    assert str(problem) == "$.stops[0].scan.duration_s: is 0, but the plan's scans take 60 s"
    longer = first_stop(mission, scan=change(scan, duration_s=90.0))
    assert list(other_machine(longer, Settings())) == []


@pytest.mark.parametrize(
    ("edited", "path"),
    [
        (lambda mission: first_stop(mission, settle_s=0.0), "$.stops[0].settle_s"),
        (
            lambda mission: first_stop(mission, scan=change(mission.stops[0].scan, profile="quick")),
            "$.stops[0].scan.profile",
        ),
        (
            lambda mission: change(mission, scanner=change(mission.scanner, step_deg=0.01)),
            "$.scanner.step_deg",
        ),
        (lambda mission: change(mission, policy=change(mission.policy, own_way=True)), "$.policy.own_way"),
        (
            lambda mission: change(mission, policy=change(mission.policy, battery_min=0.0)),
            "$.policy.battery_min",
        ),
    ],
)
def test_scans_and_drives_bolder_than_planned_are_reported(
    edited: Callable[[Mission], Mission], path: str
) -> None:
    """Each of them sends a robot to do what the plan did not count with."""
    assert paths(other_machine(edited(mission_of_hall()), Settings())) == [path]


def test_a_position_tolerance_wider_than_planned_is_reported() -> None:
    mission = mission_of_hall()
    (problem,) = other_machine(first_stop(mission, tolerance_m=8.0), Settings())
    assert str(problem) == "$.stops[0].tolerance_m: is 8; the plan allows at most 0.05"


def test_a_doorway_mark_away_from_every_doorway_is_reported() -> None:
    mission, _ = planned(two_rooms(0.9))
    marked = first_stop(mission, doorway=True)
    (problem,) = misfits_on(two_rooms(0.9), marked, Settings())
    assert problem.path == "$.stops[0].doorway"


@pytest.fixture(scope="module")
def network() -> tuple[Mission, NavigableSpace]:
    mission, nouns = planned(hall(12, 4), REGISTERING)
    assert len(mission.stops) >= 3 and mission.network
    return mission, nouns[NavigableSpace]


def without_errors(mission: Mission) -> Mission:
    """The mission as versions wrote it that predicted no error of a scan."""
    return change(mission, stops=tuple(change(stop, error=UNSET) for stop in mission.stops))


def test_the_network_of_a_plan_is_as_claimed(network: tuple[Mission, NavigableSpace]) -> None:
    assert list(network_overclaims(*network)) == []


@pytest.mark.parametrize("pairs", [UNSET, ()])
def test_a_network_that_was_removed_is_reported(pairs: Any, network: tuple[Mission, NavigableSpace]) -> None:
    mission, space = network
    edited = change(without_errors(mission), network=pairs)
    assert paths(network_overclaims(edited, space)) == ["$.network"]


def test_errors_that_no_network_holds_are_reported(network: tuple[Mission, NavigableSpace]) -> None:
    mission, space = network
    found = paths(network_overclaims(change(mission, network=()), space))
    assert [path for path in found if path.endswith("major_m")] and found[-1] == "$.network"


def test_a_network_that_a_dropped_stop_tears_is_reported(network: tuple[Mission, NavigableSpace]) -> None:
    mission, space = network
    last = mission.stops[-1].id
    assert isinstance(mission.network, tuple)
    kept = tuple(pair for pair in mission.network if last not in (pair.a, pair.b))
    (problem,) = network_overclaims(change(without_errors(mission), network=kept), space)
    assert problem.message.startswith(f"leaves {last} apart")


def test_scans_that_no_candidate_connects_may_stay_apart() -> None:
    """Two rooms that see nothing of each other: the plan says so itself, and its mission is in order."""
    settings = replace(REGISTERING, doors="closed")
    mission, nouns = planned(two_rooms(0.9), replace(settings, overlap=0.9))
    assert list(network_overclaims(mission, nouns[NavigableSpace])) == []
    assert stop_names(len(mission.stops)) == [stop.id for stop in mission.stops]


def test_a_follow_up_mission_may_leave_its_scans_apart(network: tuple[Mission, NavigableSpace]) -> None:
    mission, space = network
    followed = change(without_errors(mission), network=(), id="0" * 32)
    assert list(network_overclaims(followed, space)) == []


@pytest.mark.parametrize(
    "edited, text",
    [
        (lambda stops: stops[:-1], "which is not a stop"),
        (lambda stops: (change(stops[0], id="mine"), *stops[1:]), "which is not a stop"),
        (lambda stops: (), "$.stops: is empty"),
        (lambda stops: (*stops[:-1], change(stops[-1], approach=())), "approach: is empty"),
        (lambda stops: (*stops[:-1], change(stops[-1], x=9000.0)), "lies 89"),
    ],
    ids=["dropped", "renamed", "none", "no leg", "far"],
)
def test_the_command_checks_stops_that_were_edited_by_hand(
    edited: Callable[[Any], Any], text: str, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The pairs of the network still name the stops as planned."""
    mission = mission_json.read(made)
    mission_json.write(with_digest(change(mission, stops=edited(mission.stops))), made)
    assert main(["check", str(made), "--floor", str(made.with_name("floor.dxf"))]) == 1
    assert text in capsys.readouterr().out
