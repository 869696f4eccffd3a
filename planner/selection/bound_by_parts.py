"""Bound of a large selection: the prices of one part of the columns after another are made the best.

A linear programme of a whole floor takes time that grows with almost the square of its size. Prices that
are already good are improved part by part instead, while all others stay: a dual block ascent. Each part
is one programme, with what the other prices leave of each row's cost. After one pass over overlapping parts
the bound of 7 573 m² is within 0.7 % of the whole programme's. Two parts that have little in
common are solved at a time, from the same prices, so that the solver uses two cores. The bound is computed
from the prices alone, so it needs no trust in the solver.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack, vstack

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.geometry.index_ranges import distinct
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.knapsack_cuts import KnapsackCuts, tightened
from stopgo.planner.selection.linear_programme import LinearProgramme, Solution
from stopgo.planner.selection.multiplier_bound import PricedCover, multiplier_prices, rounded_up

SIZE = 60_000
"""Entries of the covering matrix in a part, about, without the columns that it shares with others."""
MOST_AROUND = 300_000
"""Entries around a column, by the mean numbers of rows and columns, up to which parts save time."""
SHARED = 0.2
"""Share of the rows of a part that may see another part which is solved at the same time.

With neighbours at the same time, the bound of 28 500 m² was 1029 for 1038.
"""
FIRST_STEPS = 60
"""Steps of the multiplier bound, for the first prices."""


def has_parts(cover: Cover) -> bool:
    """True if rows see so few columns that parts are much smaller than the whole.

    On open floors of long range each part is nearly all that a row sees, several times over. Rows and columns
    without an entry do not count, such as rows that are not offered.
    """
    firsts = cover.sees.indptr, cover.worths.runs_of_rows[0]
    rows, columns = (int(np.count_nonzero(np.diff(first))) for first in firsts)
    return cover.sees.nnz**3 <= MOST_AROUND * columns**2 * rows


def bound_by_parts(cover: Cover, *, found: int) -> int:
    """Lower bound on the rows of a selection; `found` rows are known to suffice."""
    problem = PricedCover(cover)
    best, prices = multiplier_prices(problem, found=found, steps=FIRST_STEPS)
    ascent = _Ascent(problem, prices)
    with ThreadPoolExecutor(2) as threads:
        for parts in _pairs(cover, list(_parts(cover))):
            asked = [ascent.programme(part) for part in parts]
            for programme, solution in zip(asked, threads.map(_Programme.solution, asked), strict=True):
                ascent.take(programme, *solution)
    return rounded_up(max(best, ascent.value()))


@dataclass(frozen=True, eq=False)
class _Programme:
    """The linear programme of the best prices of a part's columns, and of some demands."""

    part: IntArray
    demands: IntArray
    scale: FloatArray
    """What each demand's row is multiplied by (demands,)."""
    cost: FloatArray
    matrix: Any
    least: FloatArray
    most: FloatArray
    rows: IntArray
    """Rows that see the part (rows,)."""
    problem: Cover
    """The covering problem of these rows, of the part, and of demands to which no other columns add."""

    def solution(self) -> tuple[Solution | None, KnapsackCuts]:
        """Solve it, with knapsack cover inequalities; None if the solver fails.

        The solver's own simplification of parts took a third of its time.
        """
        programme = LinearProgramme(self.cost, self.matrix, self.least, self.most, presolve=False)
        return tightened(programme, self.problem)


