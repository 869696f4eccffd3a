"""Stretches of the boundary, joined where they touch: the same pieces as counted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.overlap.boundary import _Stretches
from stopgo.planner.visibility.unit_ranges import runs_of


@pytest.mark.parametrize("seed", range(6))
def test_joined_stretches_have_the_same_pieces_in_the_fewest_runs(seed: int) -> None:
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 9, 12)
    face, start = np.repeat(np.arange(12), sizes), np.cumsum(sizes) - sizes
    row = np.sort(random.integers(0, 5, 40))
    on = random.integers(0, 12, 40)
    low = random.integers(0, sizes[on])
    high = random.integers(low, sizes[on])
    some = _Stretches(row, start[on] + low, start[on] + high)
    joined = some.joined(face)
    for k, pieces in enumerate(some.pieces(5)):
        first, last = runs_of(pieces, face)
        assert joined.first[joined.row == k].tolist() == first.tolist()
        assert joined.last[joined.row == k].tolist() == last.tolist()


def test_nothing_seen_is_no_stretch() -> None:
    nothing = np.empty(0, np.int64)
    assert len(_Stretches(nothing, nothing, nothing).joined(np.zeros(3, np.int64)).row) == 0
