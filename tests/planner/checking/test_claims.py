"""Recount of a mission's coverage claims: a plan's claims hold, and excess claims are reported."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files.coverage_json import Coverage, coverage_json
from stopgo.mission.files.mission_json import read, write
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, Route, Selection
from stopgo.mission.stages.figures import percent
from stopgo.planner import plan
from stopgo.planner.checking.claims import Recount, overclaims, recount
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.visibility.sight.sight import sight
from tests.faults.sizes import some
from tests.journeys.test_base import without_extras
from tests.planner.worlds import (
    column,
    hall,
    moved,
    planned,
    shifted,
    turned,
    two_rooms,
)

change = msgspec.structs.replace
HALL = hall(9, 6, column("a", 3, 3), column("b", 6, 3))
WORLDS: dict[str, tuple[FloorPlan, Settings]] = {
    "a hall": (HALL, Settings(coverage=0.95)),
    "a short range": (HALL, Settings(range=2.0)),
    "closed doors": (two_rooms(0.9), Settings(doors="closed", door_scan=True)),
    "a field of view": (HALL, Settings(fov=120.0)),
    "a field of view in a doorway": (two_rooms(0.9), Settings(doors="closed", door_scan=True, fov=100.0)),
    "limits on views": (
        HALL,
        Settings(max_incidence=60, near=1.0, density=5, angular_step=0.1, views=2, grid=2),
    ),
    "limits past closed doors": (
        two_rooms(0.9),
        Settings(doors="closed", door_scan=True, max_incidence=70, wall_height=2.6, near=0.8, views=2),
    ),
    "limits and a field of view": (HALL, Settings(fov=120.0, max_incidence=65, blind_cone=60, grid=2)),
    "triangulation": (HALL, Settings(candidates="triangulation")),
}


def counted(mission: Mission, nouns: dict[type, Any]) -> tuple[Recount, list[str]]:
    """The recount on the floor it was planned on, and what it reports."""
    found = recount(mission, nouns[NavigableSpace])
    coverage = msgspec.json.decode(coverage_json(nouns[Route], mission), type=Coverage)
    return found, [str(problem) for problem in overclaims(mission, found, coverage)]


MOVES = {"as drawn": shifted(0, 0), "turned": turned(17), "far off": shifted(5e5, 5.4e6)}


@pytest.mark.parametrize(("name", "by"), some([(name, by) for name in WORLDS for by in MOVES], every=3))
def test_what_a_plan_claims_is_so(name: str, by: str) -> None:
    floor, settings = WORLDS[name]
    mission, nouns = planned(moved(floor, MOVES[by]), settings)
    found, problems = counted(mission, nouns)
    assert problems == []
    assert [len(units) for units in found.by_stop] == [stop.sees.units for stop in mission.stops]
    assert np.array_equal(found.visible, nouns[Selection].visibility.visible)
    assert found.share == nouns[Selection].coverage


def test_sight_that_reaches_too_far_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def far(*given: Any, reach: float, **others: Any) -> Any:
        return sight(*given, reach=1.2 * reach, **others)

    monkeypatch.setattr(sys.modules["stopgo.planner.visibility.exact_sight"], "sight", far)
    mission, nouns = planned(HALL, Settings(range=2.0))
    found, problems = counted(mission, nouns)
    assert found.share is not None and found.share < 0.9
    assert {problem.partition(":")[0] for problem in problems} >= {
        "$.stops[0].sees.units",
        "$.stops[*].sees.new_units",
        "$.origin.parameters.coverage",
        "coverage $.total.seen",
        "coverage $.total.coverage",
        "coverage $.elements[0].seen",
    }


def test_both_figures_are_reported() -> None:
    mission, nouns = planned(HALL)
    first = mission.stops[0]
    more = change(first.sees, units=first.sees.units + 1, new_units=first.sees.new_units + 1)
    _, problems = counted(change(mission, stops=(change(first, sees=more), *mission.stops[1:])), nouns)
    total = sum(stop.sees.new_units for stop in mission.stops)
    units = first.sees.units
    assert problems == [
        f"$.stops[0].sees.units: is {units + 1}, but {first.id} sees {units}, counted line by line",
        f"$.stops[*].sees.new_units: is {total + 1}, but all stops see {total}, counted line by line",
    ]


def test_less_than_the_coverage_asked_for_is_reported_with_its_share() -> None:
    mission, nouns = planned(HALL, Settings(coverage=0.5, room_coverage=0, kind_coverage=0, range=3))
    space = nouns[NavigableSpace]
    asked = replace(space, settings=replace(space.settings, coverage=1.0))
    found = recount(mission, asked)
    (problem,) = overclaims(mission, found, None)
    assert str(problem) == f"$.origin.parameters.coverage: is 1, but the stops see {found.in_words()}"
    assert found.in_words().startswith(percent(nouns[Selection].coverage, digits=3))


def test_a_mission_that_claims_nothing_claims_no_coverage() -> None:
    mission, nouns = planned(HALL)
    bare = tuple(change(stop, sees=change(stop.sees, units=0, new_units=0)) for stop in mission.stops[:1])
    found = recount(change(mission, stops=bare), nouns[NavigableSpace])
    assert list(overclaims(change(mission, stops=bare), found, None)) == []
    assert found.share is not None and found.share < 0.9


def test_candidates_of_another_program_are_not_loaded() -> None:
    """A mission may come from anywhere: checking it must run nothing that it names."""
    mission, nouns = planned(HALL)
    space = nouns[NavigableSpace]
    settings = replace(space.settings, candidates="tests.planner.no_such_module:generate")
    found = recount(mission, replace(space, settings=settings))
    assert found.visible is None
    assert found.as_json()["share"] is None
    assert "total unknown: --candidates tests.planner.no_such_module:generate" in found.in_words()
    assert list(overclaims(mission, found, None)) == []


# ---- the command ----


def check(mission: Path, *options: str) -> int:
    return main(["check", str(mission), "--floor", str(mission.with_name("floor.dxf")), *options])


def test_check_reports_the_coverage_it_counted(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coverage = json.loads(made.with_name("coverage.json").read_text())["total"]
    assert check(made, "--coverage-file", str(made.with_name("coverage.json"))) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    share = math.floor(1e5 * coverage["seen"] / coverage["visible"]) / 1e3
    assert last == (
        f"coverage {share:.3f} % ({coverage['seen']} of {coverage['visible']} units), counted line by line"
    )
    assert check(made, "--json") == 0
    told = json.loads(capsys.readouterr().out)["coverage"]
    assert (told["seen"], told["visible"]) == (coverage["seen"], coverage["visible"])


def test_check_finds_a_coverage_that_is_not_so(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = made.with_name("coverage.json")
    coverage = json.loads(path.read_text())
    coverage["total"]["seen"] += 1
    path.write_text(json.dumps(coverage))
    assert check(made, "--coverage-file", str(path)) == 1
    seen = coverage["total"]["seen"]
    expected = f"coverage $.total.seen: is {seen}, but all stops see {seen - 1}, counted line by line"
    assert expected in capsys.readouterr().out


def test_check_finds_that_two_stops_at_one_place_see_less(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = read(made)
    first, *_, last = mission.stops
    here = (first.x, first.y)
    write(change(mission, stops=(first, change(last, x=first.x, y=first.y, approach=(here,)))), made)
    assert check(made, "--json") == 1
    problems = json.loads(capsys.readouterr().out)["problems"]
    assert {"$.stops[*].sees.new_units", "$.origin.parameters.coverage"} <= {
        item["path"] for item in problems
    }


def test_coverage_is_checked_on_a_floor_only(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(made), "--coverage-file", "coverage.json"]) == 2
    assert "give it with --floor" in capsys.readouterr().err


def test_without_the_extra_the_digest_is_checked_and_the_rest_is_reported(made: Path) -> None:
    front_door = "from stopgo.command_line import main\nsys.exit(main(sys.argv[1:]))"
    floor = made.with_name("floor.dxf")
    done = without_extras(front_door, "check", str(made), "--floor", str(floor))
    assert done.returncode == 0
    assert "valid" in done.stdout
    assert "neither clearances nor coverage were checked" in done.stderr
    assert done.stderr.count("\n") == 1
    floor.write_bytes(floor.read_bytes() + b"\n")
    done = without_extras(front_door, "check", str(made), "--floor", str(floor))
    assert (done.returncode, done.stdout) == (2, "")
    assert "is not the floor that" in done.stderr


@pytest.fixture
def hall_claims() -> tuple[Mission, Recount, dict[str, Any]]:
    """A plan, its recount, and its coverage.json as it was written."""
    report = PlanReport(plan(two_rooms(0.9), Settings(grid=2)).first, {}, {})
    mission, route = report.mission, report.part.route
    written = json.loads(coverage_json(route, mission, report.figures))
    return mission, recount(mission, report.part.space), written


@pytest.mark.parametrize(
    ("place", "key", "value"),
    [
        (("kinds", "walls"), "seen", lambda seen: seen + 1),
        (("kinds", "walls"), "coverage", lambda coverage: coverage + 1e-3),
        (("total",), "seen_m", lambda metres: metres + 0.01),
        (("total",), "visible", lambda visible: visible - 1),
        (("elements", 0), "coverage", lambda coverage: coverage + 1e-3),
        (("elements", 0), "visible_m", lambda metres: metres - 0.01),
        (("elements", 0), "global_id", lambda _: "2O2Fr$t4X7Zf8NOew3FNr2"),
        (("rooms", 0), "coverage", lambda coverage: coverage + 1e-3),
        (("rooms", 0), "seen", lambda metres: metres + 0.01),
        (("rooms", 0), "room", lambda name: f"{name} and more"),
        (("network", "pairs", 0), "share", lambda share: share + 1e-3),
    ],
)
def test_each_figure_of_coverage_json_is_checked(
    place: tuple[str | int, ...],
    key: str,
    value: Callable[[Any], Any],
    hall_claims: tuple[Mission, Recount, dict[str, Any]],
) -> None:
    mission, found, written = hall_claims
    assert list(overclaims(mission, found, msgspec.convert(written, Coverage))) == []
    row: Any = written
    for step in place:
        row = row[step]
    row[key] = value(row[key])
    (problem,) = overclaims(mission, found, msgspec.convert(written, Coverage))
    assert problem.path.startswith(f"coverage $.{place[0]}")


def test_a_segment_that_no_stop_sees_is_reported(
    hall_claims: tuple[Mission, Recount, dict[str, Any]],
) -> None:
    """Drawings and exports show what segments claim."""
    mission, found, written = hall_claims
    row = next(row for item in written["elements"] for row in item["segments"] if not row["seen"])
    row["seen"] = [[0.0, 1.0]]
    (problem,) = overclaims(mission, found, msgspec.convert(written, Coverage))
    assert problem.path == "coverage $.elements[*].segments"
    row["seen"] = [[-1.0, 2.0]]
    (problem,) = overclaims(mission, found, msgspec.convert(written, Coverage))
    assert "differs from this floor" in problem.message
