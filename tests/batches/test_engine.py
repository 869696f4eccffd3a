"""Tests of the working through of entries: order, memory, processes that end."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from stopgo.batches.engine import Running
from stopgo.batches.work import BASE_BYTES, PlanOutcome, PlanTask
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
    with Running(engine, tasks(tmp_path, "abcde")) as running:
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
    outcomes = {item.name: item for item in Running(engine, tasks(tmp_path, "abc")).outcomes()}
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

    outcomes = list(Running(InlineEngine(2, work), tasks(tmp_path, "ab")).outcomes())
    assert [item.status for item in outcomes] == ["planned", "planned"]


def test_a_defect_is_one_line_and_not_tried_again(tmp_path: Path) -> None:
    def work(task: PlanTask) -> PlanOutcome:
        raise ValueError("unforeseen")

    engine = InlineEngine(1, work)
    (outcome,) = Running(engine, tasks(tmp_path, "a")).outcomes()
    assert "unexpected error (ValueError: unforeseen)" in outcome.problem
    assert len(engine.begun) == 1


@pytest.mark.parametrize(("memory", "at_once"), [(1.0, 1), (2.5 * BASE_BYTES, 2), (1e12, 3)])
def test_entries_at_the_same_time_fit_into_the_memory(tmp_path: Path, memory: float, at_once: int) -> None:
    engine = InlineEngine(3, done, memory)
    waiting: list[int] = []
    running = Running(engine, tasks(tmp_path, "abc"))
    running.waiting = lambda: waiting.append(len(running._now))
    assert len(list(running.outcomes())) == 3
    assert max(waiting) == at_once


def test_a_stopped_batch_begins_no_more(tmp_path: Path) -> None:
    engine = InlineEngine(1, done)
    assert list(Running(engine, tasks(tmp_path, "ab")).outcomes(lambda: True)) == []
    assert not engine.begun


def test_an_entry_that_has_no_part_in_a_lost_cluster_is_tried_as_often_as_others(tmp_path: Path) -> None:
    lost: list[str] = []

    def work(task: PlanTask) -> PlanOutcome:
        if lost.count(task.name) < 3:
            lost.append(task.name)
            raise CancelledError
        return done(task)

    engine = InlineEngine(1, work)
    engine.own_fault = False
    (outcome,) = Running(engine, tasks(tmp_path, "a")).outcomes()
    assert outcome.status == "planned"
    assert len(engine.begun) == 4
