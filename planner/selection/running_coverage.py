"""Views of columns and the worth reached, while rows come and leave: a change costs what its rows see."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.worth_kernel import count_views


class RunningCoverage:
    """Coverage of a covering problem by some of its rows."""

    def __init__(self, cover: Cover, rows: IntArray) -> None:
        self.cover = cover
        self.covered = cover.covered_by(rows)
        """Number of the rows that see each column (columns,)."""
        self.reached = cover.reached(self.covered)
        """Worth reached for each demand (demands,)."""

    @property
    def missing(self) -> IntArray:
        """Shortfall of each demand (demands,)."""
        return np.maximum(0, self.cover.needed - self.reached)

    @property
    def is_enough(self) -> bool:
        """True if every demand is met."""
        return bool((self.reached >= self.cover.needed).all())

    def left(self, columns: IntArray) -> IntArray:
        """Views that each of these columns still needs; 0 or less if none (n,)."""
        return np.asarray(self.cover.asks[columns] - self.covered[columns])

    def add(self, rows: IntArray) -> None:
        """Let rows come."""
        self._count(rows, 1)

    def remove(self, rows: IntArray) -> None:
        """Let rows leave."""
        self._count(rows, -1)

    def enough_with(self, rows: IntArray) -> bool:
        """True if every demand were met with these rows too."""
        self._count(rows, 1)
        enough = self.is_enough
        self._count(rows, -1)
        return enough

    def enough_without(self, rows: IntArray) -> bool:
        """True if every demand were met without these rows."""
        self._count(rows, -1)
        enough = self.is_enough
        self._count(rows, 1)
        return enough

    def added_by(self, rows: IntArray) -> IntArray:
        """Weight of the columns that need more views and that each of these rows sees (n,)."""
        weight = np.where(self.covered < self.cover.asks, self.cover.weight, 0)
        return np.asarray(self.cover.sees[rows] @ weight)

    def _count(self, rows: IntArray, step: int) -> None:
        cover, kernel = self.cover, compiled(count_views, large=False)
        if kernel is None:
            self.covered += step * cover.covered_by(rows)
            self.reached = cover.reached(self.covered)
            return
        rows = np.ascontiguousarray(rows, np.int64)
        kernel(rows, step, *cover.seen_columns, *cover.worths.added, cover.asks, self.covered, self.reached)
