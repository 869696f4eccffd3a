"""Drop-and-repair where the removal of the stop that uncovers least leads nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.selection import improve
from stopgo.planner.selection.bound import counting_bound
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.improve import EntriesLeft, improved, improved_otherwise, repaired_again
from tests.planner.checks import meets
from tests.planner.selection.test_swaps import cover_of_rooms

COVERS = [cover_of_rooms(seed, rows=60, columns=200, rooms=12) for seed in range(8)]


def improved_with_few_swaps(cover: Cover, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    monkeypatch.setattr(improve, "SWAPS", 8)
    return improved(cover, greedy(cover), at_least=0)


def test_the_removal_of_other_rows_saves_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [improved_with_few_swaps(cover, monkeypatch) for cover in COVERS]
    after = [
        improved_otherwise(cover, rows, at_least=0, work=EntriesLeft())
        for cover, rows in zip(COVERS, before, strict=True)
    ]
    assert all(meets(cover, rows) for cover, rows in zip(COVERS, after, strict=True))
    assert sum(map(len, after)) < sum(map(len, before))


def test_no_other_row_is_removed_without_work_or_at_the_lower_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    for cover in COVERS:
        rows, work = improved_with_few_swaps(cover, monkeypatch), EntriesLeft()
        assert improved_otherwise(cover, rows, at_least=0, work=EntriesLeft(0)).tolist() == rows.tolist()
        assert improved_otherwise(cover, rows, at_least=len(rows), work=work).tolist() == rows.tolist()
        assert work == EntriesLeft()
        least = max(counting_bound(cover), len(rows) - 1)
        assert len(improved_otherwise(cover, rows, at_least=least, work=work)) >= least


def test_rows_that_miss_a_new_demand_are_repaired_to_as_many() -> None:
    """One of the rows that were not chosen is demanded."""
    for cover in COVERS:
        rows = greedy(cover)
        others = np.setdiff1d(np.arange(cover.rows), rows)
        asked = cover.with_one_of_each([others])
        again = repaired_again(asked, rows)
        assert again is not None
        assert meets(asked, again)
        assert len(again) == len(rows)
