"""Knapsack cover inequalities: what some columns must add to a demand, of rows that count for no more.

Let some columns of a demand count as seen. The others must add the rest r. A row that sees more than r of
them helps no more than one that sees r, since rows are chosen whole: Σ_i min(a_i, r) x_i >= r. A linear
relaxation meets r by fractions of such rows, so the inequality raises its bound. (Wolsey, "An analysis of the
greedy algorithm for the submodular set covering problem", 1982; Carr, Fleischer, Leung and Phillips,
"Strengthening integrality gaps for capacitated network design and covering problems", 2000.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, vstack

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.linear_programme import LinearProgramme, Solution

LEVELS = 20
"""Sets of columns that are tried for each demand: those seen least, up to so many levels of a full view."""
SEEN = 1.0 + 1e-6
"""Views, as a fraction of those needed, above which a column is seen more than enough."""
CHOSEN = 1e-6
"""Fraction above which a row is chosen in part."""
VIOLATED = 1e-3
"""Part of an inequality that a solution must leave unmet."""
ROUNDS = 10
"""Most rounds in which a programme is solved again with more inequalities."""
LEAST_GAIN = 0.05
"""Gain of a round below which it is the last: a fraction of a stop."""
MOST_ROUNDS, NEAR = 20, 4.0
"""The same where the next whole number of stops is so many gains of the last round away, or nearer.

`office-l1` is bounded by 57 stops at range 10 then, and by 56 without.
"""


@dataclass(frozen=True, eq=False)
class KnapsackCuts:
    """Inequalities that every selection meets: `adds` @ x >= `needed`, in whole numbers."""

    adds: csr_array
    """What each row adds, no more than is needed (cuts, rows)."""
    needed: IntArray
    """(cuts,)."""

    @classmethod
    def none(cls, rows: int) -> KnapsackCuts:
        return cls(csr_array((0, rows), dtype=np.int64), np.empty(0, np.int64))

    def __len__(self) -> int:
        return len(self.needed)

    def __add__(self, other: KnapsackCuts) -> KnapsackCuts:
        adds = csr_array(vstack([self.adds, other.adds], format="csr"))
        return KnapsackCuts(adds, np.concatenate([self.needed, other.needed]))

    @property
    def fractions(self) -> csr_array:
        """`adds` as fractions of what is needed (cuts, rows)."""
        many = np.diff(self.adds.indptr)
        data = self.adds.data / np.repeat(self.needed, many)
        return csr_array((data, self.adds.indices, self.adds.indptr), shape=self.adds.shape)


def tightened(
    programme: LinearProgramme, cover: Cover, *, whole: bool = False
) -> tuple[Solution | None, KnapsackCuts]:
    """The solution of a relaxation with inequalities added that it violates, round by round; and these.

    The programme's first columns are the rows of the problem. The prices of the inequalities are the last.
    None if the solver fails. The bound of a `whole` problem is rounded up, so the next whole number counts.
    """
    cuts, solution = KnapsackCuts.none(cover.rows), programme.solution()
    for done in range(1, MOST_ROUNDS + 1):
        if solution is None:
            break
        more = violated_cuts(cover, solution.values[: cover.rows])
        if not len(more):
            break
        cuts, before = cuts + more, solution.cost
        programme.add(more.fractions, np.ones(len(more)))
        solution = programme.solution()
        if solution is not None:
            gain, missing = solution.cost - before, math.ceil(solution.cost) - solution.cost
            if not (whole and missing <= NEAR * gain) and (done >= ROUNDS or gain < LEAST_GAIN):
                break
    return solution, cuts


def violated_cuts(cover: Cover, chosen: FloatArray) -> KnapsackCuts:
    """Of each demand the inequality that these fractions of rows (rows,) violate most, if there is one.

    The columns that are seen least, up to some level, add the rest, and all others count as seen.
    """
    some, common = np.flatnonzero(chosen > CHOSEN), int(np.lcm.reduce(cover.asks, initial=1))
    column, level, levels = cover.worth.indices, _levels(cover, chosen), LEVELS + 2
    demand = np.repeat(np.arange(len(cover.needed)), np.diff(cover.worth.indptr))
    each = cover.worth.data * (common // cover.asks[column])
    cell = demand * levels + level[column]
    by_cell = csr_array((each, (column, cell)), shape=(cover.columns, len(cover.needed) * levels))
    seen = csc_array(cover.sees[some].astype(np.int64) @ by_cell)
    worth = np.bincount(cell, cover.worth.data, len(cover.needed) * levels).reshape(-1, levels)
    beyond = worth.sum(axis=1, keepdims=True) - worth.cumsum(axis=1)
    rest = common * (cover.needed[:, None] - beyond.astype(np.int64))
    last = np.full(len(cover.needed), -1)
    for k in np.flatnonzero((rest > 0).any(axis=1)).tolist():
        last[k] = _most_violated(_dense(seen, k * levels, levels), rest[k], chosen[some])
    cut = np.flatnonzero(last >= 0)
    if not len(cut):
        return KnapsackCuts.none(cover.rows)
    is_in = level[column] <= last[demand]
    number = np.searchsorted(cut, demand[is_in])
    chosen_columns = csr_array((each[is_in], (column[is_in], number)), shape=(cover.columns, len(cut)))
    adds, needed = csr_array(cover.sums_of(chosen_columns).T.tocsr()), rest[cut, last[cut]]
    adds.data = np.minimum(adds.data, np.repeat(needed, np.diff(adds.indptr)))
    return KnapsackCuts(adds, needed)


def _dense(matrix: csc_array, first: int, many: int) -> IntArray:
    """So many columns of a matrix, from the first one on (n, many), in a third of scipy's time."""
    ends = matrix.indptr[first : first + many + 1]
    found, own = np.zeros((matrix.shape[0], many), dtype=np.int64), slice(ends[0], ends[-1])
    found[matrix.indices[own], np.repeat(np.arange(many), np.diff(ends))] = matrix.data[own]
    return found


def _levels(cover: Cover, chosen: FloatArray) -> IntArray:
    """Level of the views of each column (columns,): up to `LEVELS` for all it needs, one more for above."""
    some = np.flatnonzero(chosen)  # products have a copy of all entries that they go over
    views = cover.sees[some].T @ chosen[some] / cover.asks
    level = np.minimum(LEVELS, (views * LEVELS).astype(np.int64))
    return np.where(views > SEEN, LEVELS + 1, level)


def _most_violated(seen: IntArray, rest: IntArray, chosen: FloatArray) -> int:
    """The last level of the columns whose inequality is violated most; -1 if none is.

    `seen` is what rows see of each level (n, levels), `rest` what columns up to each must add (levels,), and
    `chosen` the fractions of the rows (n,).
    """
    adds = np.minimum(seen.cumsum(axis=1), rest)
    met = (chosen @ adds) / np.maximum(rest, 1)
    met[rest <= 0] = np.inf
    best = int(np.argmin(met))
    return best if met[best] < 1.0 - VIOLATED else -1
