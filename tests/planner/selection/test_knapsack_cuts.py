"""Knapsack cover inequalities: every selection meets them, and they raise bounds."""

from __future__ import annotations

from itertools import product
from typing import cast

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.mission.geometry import FloatArray
from stopgo.planner.selection import bound, knapsack_cuts
from stopgo.planner.selection.bound import lower_bound, relaxation_bound
from stopgo.planner.selection.bound_by_parts import bound_by_parts
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.knapsack_cuts import KnapsackCuts, tightened, violated_cuts
from stopgo.planner.selection.linear_programme import LinearProgramme, Solution
from tests.faults.sizes import size
from tests.planner.selection.test_selection import is_enough, small_covers
from tests.planner.selection.test_swaps import cover_of_rooms


def rooms_of(number: int) -> Cover:
    """Rooms of ten columns, of which one row each sees all, and nine must be seen; nothing of the whole."""
    sees = np.kron(np.eye(number, dtype=np.int64), np.ones((1, 10), dtype=np.int64))
    worth = np.vstack([np.ones((1, 10 * number), np.int64), sees])
    return Cover(csr_array(sees), csr_array(worth), np.array([0] + [9] * number))


def test_a_row_that_sees_more_than_is_needed_counts_as_what_is_needed() -> None:
    cuts = violated_cuts(rooms_of(3), np.full(3, 0.9))
    of_rooms = cuts.fractions.toarray()[-3:]
    assert of_rooms.tolist() == np.eye(3).tolist()
    assert cuts.needed[-3:].tolist() == [9, 9, 9]


def test_every_selection_meets_what_a_relaxation_violates() -> None:
    """All selections of up to ten rows; also of columns that need two or three views."""
    violated = 0
    for seed, cover, _ in small_covers(range(size(short=12, full=300))):
        random = np.random.default_rng(seed)
        enough = [x for x in product((0, 1), repeat=cover.rows) if is_enough(cover, np.flatnonzero(x))]
        for scale in (0.3, 1.0):
            cuts = violated_cuts(cover, random.random(cover.rows) * scale)
            violated += len(cuts)
            assert (np.array(enough) @ cuts.adds.toarray().T >= cuts.needed).all(), seed
    assert violated > 20


def test_a_solution_that_meets_them_all_violates_none() -> None:
    cover = cover_of_rooms(2)
    chosen = np.zeros(cover.rows)
    chosen[greedy(cover)] = 1.0
    assert len(violated_cuts(cover, chosen)) == 0
    assert violated_cuts(cover, chosen).adds.shape == (0, cover.rows)


def test_rooms_need_a_whole_row_each() -> None:
    cover = rooms_of(12)
    assert relaxation_bound(cover) == bound_by_parts(cover, found=13) == 12


def test_bounds_are_higher_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds of a relaxation, by parts, and of a relaxation whose columns are grouped."""
    sums = np.zeros((2, 3), dtype=np.int64)
    for number, rounds in enumerate((0, knapsack_cuts.ROUNDS)):
        monkeypatch.setattr(knapsack_cuts, "MOST_ROUNDS", rounds)
        for seed in range(size(short=3, full=6)):
            cover, again = (cover_of_rooms(seed, rows=100, columns=100, rooms=12) for _ in range(2))
            monkeypatch.setattr(bound, "FINE", 100_000)
            sums[number, :2] += relaxation_bound(cover), bound_by_parts(cover, found=99)
            monkeypatch.setattr(bound, "FINE", 300)
            sums[number, 2] += relaxation_bound(again)
    assert (sums[1] > sums[0]).all()


class Programme:
    """A programme whose costs are given, one for each time that it is solved."""

    def __init__(self, costs: list[float]) -> None:
        self.costs = costs

    def add(self, rows: csr_array, least: FloatArray) -> None:
        """Take a demand, which changes no cost."""

    def solution(self) -> Solution:
        """The next cost, of no row."""
        return Solution(np.zeros(1), np.zeros(1), self.costs.pop(0))


@pytest.mark.parametrize(("whole", "cost"), [(False, 10.93), (True, 11.01)])
def test_a_bound_just_below_a_whole_number_is_raised_by_more_rounds(
    monkeypatch: pytest.MonkeyPatch, *, whole: bool, cost: float
) -> None:
    """The gain is small, and the next whole number is near until it is passed."""
    cut = KnapsackCuts(csr_array(np.ones((1, 1), np.int64)), np.ones(1, np.int64))
    monkeypatch.setattr(knapsack_cuts, "violated_cuts", lambda *_: cut)
    programme = cast(LinearProgramme, Programme([10.8, 10.9, 10.93, 10.95, 10.97, 10.99, 11.01, 11.02]))
    solution, _ = tightened(programme, rooms_of(1), whole=whole)
    assert solution is not None
    assert solution.cost == cost


def test_a_problem_without_demands_needs_nothing() -> None:
    cover = Cover.of_whole(csr_array((3, 0), dtype=np.int64), np.empty(0, np.int64), 0)
    assert lower_bound(cover, found=0) == relaxation_bound(cover) == 0
    assert len(violated_cuts(cover, np.ones(3))) == 0
