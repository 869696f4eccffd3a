"""Fit of a mission on a floor: a plan fits, and a moved stop is reported with its distance."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.mission_json import read, write
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.planner.checking.fit import misfits_on
from tests.faults.sizes import some
from tests.planner.test_command import drawn
from tests.planner.worlds import (
    box,
    column,
    corners,
    element,
    floor_of,
    hall,
    mission_of_hall,
    moved,
    planned,
    shell,
    shifted,
    turned,
    two_rooms,
    wall,
)

change = msgspec.structs.replace
DOORWAYS = Settings(door_scan=True)


def told(floor: FloorPlan, mission: Mission, settings: Settings | None = None) -> list[str]:
    return [str(problem) for problem in misfits_on(floor, mission, settings or Settings())]


def driven(*places: Point, doorway: bool = False, **details: Any) -> Mission:
    """A mission of one stop at the last of the places, driven to through the others."""
    mission = mission_of_hall()
    x, y = places[-1]
    stop = change(mission.stops[0], id="s1", x=x, y=y, doorway=doorway, approach=places)
    start = change(mission.start, x=places[0][0], y=places[0][1])
    return change(mission, start=start, stops=(stop,), **details)


PLANNED = {
    "a hall": (hall(6, 4), Settings()),
    "columns": (hall(9, 6, column("a", 3, 3), column("b", 6, 3)), Settings(tour="closed")),
    "a door as wide as the robot": (two_rooms(0.7), Settings()),
    "a stop in the doorway": (two_rooms(0.7), DOORWAYS),
    "a hole": (floor_of(box(0, 0, 8, 4, corners(3, 1, 5, 3)), elements=(column("c", 1, 0.5),)), Settings()),
    "no edge": (hall(6, 4), Settings(edge=0.0)),
}


MOVES = {"as drawn": shifted(0, 0), "turned": turned(17), "far off": shifted(5e5, 5.4e6)}


@pytest.mark.parametrize(("name", "by"), some([(name, by) for name in PLANNED for by in MOVES], every=2))
def test_what_is_planned_fits(name: str, by: str) -> None:
    floor, settings = PLANNED[name]
    there = moved(floor, MOVES[by])
    assert told(there, planned(there, settings)[0], settings) == []


def test_a_stop_keeps_d_sec_from_elements_exactly() -> None:
    floor = hall(6, 4, column("pillar", 3, 2, side=0.4))
    assert told(floor, driven((1.0, 1.0), (1.0, 2.0), (2.1, 2.0))) == []
    assert told(floor, driven((1.0, 1.0), (1.0, 2.0), (2.101, 2.0))) == [
        "$.stops[0]: s1 at (2.101, 2.000) is 0.699 m from pillar at (2.800, 2.000), less than 0.700 m"
    ]


def test_a_path_keeps_the_robots_radius_from_elements_exactly() -> None:
    floor = hall(6, 4, column("pillar", 3, 2, side=0.4))
    assert told(floor, driven((1.0, 1.0), (1.0, 1.45), (5.0, 1.45), (5.0, 1.0))) == []
    (problem,) = told(floor, driven((1.0, 1.0), (1.0, 1.451), (5.0, 1.451), (5.0, 1.0)))
    assert problem.startswith(
        "$.stops[0].approach[2]: the segment from (1.000, 1.451) to (5.000, 1.451) is 0.349 m from pillar at "
    )
    assert problem.endswith("less than 0.350 m")


def test_the_robot_that_is_sent_decides_if_it_is_the_wider_one() -> None:
    floor = hall(6, 4, column("pillar", 3, 2, side=0.4))
    mission = driven((1.0, 1.0), (1.0, 1.45), (5.0, 1.45), (5.0, 1.0))
    wide = change(mission, robot=change(mission.robot, radius=0.4))
    assert [problem.partition(":")[0] for problem in told(floor, wide)] == ["$.stops[0].approach[2]"]


def test_a_door_too_narrow_is_not_driven_through() -> None:
    (problem,) = told(two_rooms(0.69), driven((2.0, 2.0), (6.0, 2.0)))
    assert problem.startswith(
        "$.stops[0].approach[1]: the segment from (2.000, 2.000) to (6.000, 2.000) is 0.000 m"
    )
    assert "from door d (0.690 m clear, less than door_access 0.700 m)" in problem


def test_a_path_off_the_floor_is_reported() -> None:
    (stop, leg) = told(hall(6, 4), driven((3.0, 2.0), (3.0, 9.0)))
    assert stop == "$.stops[0]: s1 at (3.000, 9.000) is off the floor: (3.000, 9.000) lies 5.000 m outside it"
    assert leg.startswith(
        "$.stops[0].approach[1]: the segment from (3.000, 2.000) to (3.000, 9.000) is off the floor"
    )


def test_a_floor_edge_and_a_hole_are_kept_away_from() -> None:
    floor = floor_of(box(0, 0, 8, 4, corners(3, 1, 5, 3)), elements=(column("c", 1, 0.5),))
    (stop, leg) = told(floor, driven((2.0, 2.0), (2.7, 2.0)))
    assert "is 0.300 m from the floor's edge at (3.000, 2.000), less than 0.350 m" in stop
    assert leg.startswith("$.stops[0].approach[1]")
    (leg,) = told(floor, driven((2.0, 2.0), (6.0, 2.0)))
    assert "is off the floor: " in leg


def test_a_place_deep_within_an_element_is_reported() -> None:
    floor = floor_of(box(0, 0, 20, 10), elements=(element("core", "walls", box(5, 0, 15, 10)),))
    assert told(floor, driven((10.0, 5.0))) == [
        "$.stops[0]: s1 at (10.000, 5.000) lies within core",
        "$.stops[0].approach[0]: the segment from (10.000, 5.000) to (10.000, 5.000) lies within core",
    ]


def test_only_a_stop_in_a_doorway_may_stand_near_its_jambs() -> None:
    floor = two_rooms(0.8)
    assert told(floor, driven((2.0, 2.0), (4.0, 2.0), doorway=True)) == []
    assert len(told(floor, driven((2.0, 2.0), (4.0, 2.0)))) == 1
    assert len(told(floor, driven((2.0, 2.0), (1.0, 0.5), doorway=True))) == 2


def test_circles_to_avoid_are_avoided() -> None:
    settings = Settings(avoid=((3.0, 2.0, 1.0),))
    (problem,) = told(hall(6, 4), driven((2.0, 2.0), (2.5, 2.0)), settings)
    assert problem == "$.stops[0]: s1 is in the circle to avoid at (3.000, 2.000)"
    assert told(hall(6, 4), driven((1.0, 2.0), (1.9, 2.0)), settings) == []


def test_the_return_is_checked_too() -> None:
    floor = floor_of(box(0, 0, 8, 4), elements=(shell(0, 0, 8, 4), wall("w", box(3, 0, 3.2, 3.0))))
    mission = driven((2.0, 2.0), return_=((2.0, 2.0), (6.0, 2.0)))
    assert [problem.partition(":")[0] for problem in told(floor, mission)] == ["$.return[1]"]


# ---- the command ----


def problems(mission: Path, floor: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, str]]:
    assert main(["check", str(mission), "--floor", str(floor), "--json"]) == 1
    found: list[dict[str, str]] = json.loads(capsys.readouterr().out)["problems"]
    return found


def test_check_of_a_plan_on_its_floor_is_in_order(made: Path) -> None:
    assert main(["check", str(made), "--floor", str(made.with_name("floor.dxf"))]) == 0


def test_check_reports_a_stop_moved_to_a_wall(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(with_last(read(made), x=0.5), made)
    assert main(["check", str(made)]) == 0
    capsys.readouterr()
    stop, *less = problems(made, made.with_name("floor.dxf"), capsys)
    assert all("counted line by line" in problem["message"] for problem in less)
    assert stop["path"] == f"$.stops[{len(read(made).stops) - 1}]"
    assert "is 0.500 m from walls-" in stop["message"]


def test_check_names_the_stops_that_do_not_fit_the_floor(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = read(made)
    x, y = mission.stops[0].x, mission.stops[0].y
    later = drawn(made.with_name("later.dxf"), lambda d: d.box("COLUMNS", x + 0.5, y - 0.2, x + 0.9, y + 0.2))
    digest = hashlib.sha256(later.read_bytes()).hexdigest()
    write(change(mission, origin=change(mission.origin, floor_digest=digest)), made)
    others = problems(made, later, capsys)
    assert {"path": "$.stops[0]"}.items() <= others[0].items()
    assert "is 0.500 m from columns-" in others[0]["message"]


def test_check_reports_settings_that_are_none_and_of_another_robot(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor, mission = made.with_name("floor.dxf"), read(made)
    origin = change(mission.origin, parameters={**mission.origin.parameters, "d_sec": -1.0})
    write(change(mission, origin=origin), made)
    (problem,) = problems(made, floor, capsys)
    assert problem["path"] == "$.origin.parameters"
    assert "--clearance -1" in problem["message"]
    write(change(mission, robot=change(mission.robot, radius=0.3)), made)
    (problem,) = problems(made, floor, capsys)
    assert problem == {
        "path": "$.robot.radius",
        "message": "is 0.3, but $.origin.parameters.robot_radius planned with 0.35",
    }


def with_last(mission: Mission, *, x: float) -> Mission:
    """The last stop moved sideways; the way there ends there."""
    *before, last = mission.stops
    approach = (*last.approach[:-1], (x, last.y))
    stop: Stop = change(last, x=x, approach=approach)
    return change(mission, stops=(*before, stop))
