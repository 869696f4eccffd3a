"""Bounds by branching, beside every subset of small covers, and what they prove."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.planner.selection import branching_bound as module
from stopgo.planner.selection.bound import lower_bound, relaxation_bound
from stopgo.planner.selection.branching_bound import branching_bound
from stopgo.planner.selection.cover import Cover
from tests.faults.sizes import size
from tests.planner.selection.test_selection import fewest, small_covers
from tests.planner.selection.test_swaps import cover_of_rooms


def test_no_bound_by_branching_is_above_the_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a selection is known that is not the smallest, and with groups of columns."""
    monkeypatch.setattr(module, "ENTRIES", 40)
    for seed, cover, optimum in small_covers(range(size(short=3, full=300))):
        for found in (optimum, optimum + 1, optimum + 2, optimum + 5):
            assert branching_bound(cover, found=found) <= optimum, seed


def test_branches_prove_more_selections_the_fewest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of random problems of 12 rows in 4 rooms, of which one gains."""
    gained = 0
    for seed in range(10, 16):
        cover = cover_of_rooms(seed, rows=12, columns=40, rooms=4)
        plain = relaxation_bound(cover)
        bound = branching_bound(cover, found=plain + 1)
        assert plain <= bound <= min(plain + 1, fewest(cover))
        gained += bound - plain
        assert lower_bound(cover, found=plain + 1) == bound
    assert gained > 0
    monkeypatch.setattr(module, "NODES", 1)
    assert all(
        branching_bound(cover, found=99) == relaxation_bound(cover)
        for cover in (cover_of_rooms(seed, rows=12, columns=40, rooms=4) for seed in range(5))
    )


def test_a_branch_that_gains_nothing_ends_with_the_last_relaxation() -> None:
    """A relaxation of just one stop fewer than are known, whose branches are all alike."""
    random = np.random.default_rng(506)
    sees = (random.random((10, 15)) < 0.3).astype(np.int64)
    worth = np.vstack([np.ones(15), *(np.arange(15) % 3 == room for room in range(3))]).astype(np.int64)
    needed = worth @ sees.any(axis=0) * 8 // 10
    needed[0] = 0
    cover = Cover(csr_array(sees), csr_array(worth), needed)
    bound = relaxation_bound(cover)
    assert lower_bound(cover, found=bound + 1) == bound == fewest(cover)
