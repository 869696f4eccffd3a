"""`--minimise time` from the command line on: reports, pictures, checks, follow-up missions, allocation."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from dataclasses import replace
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.document import mission_id
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import InputError
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.plan import Plan
from stopgo.mission.settings import Settings, recorded_values
from stopgo.mission.stages import Route
from stopgo.mission.stages.plan_results import PlanResults
from stopgo.planner import plan
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, top_up
from stopgo.planner.task_allocation.dividing import division_cost
from tests.faults.sizes import some
from tests.planner.worlds import box, column, floor_of, hall, shell

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
FLOOR = hall(14.0, 9.0, column("c1", 5.0, 4.0, 1.5), column("c2", 9.5, 5.0, 1.5))
START = (1.5, 1.5, 0.0)


@cache
def made(**changes: Any) -> Plan:
    return plan(FLOOR, Settings(range=3.5, **changes))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample office, planned for the least time."""
    folder = tmp_path_factory.mktemp("plan")
    (folder / "plan.toml").write_text('[plan]\nminimise = "time"\n')
    parameters, said = str(folder / "plan.toml"), StringIO()
    with redirect_stdout(said):
        assert main(["plan", str(SAMPLE), "-o", str(folder), "-p", parameters, "--no-sheets", "--json"]) == 0
    (folder / "told.json").write_text(said.getvalue())
    return folder


def test_the_report_reports_what_was_saved_and_what_no_plan_is_below(written: Path) -> None:
    told = json.loads((written / "told.json").read_text())
    time = told["least_time"]
    assert time["bound_s"] < time["total_s"] < time["two_step_s"]
    assert time["total_s"] == pytest.approx(told["schedule"]["total_s"], abs=1e-9)
    assert time["saved_s"] == pytest.approx(time["two_step_s"] - time["total_s"])
    assert "Least time" in (written / "plan.svg").read_text()


def test_a_plan_for_the_least_time_passes_its_check(
    written: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission, coverage = str(written / "mission.json"), str(written / "coverage.json")
    assert main(["check", mission, "--floor", str(SAMPLE), "--coverage-file", coverage]) == 0
    assert json.loads((written / "mission.json").read_text())["origin"]["parameters"]["minimise"] == "time"


def test_a_person_reads_both_numbers() -> None:
    from stopgo.planner.commands.plan_report import time_lines, time_table

    found = made(minimise="time", d_dis=0.2, grid=2.0).route
    assert found.time is not None
    (line,) = time_lines(found)
    assert "no plan over these candidates takes less by shortest paths than" in line
    on_grid = made(minimise="time", d_dis=0.2, grid=2.0, graph="grid").route
    (on_a_grid,) = time_lines(on_grid)
    paths = [time_table(route)["least_time"]["bound_paths"] for route in (found, on_grid)]
    assert paths == ["shortest", "any"]
    assert "no plan over these candidates takes less than" in on_a_grid  # by any paths
    assert PlanResults.of({Route: found}).properties["two_step_s"] == round(found.time.two_step_s, 1)


def test_without_it_plans_and_ids_are_what_they_were() -> None:
    assert "minimise" not in recorded_values(Settings(minimise="stops"))
    plain, asked = made(), made(minimise="stops")
    assert plain.mission == asked.mission
    assert plain.route.time is None
    ids = {mission_id(FLOOR.source, Settings(minimise=what), "1") for what in ("stops", "time")}  # type: ignore[arg-type]
    assert len(ids) == 2


def test_settings_are_printed_with_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--minimise", "time", "--print-config"]) == 0
    assert 'minimise = "time"' in capsys.readouterr().out


@pytest.mark.parametrize("value", ["length", "", "TIME"])
def test_another_word_is_refused(value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(SAMPLE), "--minimise", value]) == 2
    assert f"--minimise {value}: known: stops, time" in capsys.readouterr().err
    with pytest.raises(InputError, match="known: stops, time"):
        read_settings(None, {"minimise": value})


def test_a_floor_where_nothing_is_to_be_seen_is_reported_as_ever(tmp_path: Path) -> None:
    from stopgo.mission.errors import NegativeResult

    bare = floor_of(box(0, 0, 6, 4))
    with pytest.raises(NegativeResult, match="target"):
        plan(bare, Settings(minimise="time"))
    with pytest.raises(NegativeResult):
        plan(floor_of(box(0, 0, 1, 1), elements=(shell(0, 0, 1, 1),)), Settings(minimise="time"))


@pytest.mark.parametrize("changes", some([{"robots": 2}, {"shift": 300.0}], every=2), ids=str)
def test_shared_out_it_is_never_slower_either(changes: dict[str, Any]) -> None:
    from stopgo.mission.stages.division import DividedRoute

    def worth(found: Plan) -> tuple[float, float]:
        shared = found.divided
        assert shared is not None
        routes = tuple(share.route for share in shared.shares)
        return division_cost(DividedRoute(shared.kind, routes, None, shared.bound, ""))

    plain, quick = (made(start=START, minimise=what, **changes) for what in ("stops", "time"))
    assert worth(quick) <= worth(plain)
    time = quick.route.time
    assert time is not None
    assert time.seconds == pytest.approx(schedule(quick.divided.whole.mission).total_s)  # type: ignore[union-attr]


def test_a_further_mission_is_for_the_least_time_too() -> None:
    found = {}
    for what in ("stops", "time"):
        planned = made(start=START, minimise=what)
        known = PlannedFloor(planned.floor, planned.settings, planned.mission)
        stops = planned.mission.stops[:2]
        further = top_up(known, np.array([(stop.x, stop.y, stop.heading) for stop in stops]))
        assert further is not None
        found[what] = further
    assert found["time"].origin.parameters["minimise"] == "time"
    assert found["time"].stops


def all_and_sure(cover: Any, settings: Settings) -> tuple[Any, int]:
    """A selector that takes every candidate, and says that no fewer will do."""
    return np.arange(cover.rows), cover.rows


def test_a_bound_that_another_selector_claims_is_not_believed() -> None:
    floor = hall(8.0, 6.0, column("c", 4.0, 3.0, 0.8))
    selector = f"{__name__}:all_and_sure"
    settings = Settings(range=5.0, d_dis=0.2, grid=1.5, selector=selector, minimise="time", refine=False)
    found = plan(floor, settings)
    plain = plan(floor, replace(settings, selector="default"))
    assert found.route.time is not None and plain.route.time is not None
    assert found.route.time.bound == pytest.approx(plain.route.time.bound)
    assert found.route.time.bound < found.route.time.seconds


@pytest.mark.parametrize(
    "changes",
    [
        {"selector": "greedy"},
        {"selector": "exact"},
        {"graph": "grid", "router": "aco"},
        {"candidates": "triangulation"},
        {"coverage_rule": "paper"},
        {"selector": "anywhere", "range": 5.0, "grid": 3.0},
    ],
    ids=str,
)
def test_every_way_of_planning_can_be_asked_for_it(changes: dict[str, Any]) -> None:
    floor = hall(8.0, 6.0, column("c", 4.0, 3.0, 0.8))
    found = plan(floor, Settings(**{"range": 3.0, "d_dis": 0.2, **changes}, minimise="time"))
    time = found.route.time
    assert time is not None
    assert 0 < time.bound <= time.seconds <= time.two_step_s
    assert schedule(found.mission).total_s == pytest.approx(time.seconds)
