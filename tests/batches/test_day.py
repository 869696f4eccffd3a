"""Tests of a day's missions: allocation to robots and shifts, visits of earlier days, pages."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, permutations, product
from pathlib import Path

import pytest

from stopgo.batches import engine
from stopgo.batches.batch_file import read_day
from stopgo.batches.day_page import begin_of
from stopgo.batches.day_plan import DayJob, DayPlan, DayRobot, plan_day, read_transfers, span
from stopgo.batches.entries import Entry
from stopgo.batches.visits import PlannedMission, Visits, with_since
from stopgo.batches.work import work
from stopgo.mission.errors import InputError
from stopgo.mission.settings import Settings
from stopgo.recordings.catalog.run_index import IndexedRun
from tests.batches.halls import batch_file, hall
from tests.batches.inline_engine import InlineEngine
from tests.called import stopgo as called

HOUR = 3600.0


def job(name: str, hours: float, site: str = "") -> DayJob:
    return DayJob(name, site or name, hours * HOUR, stops=10)


def planned(jobs: Sequence[DayJob], robots: Sequence[DayRobot]) -> DayPlan:
    return plan_day(jobs, robots, {}, default_s=0.5 * HOUR, setup_s=0.0)


def test_two_robots_share_what_one_shift_cannot_hold() -> None:
    plan = planned(
        [job(n, 3.0) for n in "abcd"], [DayRobot("r1", 8 * HOUR, "a"), DayRobot("r2", 8 * HOUR, "b")]
    )
    assert [len(steps) for steps in plan.steps] == [2, 2]
    assert not plan.left
    assert all(back <= 8 * HOUR for back in plan.returns_s)


def test_what_fits_into_no_shift_is_left_and_named() -> None:
    plan = planned([job("long", 9.0), job("short", 1.0)], [DayRobot("r1", 8 * HOUR, "")])
    assert [item.name for item in plan.left] == ["long"]
    assert [step.job.name for step in plan.steps[0]] == ["short"]


def test_the_return_belongs_to_the_shift() -> None:
    assert planned([job("a", 3.0)], [DayRobot("r1", 4 * HOUR, "depot")]).left == ()
    assert len(planned([job("a", 3.01)], [DayRobot("r1", 4 * HOUR, "depot")]).left) == 1


def test_times_of_a_day_add_up() -> None:
    transfers = {("depot", "a"): 600.0, ("a", "b"): 60.0, ("b", "depot"): 600.0, ("a", "depot"): 600.0}
    transfers |= {("depot", "b"): 600.0, ("b", "a"): 60.0}
    robot = DayRobot("r1", 8 * HOUR, "depot")
    plan = plan_day([job("a", 1.0), job("b", 1.0)], [robot], transfers, default_s=9e3, setup_s=300.0)
    first, second = plan.steps[0]
    assert (first.begin_s, first.end_s) == (900.0, 900.0 + HOUR)
    assert second.begin_s == first.end_s + 60.0 + 300.0
    assert plan.returns_s[0] == second.end_s + 600.0


@pytest.mark.parametrize("seed", range(6))
def test_as_many_jobs_are_taken_as_by_trying_everything(seed: int) -> None:
    lengths = [((seed * 7 + k * 5) % 9 + 1) / 2 for k in range(5)]
    jobs = [job(name, hours) for name, hours in zip("abcde", lengths, strict=True)]
    robots = [DayRobot("r1", 6 * HOUR, "a"), DayRobot("r2", 5 * HOUR, "e")]
    plan = planned(jobs, robots)
    assert 5 - len(plan.left) == _most(jobs, robots)
    assert plan == planned(jobs, robots), "the same again"


def _most(jobs: Sequence[DayJob], robots: Sequence[DayRobot]) -> int:
    """The most jobs that fit, by all allocations and orders."""
    best = 0
    for owners in product(range(len(robots) + 1), repeat=len(jobs)):
        given = [
            [item for item, owner in zip(jobs, owners, strict=True) if owner == k] for k in range(len(robots))
        ]
        if all(_fits(own, robot) for own, robot in zip(given, robots, strict=True)):
            best = max(best, sum(map(len, given)))
    return best


def _fits(jobs: Sequence[DayJob], robot: DayRobot) -> bool:
    return any(_length(order, robot) <= robot.shift_s for order in permutations(jobs))


def _length(order: Sequence[DayJob], robot: DayRobot) -> float:
    sites = [robot.at, *(item.site for item in order), robot.at]
    transfers = sum(0.5 * HOUR for one, other in pairwise(sites) if one != other)
    return transfers + sum(item.duration_s for item in order)


@pytest.mark.parametrize("text", ["from,to,minutes\na,b", "a,b,x", "a,b,-1", "a,b,nan", "a,b,1e9"])
def test_a_wrong_transfer_is_named_with_its_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "transfers.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"transfers.csv: line \d"):
        read_transfers(path)


def test_transfers_are_in_both_directions(tmp_path: Path) -> None:
    path = tmp_path / "transfers.csv"
    path.write_text("from;to;minutes\na;b;2\n")
    assert read_transfers(path) == {("a", "b"): 120.0, ("b", "a"): 120.0}
    with pytest.raises(InputError, match="cannot be read"):
        read_transfers(tmp_path / "none.csv")


@pytest.mark.parametrize("text", ["", "soon", "-1h", "nan", "9000h"])
def test_a_wrong_duration_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="shift"):
        span(text, "shift")


@pytest.mark.parametrize("text", ["25:00", "7", "07:61", "x"])
def test_a_wrong_begin_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="begin"):
        begin_of(text)


def run(mission: str, answer: str) -> IndexedRun:
    return IndexedRun(
        mission_id=mission, name="", revisions=(1,), run_id="r", robot="r1", began_ns=0, driven_s=1.0,
        ended="Finished", scanned=3, asked=3, deviation_m=0.0, coverage=0.9, answer=answer,
    )  # fmt: skip


def entry(date: str | None, site: str = "tower/EG") -> Entry:
    return Entry(
        f"{site}/{date}", site, Path("tower.ifc"), replace(Settings(), date=date), "plans.toml: line 1"
    )


def test_a_floor_is_scanned_for_what_was_finished_since_its_last_acquired_run() -> None:
    missions = {
        "one": PlannedMission("tower/EG", "2026-01-01"),
        "two": PlannedMission("tower/EG", "2026-02-01"),
    }
    visits = Visits(missions, {"one": [run("one", "yes")], "two": [run("two", "no")]})
    limited, left_out = with_since([entry("2026-01-01"), entry("2026-03-01")], "last", visits)
    assert [item.settings.since for item in limited] == ["2026-01-01"]
    assert left_out == ["tower/EG/2026-01-01: scanned at its status of 2026-01-01"]
    other, _ = with_since([entry("2026-03-01", "hall")], "last", visits)
    assert other[0].settings.since is None


def test_a_run_that_did_not_acquire_all_is_begun_and_not_done() -> None:
    visits = Visits({}, {"one": [run("one", "no")], "two": [run("two", "no"), run("two", "yes")]})
    assert not visits.acquired(["one"])
    assert visits.acquired(["two"])
    assert not visits.acquired([])
    assert [item.mission_id for item in visits.begun(["one", "two", "three"])] == ["one"]


def test_a_day_has_a_page_for_each_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "LocalEngine", lambda workers: InlineEngine(workers, work))
    hall(tmp_path / "a.dxf")
    hall(tmp_path / "b.dxf", width=8.0)
    day = '[day]\nrobots = [{ name = "r1", shift = "8h" }, { name = "r/2", shift = "1min" }]\n'
    batch_file(tmp_path, day + '[[floors]]\nfiles = "*.dxf"')
    out = tmp_path / "out"
    batch = ("batch", str(tmp_path / "plans.toml"), "-o", str(out))
    done = called(*batch, "--day", "2026-11-25", "--workers", "1")
    assert done.returncode == 0, done.stderr
    folder = out / "days" / "2026-11-25"
    assert str(folder / "index.html") in done.stderr
    assert "no shift" not in done.stderr
    robots = json.loads((folder / "day.json").read_text())["robots"]
    assert [len(item["missions"]) for item in robots] == [2, 0]
    assert "stopgo push" in (folder / "r1.html").read_text()
    assert len(list(folder.glob("r_2*.html"))) == 1, "a name that is no path"
    assert called(*batch, "--day", "soon").returncode == 2
    assert called(*batch, "--since", "last").returncode == 2


def test_floors_that_several_missions_divide_are_jobs_of_a_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their report has a file and an id for each mission; the batch ended in a KeyError."""
    monkeypatch.setattr(engine, "LocalEngine", lambda workers: InlineEngine(workers, work))
    hall(tmp_path / "a.dxf", width=12.0)
    options = "options = { robots = 2, start = [1.0, 1.0, 0.0] }"
    batch_file(tmp_path, f'[day]\nrobots = [{{ name = "r1" }}]\n[[floors]]\nfiles = "a.dxf"\n{options}')
    out = tmp_path / "out"
    done = called("batch", str(tmp_path / "plans.toml"), "-o", str(out), "--day", "2026-11-25", "--json")
    assert done.returncode == 0, done.stderr
    (found,) = json.loads(done.stdout)["entries"]
    files = [out / "a" / name for name in ("mission.json", "mission-2.json")]
    missions = [json.loads(path.read_text()) for path in files]
    assert found["missions"] == [mission["id"] for mission in missions]
    assert found["stops"] == sum(len(mission["stops"]) for mission in missions)
    day = json.loads((out / "days" / "2026-11-25" / "day.json").read_text())
    assert day["robots"][0]["missions"][0]["files"] == [str(path) for path in files]
    noted = json.loads((out / "missions.json").read_text())
    assert [item["together"] for item in noted.values()] == [found["missions"]] * 2


