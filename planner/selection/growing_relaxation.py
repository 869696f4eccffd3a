"""Linear relaxation of a wide selection: rows join it once their price asks for them.

Where the range is long, there are many rows, each sees hundreds of columns, and a solution uses few of them.
So the relaxation begins with rows from everywhere. A row that is worth more than its cost, at the prices
of a solution, joins (column generation: Gilmore and Gomory, "A linear programming approach to the
cutting-stock problem", 1961). The prices of each solution prove a bound of the whole problem. Neighbouring
columns are one, and knapsack cover inequalities are added meanwhile.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, eye_array, hstack

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.cover_relaxation import group_fractions, grouped, programme_of
from stopgo.planner.selection.knapsack_cuts import LEAST_GAIN, KnapsackCuts, violated_cuts
from stopgo.planner.selection.linear_programme import Solution
from stopgo.planner.selection.multiplier_bound import rounded_up

FIRST = 1000
"""Rows with which the relaxation begins, about."""
ENTRIES = 12_000
"""Entries of these rows once neighbouring columns are one, about."""
JOINING = 300
"""Most rows that join after one solution."""
SOLUTIONS = 12
"""Most solutions; a count, so that no bound depends on speed."""
WORTH = 1.0 + 1e-4
"""Price of a row above which it joins, as a multiple of its cost."""
UNMET = 1.0
"""Cost of as much as a usual column adds to a demand: as much as a row, which sees many."""
NEAR = 0.02
"""Distance of the bound to the solution's cost, as a fraction, below which inequalities are added."""


def growing_bound(cover: Cover) -> int:
    """Lower bound on the rows of a selection, by solutions with ever more rows and inequalities."""
    relaxation = GrowingRelaxation(cover)
    for _ in range(SOLUTIONS):
        if not relaxation.goes_on():
            break
    return rounded_up(relaxation.bound)


class GrowingRelaxation:
    """Relaxation of some rows: its columns are groups of columns, what is unmet, then rows as they joined."""

    def __init__(self, cover: Cover) -> None:
        self._cover = cover
        entries = np.diff(cover.sees.indptr)
        offered = np.flatnonzero(entries)
        first = offered[:: max(1, len(offered) // FIRST)]
        self._fraction = group_fractions(cover, -(-int(entries[first].sum()) // ENTRIES))
        none = Cover(cover.sees[:0], cover.worth, cover.needed, cover.asks)
        self._programme, self._scale = programme_of(grouped(none, self._fraction), 0.0)
        self._leave_unmet()
        self._rows = np.empty(0, np.int64)
        """Rows in the order of their joining (n,)."""
        self._is_in = np.zeros(cover.rows, dtype=bool)
        """True for each of them (rows,)."""
        self._cuts, self._fractions = KnapsackCuts.none(cover.rows), csr_array((0, cover.rows))
        self.bound, self._cost_before_cuts = 0.0, -np.inf
        self._join(first)

    def goes_on(self) -> bool:
        """Solve, and add what the solution asks for; return False if it asks for nothing more."""
        solution = self._programme.solution()
        if solution is None:
            return False
        paid_to = self._paid_to(solution)
        joining = np.flatnonzero((paid_to > WORTH) & ~self._is_in)
        is_near = solution.cost - self.bound <= NEAR * solution.cost
        cut = is_near and solution.cost >= self._cost_before_cuts + LEAST_GAIN and self._cut(solution)
        if len(joining) and (cut or solution.cost - self.bound > LEAST_GAIN):
            self._join(_some(joining, paid_to))
            return True
        return cut

    def _paid_to(self, solution: Solution) -> FloatArray:
        """Price of each row (rows,). The prices prove a bound, as they are or scaled down to the costs."""
        cover, groups = self._cover, self._fraction.shape[1]
        of_groups, of_demands, price = np.split(solution.prices, [groups, groups + len(cover.needed)])
        column_price, demand_price = self._fraction @ of_groups, of_demands / self._scale
        paid_to = cover.paid_to(column_price) + self._fractions.T @ price
        beyond = np.maximum(0.0, cover.worth.T @ demand_price - cover.asks * column_price).sum()
        proved = float(cover.needed @ demand_price + price.sum() - beyond)
        each = [proved - float(np.maximum(0.0, paid_to - 1.0).sum())]
        if cover.once:
            each.append(proved / max(1.0, float(paid_to.max(initial=0.0))))
        self.bound = max(self.bound, *each)
        return paid_to

    def _cut(self, solution: Solution) -> bool:
        """Add the inequalities that a solution violates; return True if there are any."""
        cover, chosen = self._cover, np.zeros(self._cover.rows)
        others = len(solution.values) - len(self._rows)
        chosen[self._rows] = solution.values[others:]
        more = violated_cuts(cover, chosen)
        if not len(more):
            return False
        self._cost_before_cuts, self._cuts = solution.cost, self._cuts + more
        self._fractions = self._cuts.fractions
        adds = csr_array(
            hstack([csr_array((len(more), others)), more.fractions[:, self._rows]], format="csr")
        )
        self._programme.add(adds, np.ones(len(more)))
        return True

    def _leave_unmet(self) -> None:
        """Let any part of a demand be left, dearer than by any row, until there are rows that meet it."""
        groups, demands = self._fraction.shape[1], len(self._cover.needed)
        columns = csr_array(hstack([csr_array((demands, groups)), eye_array(demands)], format="csr"))
        self._programme.add_columns(columns, np.full(demands, UNMET), np.full(demands, np.inf))

    def _join(self, rows: IntArray) -> None:
        cover = self._cover
        seen = cover.sees[rows] @ self._fraction
        of_demands = csr_array((len(rows), len(cover.needed)))
        columns = csr_array(hstack([seen, of_demands, self._fractions[:, rows].T], format="csr"))
        most = np.full(len(rows), np.inf if cover.once else 1.0)
        self._programme.add_columns(columns, np.ones(len(rows)), most)
        self._rows = np.concatenate([self._rows, rows])
        self._is_in[rows] = True


def _some(rows: IntArray, worth: FloatArray) -> IntArray:
    """At most `JOINING` of the rows: half of them those that are worth most, and half from everywhere."""
    if len(rows) <= JOINING:
        return rows
    best = rows[np.argsort(-worth[rows], kind="stable")[: JOINING // 2]]
    others = np.setdiff1d(rows, best)
    return np.union1d(best, others[:: -(-2 * len(others) // JOINING)])