class _Ascent:
    """Prices that are made the best for one part of the columns after another."""

    def __init__(self, problem: PricedCover, prices: FloatArray) -> None:
        cover = problem.cover
        self._problem, self._cover = problem, cover
        self._column = prices[: cover.columns].copy()
        self._demand = np.concatenate([[problem.price_of_whole(prices)], prices[cover.columns :]])
        self._worth_of_column = csr_array(problem.worth.T)
        entries = np.diff(cover.seen_by.indptr)
        columns = (cover.worth > 0).astype(np.int64)
        self._is_wide: BoolArray = np.asarray(columns @ entries) > SIZE
        self._is_wide[0] = True
        self._paid = np.zeros(cover.rows)
        """Prices of the inequalities of all parts, paid to each row."""
        self._for_cuts = 0.0
        """Sum of their prices."""

    @property
    def prices(self) -> FloatArray:
        """Prices of columns, then of all demands but the whole."""
        return np.concatenate([self._column, self._demand[1:]])

    def value(self) -> float:
        """The bound at the prices."""
        return self._problem.value(self.prices, self._paid)[0] + self._for_cuts

    def programme(self, part: IntArray) -> _Programme:
        """The programme of these columns, and of the demands to which only few columns add."""
        cover, worth = self._cover, self._problem.worth
        demands = distinct(cover.adds_to[part].indices, len(cover.needed))
        demands = demands[~self._is_wide[demands]]
        others = np.setdiff1d(distinct(worth[demands].indices, cover.columns), part)
        rows = distinct(cover.seen_by[part].indices, cover.rows)
        cost = np.concatenate([self._spare(rows, part), *self._gains(part, others, demands)])
        seen = cover.sees[rows][:, part].T.astype(float)
        scale = 1.0 / np.maximum(worth[demands].max(axis=1).toarray().ravel(), 1e-300)
        added = diags_array(scale) @ worth[demands][:, np.concatenate([part, others])]
        asked = hstack(
            [seen, diags_array(-cover.asks[part].astype(float)), csr_array((len(part), len(others)))]
        )
        most = np.concatenate(
            [np.full(len(rows), np.inf if cover.once else 1.0), np.ones(len(part) + len(others))]
        )
        return _Programme(
            part,
            demands,
            scale,
            cost,
            vstack([asked, hstack([csr_array((len(demands), len(rows))), added])]),
            np.concatenate([np.zeros(len(part)), self._problem.needed[demands] * scale]),
            most,
            rows,
            self._within(part, rows, demands),
        )

    def _within(self, part: IntArray, rows: IntArray, demands: IntArray) -> Cover:
        """The problem of these demands to which only columns of the part add."""
        cover = self._cover
        worth = csr_array(cover.worth[demands][:, part])
        alone = np.diff(worth.indptr) == np.diff(cover.worth.indptr)[demands]
        sees = csr_array(cover.sees[rows][:, part])
        return Cover(sees, worth[alone], cover.needed[demands[alone]], cover.asks[part])

    def take(self, programme: _Programme, solution: Solution | None, cuts: KnapsackCuts) -> None:
        """Let the prices of a solution replace those that there were."""
        if solution is not None:
            part, demands = programme.part, programme.demands
            column, demand, cut = np.split(solution.prices, [len(part), len(part) + len(demands)])
            self._column[part], self._demand[demands] = column, demand * programme.scale
            self._paid[programme.rows] += cuts.fractions.T @ cut
            self._for_cuts += float(cut.sum())

    def _spare(self, rows: IntArray, part: IntArray) -> FloatArray:
        """Rest of each row's cost, at the prices of all other columns (rows,)."""
        others = self._column.copy()
        others[part] = 0.0
        spare = 1.0 - self._cover.sees[rows] @ others - self._paid[rows]
        return np.maximum(spare, 0.0) if self._cover.once else spare

    def _gains(self, part: IntArray, others: IntArray, demands: IntArray) -> tuple[FloatArray, FloatArray]:
        """Cost of each column of the part, and of others, at the prices of all other demands (n,)."""
        fixed = self._demand.copy()
        fixed[demands] = 0.0
        paid = self._cover.asks[others] * self._column[others]
        return -(self._worth_of_column[part] @ fixed), paid - self._worth_of_column[others] @ fixed


def _parts(cover: Cover) -> Iterator[IntArray]:
    """Parts of the columns (n,): those seen together, with those that the same rows see besides.

    Together they have every column that has weight. Columns of separators, which rows of many rooms see,
    lead to no others.
    """
    entries = np.diff(cover.seen_by.indptr)
    counts = cover.weight > 0
    is_left = counts & (entries > 0)
    for first in range(cover.columns):
        if not is_left[first]:
            continue
        newest, size = np.array([first]), int(entries[first])
        is_left[first] = False
        part = [newest]
        while len(newest) and size < SIZE:
            seen = _seen_with(cover, newest)
            newest = seen[is_left[seen]]
            newest = newest[: 1 + int(np.searchsorted(np.cumsum(entries[newest]), SIZE - size))]
            is_left[newest] = False
            size += int(entries[newest].sum())
            part.append(newest)
        seen = _seen_with(cover, np.concatenate(part))
        around = seen[counts[seen]]
        beyond = _seen_with(cover, around)
        yield np.union1d(around, beyond[~counts[beyond]])


def _pairs(cover: Cover, parts: list[IntArray]) -> Iterator[list[IntArray]]:
    """The parts, the largest first, each with the next that few of its rows see, if there is one."""
    rows = [distinct(cover.seen_by[part].indices, cover.rows) for part in parts]
    left = sorted(range(len(parts)), key=lambda k: -len(parts[k]))
    while left:
        one = left.pop(0)
        is_seen = np.zeros(cover.rows, dtype=bool)
        is_seen[rows[one]] = True
        fit = (k for k in left if np.count_nonzero(is_seen[rows[k]]) <= SHARED * len(rows[k]))
        other = next(fit, None)
        if other is None:
            yield [parts[one]]
        else:
            left.remove(other)
            yield [parts[one], parts[other]]


def _seen_with(cover: Cover, columns: IntArray) -> IntArray:
    """All columns that the rows see which see any of these (n,)."""
    return distinct(cover.sees[distinct(cover.seen_by[columns].indices, cover.rows)].indices, cover.columns)