def test_a_floor_is_acquired_when_all_missions_of_its_plan_are() -> None:
    """One robot's run of two was enough, so that `--since last` left out what the other one had missed."""
    both = ("one", "two")
    missions = {name: PlannedMission("tower/EG", "2026-01-01", both) for name in both}
    half = Visits(missions, {"one": [run("one", "yes")], "two": [run("two", "no")]})
    assert half.last_date("tower/EG") is None
    whole = Visits(missions, {name: [run(name, "yes")] for name in both})
    assert whole.last_date("tower/EG") == "2026-01-01"


def test_a_fault_of_the_day_is_known_before_anything_is_planned(tmp_path: Path) -> None:
    hall(tmp_path / "a.dxf")
    for day in (
        'robots = [{ name = "r1", shift = "-1h" }]',
        "robots = []",
        'robots = [{ name = "" }]',
        'begin = "25:00"\nrobots = []',
    ):
        batch_file(tmp_path, f'[day]\n{day}\n[[floors]]\nfiles = "a.dxf"')
        done = called(
            "batch", str(tmp_path / "plans.toml"), "-o", str(tmp_path / "out"), "--day", "2026-11-25"
        )
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "[day]" in done.stderr
        assert not (tmp_path / "out" / "a").exists()


def test_what_a_day_leaves_and_a_place_that_is_none_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They were on the page only, and a robot at a misspelt floor had the usual way to each."""
    monkeypatch.setattr(engine, "LocalEngine", lambda workers: InlineEngine(workers, work))
    hall(tmp_path / "a.dxf")
    day = '[day]\nrobots = [{ name = "r1", shift = "1min", at = "b" }]\n'
    batch_file(tmp_path, day + '[[floors]]\nfiles = "*.dxf"')
    done = called("batch", str(tmp_path / "plans.toml"), "-o", str(tmp_path / "out"), "--day", "2026-11-25")
    assert done.returncode == 0, done.stderr
    assert "2026-11-25: 1 plan fits into no shift: a\n" in done.stderr
    assert "[day]: r1 is at b, which is no floor here; known: a\n" in done.stderr


def test_a_time_without_quotes_begins_a_day(tmp_path: Path) -> None:
    table = read_day(batch_file(tmp_path, '[day]\nbegin = 08:15:00\nrobots = [{ name = "r1" }]'))
    assert begin_of(table.begin) == 8.25 * 3600
    with pytest.raises(InputError, match="begin = '08:15:30': give a time such as 07:00"):
        begin_of("08:15:30")
