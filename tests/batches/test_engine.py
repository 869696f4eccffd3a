"""Tests of the working through of entries: order, memory, processes that end."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import pytest

from stopgo.batches import engine
from stopgo.batches.content import computed_by
from stopgo.batches.engine import BASE_BYTES, ClusterEngine, Running
from stopgo.batches.work import PlanOutcome, PlanTask
from stopgo.mission.errors import InputError, OutcomeUnknown
from stopgo.mission.settings import Settings
from tests.batches.inline_engine import InlineEngine


def tasks(folder: Path, names: Sequence[str]) -> list[PlanTask]:
    made = []
    for number, name in enumerate(names):
        floor = folder / f"{name}.dxf"
        floor.write_bytes(b" " * (1000 - number))
        made.append(PlanTask(name=name, floor=floor, settings=Settings(), store=folder))
    return made


def done(task: PlanTask) -> PlanOutcome:
    return PlanOutcome(name=task.name, status="planned", exit_code=0)


def test_every_entry_is_worked_on_once_the_largest_first(tmp_path: Path) -> None:
    engine = InlineEngine(2, done)
    with Running(engine, tasks(tmp_path, "abcde"), memory=1e12) as running:
        outcomes = list(running.outcomes())
    assert sorted(outcome.name for outcome in outcomes) == list("abcde")
    assert [name for _, name in engine.begun] == list("abcde")
    assert engine.closed


def test_an_entry_whose_process_ends_twice_has_failed_and_the_others_are_planned(tmp_path: Path) -> None:
    def work(task: PlanTask) -> PlanOutcome:
        if task.name == "b":
            raise BrokenProcessPool("killed")
        return done(task)

    engine = InlineEngine(2, work)
    outcomes = {item.name: item for item in Running(engine, tasks(tmp_path, "abc"), 1e12).outcomes()}
    assert [outcomes[name].status for name in "abc"] == ["planned", "failed", "planned"]
    assert "twice" in outcomes["b"].problem
    assert engine.begun[-1] == (0, "b"), "the second time alone, after all others"
    assert len(engine.renewed) == 2


def test_an_entry_whose_process_was_killed_once_is_planned(tmp_path: Path) -> None:
    killed: list[str] = []

    def work(task: PlanTask) -> PlanOutcome:
        if task.name not in killed:
            killed.append(task.name)
            raise BrokenProcessPool("killed")
        return done(task)

    outcomes = list(Running(InlineEngine(2, work), tasks(tmp_path, "ab"), 1e12).outcomes())
    assert [item.status for item in outcomes] == ["planned", "planned"]


def test_a_defect_is_one_line_and_not_tried_again(tmp_path: Path) -> None:
    def work(task: PlanTask) -> PlanOutcome:
        raise ValueError("unforeseen")

    engine = InlineEngine(1, work)
    (outcome,) = Running(engine, tasks(tmp_path, "a"), 1e12).outcomes()
    assert "unexpected error (ValueError: unforeseen)" in outcome.problem
    assert len(engine.begun) == 1


@pytest.mark.parametrize(("memory", "at_once"), [(1.0, 1), (2.5 * BASE_BYTES, 2), (1e12, 3)])
def test_entries_at_the_same_time_fit_into_the_memory(tmp_path: Path, memory: float, at_once: int) -> None:
    engine = InlineEngine(3, done)
    waiting: list[int] = []
    running = Running(engine, tasks(tmp_path, "abc"), memory)
    running.waiting = lambda: waiting.append(len(running._now))
    assert len(list(running.outcomes())) == 3
    assert max(waiting) == at_once


def test_a_stopped_batch_begins_no_more(tmp_path: Path) -> None:
    engine = InlineEngine(1, done)
    assert list(Running(engine, tasks(tmp_path, "ab"), 1e12).outcomes(lambda: True)) == []
    assert not engine.begun


class FakeClient:
    """A dask client whose workers are as a test needs them."""

    versions: ClassVar[dict[str, str]] = {}
    threads: ClassVar[dict[str, int]] = {}
    status = "running"

    def __init__(self, address: str, timeout: str) -> None:
        self.address = address

    def run(self, function: Callable[[], str]) -> dict[str, str]:
        return self.versions

    def nthreads(self) -> dict[str, int]:
        return self.threads

    def get_executor(self, *, pure: bool) -> FakeClient:
        return self

    def shutdown(self, *, wait: bool) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> type[FakeClient]:
    monkeypatch.setitem(sys.modules, "distributed", cast("Any", SimpleNamespace(Client=FakeClient)))
    monkeypatch.setattr(engine, "_must_answer", lambda address: None)
    return FakeClient


@pytest.mark.parametrize(
    ("versions", "threads", "words"),
    [
        ({}, {}, "has no workers"),
        ({"w1": "older"}, {"w1": 1}, "w1: has another stopgo (older) than this machine"),
        ({"w1": computed_by()}, {"w1": 4}, "w1: has 4 threads; start it with --nthreads 1"),
    ],
)
def test_a_worker_that_does_not_fit_is_refused(
    cluster: type[FakeClient], versions: dict[str, str], threads: dict[str, int], words: str
) -> None:
    cluster.versions, cluster.threads = versions, threads
    with pytest.raises(InputError) as refused:
        ClusterEngine("tcp://127.0.0.1:8786")
    assert words in str(refused.value)


def test_a_scheduler_that_is_gone_ends_the_batch_as_unknown(
    cluster: type[FakeClient], tmp_path: Path
) -> None:
    cluster.versions, cluster.threads = {"w1": computed_by()}, {"w1": 1}
    made = ClusterEngine("tcp://127.0.0.1:8786")
    assert made.slots == 1
    made._client.status = "closed"
    with pytest.raises(OutcomeUnknown, match="is gone; call the batch again"):
        list(Running(made, tasks(tmp_path, "a"), 1e12).outcomes())
