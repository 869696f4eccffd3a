"""The covering problem's own sums, against the same sums over dense matrices."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection
from stopgo.planner.selection import cover
from stopgo.planner.selection.cover import Cover, cover_of
from stopgo.planner.selection.demands import demands_of
from tests.planner.kernels import machine_code
from tests.planner.selection.test_swaps import cover_of_rooms
from tests.planner.worlds import column, planned, two_rooms


@pytest.mark.parametrize("seed", range(20))
def test_the_fewest_views_take_the_columns_that_need_few_first(seed: int) -> None:
    random = np.random.default_rng(seed)
    worth, asks = random.integers(0, 6, (4, 25)), random.integers(2, 5, 25)
    needed = random.integers(0, worth.sum(axis=1) + 1)
    cover = Cover(csr_array(np.ones((3, 25), np.int8)), csr_array(worth), needed, asks)
    each = [np.repeat(asks, own)[np.argsort(np.repeat(asks, own), kind="stable")] for own in worth]
    assert cover.views_needed.tolist() == [
        int(own[:least].sum()) for own, least in zip(each, needed.tolist(), strict=True)
    ]


def test_the_fewest_views_of_many_demands_take_little_memory() -> None:
    """A dense matrix of these demands and columns has 32 MB."""
    worth = csr_array(eye_array(2000, dtype=np.int64))
    cover = Cover(csr_array(np.ones((1, 2000), np.int8)), worth, np.ones(2000, np.int64), 2)
    tracemalloc.start()
    try:
        assert cover.views_needed.tolist() == [2] * 2000
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_sums_over_some_rows_at_a_time_are_those_of_all(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(block)
    sees = csr_array((random.random((9, 12)) < 0.4).astype(np.int8))
    one = Cover(sees, csr_array(random.integers(1, 9, (3, 12))), np.ones(3, dtype=np.int64))
    monkeypatch.setattr(cover, "BLOCK", block)
    wide = sees.toarray().astype(np.int64)
    assert np.array_equal(one.adds.toarray(), wide @ one.worth.toarray().T)
    assert one.most_demands == 3
    price = random.random(12)
    for kernels in (lambda kernel: None, lambda kernel: kernel, machine_code):
        monkeypatch.setattr(cover, "compiled", lambda kernel, *, large, by=kernels: by(kernel))
        assert np.array_equal(one.covered_by(np.array([2, 5])), wide[[2, 5]].sum(axis=0))
        assert np.array_equal(one.paid_to(price), sees @ price)
        again = Cover(sees, one.worth, one.needed)
        assert np.array_equal(again.adds.toarray(), one.adds.toarray())
        assert again.most_demands == 3


def test_the_columns_of_more_demands_come_last() -> None:
    one = cover_of_rooms(3, rows=40, columns=100)
    random = np.random.default_rng(0)
    sets = [np.sort(random.choice(40, size, replace=False)) for size in (3, 7, 1, 20)]
    more = np.stack([np.isin(np.arange(40), rows) for rows in sets], axis=1)
    both = one.with_one_of_each(sets)
    assert both.sees.has_canonical_format
    assert np.array_equal(both.sees.toarray(), np.hstack([one.sees.toarray(), more]))
    assert np.array_equal(both.adds.toarray(), both.sees.astype(np.int64) @ both.worth.toarray().T)


def test_a_problem_is_the_same_in_numpy_as_written_and_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    floor = two_rooms(1.0, more=(column("c", 2.0, 1.0), column("k", 6.0, 3.0)))
    seen = planned(floor, Settings(range=4))[1][Selection].visibility
    made = []
    for kernels in (lambda kernel: None, lambda kernel: kernel, machine_code):
        monkeypatch.setattr(cover, "compiled", lambda kernel, *, large, by=kernels: by(kernel))
        one = cover_of(seen, demands_of(seen))
        made.append([one.sees.indptr.tolist(), one.sees.indices.tolist(), one.worth.toarray().tolist()])
    assert made[0] == made[1] == made[2]
