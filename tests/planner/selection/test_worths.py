"""Worth of columns: the same sums in numpy, by the kernels as written, and by the compiled ones."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection import worths
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.improve import improved
from stopgo.planner.selection.running_coverage import RunningCoverage
from stopgo.planner.selection.worths import Transposed, Worths
from tests.planner.kernels import machine_code
from tests.planner.selection.test_swaps import cover_of_rooms


def by_each_kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """In numpy, by the kernels as written, and by the compiled ones."""
    for kernels in (lambda kernel: None, lambda kernel: kernel, machine_code):
        monkeypatch.setattr(worths, "compiled", lambda kernel, *, large, by=kernels: by(kernel))
        yield


def _sums(adds_to: csr_array, seen_by: csr_array, columns: IntArray, demands: IntArray) -> list[list]:
    sums = Worths(adds_to, Transposed(csr_array(seen_by.T)))
    return [sums.of(columns).tolist(), sums.by_row(columns, demands).tolist()]


@pytest.mark.parametrize("count", [0, 1, 9])
def test_gains_are_the_same_in_numpy_as_written_and_compiled(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        worth = random.integers(0, 9, (30, 6)) * (random.random((30, 6)) < 0.4)
        columns = np.sort(random.choice(30, count, replace=False))
        covered, asks = random.integers(0, 3, 30), random.integers(1, 3, 30)
        short, missing = random.integers(0, 20, 6), random.integers(0, 2, 6)
        adds = worth[columns[covered[columns] < asks[columns]]].sum(axis=0)
        counted = (int(np.minimum(adds, short).sum()), int(adds[missing > 0].sum()), int(adds[0]))
        for _ in by_each_kernel(monkeypatch):
            sums = Worths(csr_array(worth), Transposed(csr_array(np.ones((1, 30), np.int64))))
            for _ in range(2):
                assert sums.gain(columns, covered, asks, short, missing) == counted


@pytest.mark.parametrize("count", [0, 1, 9])
def test_sums_are_the_same_in_numpy_as_written_and_compiled(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        worth = random.integers(0, 9, (30, 6)) * (random.random((30, 6)) < 0.4)
        sees = (random.random((30, 11)) < 0.3).astype(np.int64)
        columns = np.sort(random.choice(30, count, replace=False))
        demands = np.flatnonzero(random.random(6) < 0.5)
        counted = [worth[columns].sum(axis=0).tolist(), (worth[columns].T @ sees[columns])[demands].tolist()]
        for _ in by_each_kernel(monkeypatch):
            assert _sums(csr_array(worth), csr_array(sees), columns, demands) == counted


def test_a_covering_problem_that_is_done_with_is_freed_at_once() -> None:
    """A reference to itself would keep each problem of a search, some hundred megabytes in all."""
    cover = cover_of_rooms(4)
    gone = weakref.ref(cover)
    rows = greedy(cover)
    improved(cover, rows, at_least=1)
    RunningCoverage(cover, rows).add(rows[:1])
    lower_bound(cover, found=len(rows))
    gc.disable()
    try:
        del cover
        assert gone() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("count", [0, 1, 9])
def test_seers_of_columns_are_the_rows_that_see_any_of_them(count: int) -> None:
    for seed in range(5):
        random = np.random.default_rng(seed)
        sees = random.random((25, 30)) < 0.2
        columns = np.sort(random.choice(30, count, replace=False))
        matrix = csr_array(sees.astype(np.int8))
        found = Worths(csr_array(np.ones((30, 1), np.int64)), Transposed(matrix)).seers(columns)
        assert found.tolist() == np.flatnonzero(sees[:, columns].any(axis=1)).tolist()
