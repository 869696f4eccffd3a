"""Selections that are searched by districts: they meet every demand, and no row of them is idle."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection import Searches, districts, improve
from stopgo.planner.selection.connected_selection import ConnectedCover, connected, connected_rows
from stopgo.planner.selection.districts import improved_by_districts
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.improve import improved
from tests.faults.sizes import size
from tests.planner.checks import meets
from tests.planner.selection.test_connected_selection import task_of
from tests.planner.selection.test_swaps import cover_of_rooms

SEEDS = range(size(short=4, full=40))


@pytest.fixture
def small_districts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(improve, "LARGE", 3)
    monkeypatch.setattr(districts, "SIZE", 4)


@pytest.mark.usefixtures("small_districts")
@pytest.mark.parametrize("views", [1, 2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_selection_improved_by_districts_meets_what_greedy_meets_with_no_more_rows(
    seed: int, views: int
) -> None:
    cover = cover_of_rooms(seed, rows=60, columns=200, rooms=12, views=views)
    start = greedy(cover)
    rows = improved(cover, start, at_least=0)
    assert meets(cover, start) and meets(cover, rows)
    assert len(set(rows.tolist())) == len(rows) <= len(start)


@pytest.mark.usefixtures("small_districts")
def test_districts_save_rows() -> None:
    covers = [cover_of_rooms(seed, rows=60, columns=200, rooms=12) for seed in SEEDS]
    starts = [greedy(cover) for cover in covers]
    found = [improved(cover, start, at_least=0) for cover, start in zip(covers, starts, strict=True)]
    assert sum(map(len, found)) < sum(map(len, starts))


@pytest.mark.usefixtures("small_districts")
def test_no_selection_by_districts_is_below_its_bound() -> None:
    cover = cover_of_rooms(0, rows=60, columns=200, rooms=12)
    start = greedy(cover)
    assert len(improved(cover, start, at_least=len(start) - 1)) == len(start) - 1
    assert len(improved(cover, start, at_least=len(start))) == len(start)


def test_rows_searched_in_vain_are_not_searched_again_by_themselves() -> None:
    cover = cover_of_rooms(0, rows=60, columns=200, rooms=12)
    settled: set[int] = set()
    searched: list[int] = []

    def nothing_found(problem: object, start: IntArray, least: int) -> IntArray:
        searched.append(len(start))
        return start

    rows = greedy(cover)
    for _ in range(2):
        found = improved_by_districts(cover, rows, nothing_found, at_least=0, settled=settled)
        assert found.tolist() == sorted(rows.tolist())
    assert settled == set(rows.tolist())
    assert len(searched) <= len(rows)


@pytest.mark.usefixtures("small_districts")
@pytest.mark.parametrize("seed", SEEDS)
def test_no_row_of_a_connected_selection_by_districts_is_idle(seed: int) -> None:
    task = task_of(seed, rows=40, columns=90, near=0.25)
    rows, _ = connected(task, Searches.default(task), rounds=2)
    assert len(rows) > improve.LARGE
    _assert_whole_and_without_idle(task, rows)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_idle_row_is_removed(seed: int) -> None:
    task = task_of(seed, rows=30, columns=60, near=0.3)
    rows = connected_rows(task, np.arange(30))
    assert len(rows) < 30
    _assert_whole_and_without_idle(task, rows)


def _assert_whole_and_without_idle(task: ConnectedCover, rows: IntArray) -> None:
    assert meets(task.cover, rows) and not task.parts(rows)
    for row in rows.tolist():
        rest = rows[rows != row]
        assert not meets(task.cover, rest) or task.parts(rest), row
