"""The relaxation of a tour to fractions of edges, as a linear programme, and exact bounds from it.

The bound does not depend on the solver's tolerances. The solver's prices are rounded to whole nanometres,
and their bound is summed in whole numbers (by weak duality any prices give a valid bound).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray

NANOMETRES = 1e9
"""Per metre, the solver's unit."""


@dataclass(frozen=True, eq=False)
class Cut:
    """An inequality that every tour meets: the sum of `times` over its edges is at least `least`."""

    times: IntArray
    """(m,)."""
    least: int


class Relaxation:
    """The linear programme: two edges at every point, every cut met, edges used in fractions.

    A violated row costs a whole tour's length. So there always is a solution, and its prices prove that a
    subproblem contains no shorter tour.
    """

    def __init__(self, cost: IntArray, edges: IntArray, *, limit: int) -> None:
        self.points = len(cost)
        self.edges = edges
        self.solved = 0
        self._cost = cost[edges[:, 0], edges[:, 1]]
        self._limit = limit / NANOMETRES
        self._times: list[IntArray] = []
        self._least: list[int] = []
        self._solver = _solver()
        for price in self._cost / NANOMETRES:
            self._solver.addCol(price, 0.0, 1.0, 0, [], [])
        for point in range(self.points):
            self._add(Cut((edges == point).any(axis=1).astype(np.int64), 2), most=2.0)

    def add(self, cut: Cut) -> None:
        """Add a cut."""
        self._add(cut, most=np.inf)

    def _add(self, cut: Cut, *, most: float) -> None:
        row, index = len(self._least), np.flatnonzero(cut.times)
        times = cut.times[index].astype(float)
        self._solver.addRow(float(cut.least), most, len(index), index.astype(np.int32), times)
        self._solver.addCol(self._limit, 0.0, np.inf, 1, np.array([row], dtype=np.int32), np.ones(1))
        self._times.append(cut.times)
        self._least.append(cut.least)

    def solve(self, low: IntArray, high: IntArray) -> FloatArray:
        """Fraction of each edge (m,) in a cheapest solution that uses it from `low` to `high` times."""
        index = np.arange(len(self.edges), dtype=np.int32)
        self._solver.changeColsBounds(len(index), index, low.astype(float), high.astype(float))
        self._solver.run()
        self.solved += 1
        return np.array(self._solver.getSolution().col_value[: len(index)])

    def bound(self, low: IntArray, high: IntArray) -> int:
        """Lower bound on the tours within these limits, from the prices of the last solution."""
        prices = np.nan_to_num(np.array(self._solver.getSolution().row_dual))
        dearest = 2 * self._limit  # clipped, so that sums stay within 64 bits for any prices
        price = np.rint(np.clip(prices, -dearest, dearest) * NANOMETRES).astype(np.int64)
        price[self.points :] = np.maximum(price[self.points :], 0)
        reduced = self._cost - price @ np.array(self._times)
        return int(price @ np.array(self._least) + np.where(reduced < 0, reduced * high, reduced * low).sum())


def _solver() -> Any:
    """HiGHS as the dual simplex method, on one thread."""
    from highspy import Highs

    solver = Highs()
    for name, value in (
        ("output_flag", False),
        ("threads", 1),
        ("random_seed", 0),
        ("solver", "simplex"),
        ("presolve", "off"),
        ("dual_feasibility_tolerance", 1e-9),
    ):
        solver.setOptionValue(name, value)
    return solver
