"""Lower bound by branching: the relaxation with so many stops or fewer among some, and with one more.

The stops that add to one demand, as those of a room, are a whole number in every selection. Where the
relaxation has a fraction of one, it is solved with each of the two whole numbers as a limit, and so on. The
bound is the least of all ends. It often proves a selection the fewest whose relaxation is one stop lower.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.cover_relaxation import CoverRelaxation
from stopgo.planner.selection.linear_programme import Solution
from stopgo.planner.selection.multiplier_bound import rounded_up

ENTRIES = 30_000
"""Entries of the relaxation, about."""
NODES = 24
"""Relaxations solved at most."""
LEAST_FRACTION = 0.02
"""Distance from a whole number below which no branch is made."""


def branching_bound(cover: Cover, *, found: int) -> int:
    """Lower bound on the rows of a selection; `found` rows are known to suffice."""
    if not cover.needed.any():
        return 0
    tree = _Tree(CoverRelaxation(cover, ENTRIES, unmet_cost=float(found)), _sets(cover), found)
    solution = tree.relaxation.solution()
    return 0 if solution is None else rounded_up(tree.least(solution))


def _sets(cover: Cover) -> FloatArray:
    """1 for the rows that add to a demand, of each demand but the whole (sets, rows)."""
    return (cover.adds[:, 1:].toarray().T > 0).astype(float)


@dataclass(eq=False)
class _Tree:
    """Branches of a relaxation, down to where more rows than are known to suffice are proved."""

    relaxation: CoverRelaxation
    sets: FloatArray
    found: int
    nodes: int = field(default=1)

    def least(self, solution: Solution, before: float = -math.inf) -> float:
        """The least bound of the branches at this solution; that of the branch `before` it was lower."""
        value = self.relaxation.proved(solution)
        branched = self._branched(solution)
        if (
            rounded_up(value) >= self.found
            or branched is None
            or not self._is_promising(value - before, value)
        ):
            return value
        rows, number = branched
        self.nodes += 2
        fewer = self._with(-rows, -math.floor(number), value)
        if rounded_up(fewer) < self.found:
            return value
        return max(value, min(fewer, self._with(rows, math.ceil(number), value)))

    def _is_promising(self, gain: float, value: float) -> bool:
        """True if branches that gain as much as the last one did may reach the end before the last node."""
        left = NODES - self.nodes
        return left > 1 and self.found - 1 - value <= gain * math.log2(left)

    def _branched(self, solution: Solution) -> tuple[FloatArray, float] | None:
        """The set whose rows are farthest from a whole number (rows,), and their number; None if all are."""
        numbers = self.sets @ solution.values[: self.sets.shape[1]]
        fraction = numbers - np.floor(numbers)
        apart = np.minimum(fraction, 1.0 - fraction)
        far = np.flatnonzero(apart > LEAST_FRACTION)
        if not len(far):
            return None
        k = far[np.argmax(apart[far])]
        return self.sets[k], float(numbers[k])

    def _with(self, rows: FloatArray, least: float, otherwise: float) -> float:
        """The least bound with one more demand, or the other one if the solver fails."""
        kept = len(self.relaxation)
        self.relaxation.demand(rows, least)
        solution = self.relaxation.solution()
        value = otherwise if solution is None else self.least(solution, otherwise)
        self.relaxation.forget(kept)
        return value
