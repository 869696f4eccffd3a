"""Batches that are killed at any step, on a full disk, or with another one: nothing half-written counts."""

from __future__ import annotations

import errno
import os
import random
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import stopgo.plan_files
import stopgo.planner.floors
from stopgo.batches.store import ResultStore
from stopgo.batches.work import PlanOutcome, PlanTask, work
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.planner.floors.reader import FloorOptions
from tests.batches.halls import hall
from tests.faults.sizes import size

STEPS = ("rename", "link", "replace", "fsync", "open")
"""Calls of the operating system between which a process may end."""


class Killed(BaseException):
    """The end of the process, in place of a signal."""


@dataclass(frozen=True)
class StubReport:
    """Report of a plan that is not computed."""

    strict_exit_code: int = 0
    exit_code: int = 0

    def as_text(self) -> str:
        return "planned"

    def as_json(self) -> dict[str, Any]:
        return {"files": {}}


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace planning by writing two small files; returns the floors that were planned.

    Each drawing is read once: what is killed is the keeping of results.
    """
    floors: list[str] = []
    read_floor, read = stopgo.planner.floors.read_floor, dict[Path, FloorPlan]()

    def read_once(path: Path, options: FloorOptions) -> FloorPlan:
        drawing = path.resolve()
        if drawing not in read:
            read[drawing] = read_floor(path, options)
        return read[drawing]

    def plan_files(floor: Path, out: Path, settings: Settings, *, all_parts: bool) -> list[StubReport]:
        floors.append(floor.stem)
        for name in ("mission.json", "plan.svg"):
            (out / name).write_text(f"{name} of {floor.stem}, range {settings.range}")
        return [StubReport()]

    monkeypatch.setattr(stopgo.plan_files, "plan_files", plan_files)
    monkeypatch.setattr(stopgo.planner.floors, "read_floor", read_once)
    return floors


@contextmanager
def failing(at: int, fail: Callable[[], None], *, once: bool) -> Iterator[None]:
    """Let the step number `at` fail, and all steps after it unless it is `once`."""
    count = 0
    remove, unlink = shutil.rmtree, Path.unlink
    with pytest.MonkeyPatch.context() as patch:
        for name in STEPS:
            original = getattr(os, name)

            def step(*given: Any, _original: Any = original, **named: Any) -> Any:
                nonlocal count
                count += 1
                if count == at or (count > at and not once):
                    fail()
                return _original(*given, **named)

            patch.setattr(os, name, step)
        if not once:  # a dead process removes nothing
            patch.setattr(shutil, "rmtree", lambda *a, **k: None if count >= at else remove(*a, **k))
            patch.setattr(Path, "unlink", lambda *a, **k: None if count >= at else unlink(*a, **k))
        yield


def killed() -> None:
    raise Killed


def full_disk() -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture
def site(tmp_path: Path) -> Path:
    for number in range(3):
        hall(tmp_path / f"f{number}.dxf", width=4.0 + number)
    return tmp_path


def tasks(site: Path) -> list[PlanTask]:
    floors = sorted(site.glob("*.dxf"))
    store = ResultStore.at(site / "store").folder
    return [PlanTask(name=floor.stem, floor=floor, settings=Settings(), store=store) for floor in floors]


def must_be_whole(site: Path, outcomes: list[PlanOutcome]) -> None:
    """Every outcome has its files, and no other result is in the store."""
    store = ResultStore(site / "store")
    for outcome in outcomes:
        assert outcome.status in ("planned", "kept"), outcome.problem
        text = (store.result_folder(outcome.key) / "mission.json").read_text()
        assert text == f"mission.json of {outcome.name}, range 5.0"
    assert len(list((site / "store" / "results").glob("*/*"))) == len(outcomes)


def test_a_batch_killed_at_any_step_goes_on_with_whole_results(
    site: Path, planned: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stopgo.batches.store._is_dead", lambda claim: True)
    rng = random.Random(30)
    for trial in range(size(short=8, full=300)):
        run = site / f"trial-{trial}"
        run.mkdir()
        for floor in site.glob("*.dxf"):
            (run / floor.name).symlink_to(floor)
        for _ in range(rng.randint(1, 3)):
            with failing(rng.randint(1, 60), killed, once=False):
                try:
                    for task in tasks(run):
                        work(task)
                except Killed:
                    continue
        must_be_whole(run, [work(task) for task in tasks(run)])
        ResultStore(run / "store").collect_garbage(most_bytes=None, oldest_s=None)


def test_an_entry_on_a_full_disk_fails_in_one_line_and_is_planned_later(
    site: Path, planned: list[str]
) -> None:
    rng = random.Random(31)
    for trial in range(size(short=8, full=300)):
        run = site / f"trial-{trial}"
        run.mkdir()
        for floor in site.glob("*.dxf"):
            (run / floor.name).symlink_to(floor)
        with failing(rng.randint(1, 30), full_disk, once=True):
            outcomes = [work(task) for task in tasks(run)] if trial % 2 else [work(tasks(run)[0])]
        for outcome in outcomes:
            assert outcome.status != "failed" or "No space left" in outcome.problem
        must_be_whole(run, [work(task) for task in tasks(run)])


def test_two_batches_on_one_store_plan_nothing_twice(site: Path, planned: list[str]) -> None:
    for trial in range(size(short=3, full=50)):
        run = site / f"trial-{trial}"
        run.mkdir()
        for floor in site.glob("*.dxf"):
            (run / floor.name).symlink_to(floor)
        planned.clear()
        outcomes: list[list[PlanOutcome]] = [[], []]
        listed = tasks(run)

        def go(own: list[PlanOutcome], order: list[PlanTask]) -> None:
            own += [work(task) for task in order]

        threads = [
            threading.Thread(target=go, args=(own, order))
            for own, order in zip(outcomes, (listed, listed[::-1]), strict=True)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sorted(planned) == ["f0", "f1", "f2"]
        must_be_whole(run, outcomes[0])


def test_a_store_that_is_away_for_a_while_is_waited_for(
    site: Path, planned: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (task, *_) = tasks(site)
    store, away = site / "store", site / "away"
    store.rename(away)

    def comes_back(seconds: float) -> None:
        if away.exists():
            away.rename(store)

    monkeypatch.setattr("stopgo.batches.store.time.sleep", comes_back)
    assert work(task).status == "planned"
