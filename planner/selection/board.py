"""Incremental bookkeeping for a local search over selections: coverage, shortfall, value of each move."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.cover import Cover


class Board:
    """The state of a selection under change: coverage, shortfall, and the gain of every row."""

    def __init__(self, cover: Cover, rows: list[int]) -> None:
        self._cover, self._worths = cover, cover.worths
        self._covered = cover.covered_by(np.array(rows, dtype=np.int64))
        self._left = cover.asks - self._covered
        """Views that each column still needs; below 1 where the column counts."""
        self._reached = cover.reached(self._covered)
        self.weight: IntArray = np.ones(len(cover.needed), dtype=np.int64)
        """Penalty per missing unit of each demand (demands,)."""
        self._adds = self._worths.by_row(np.flatnonzero(self._left == 1), np.arange(len(cover.needed)))
        """Immediate gain of each row for each demand (demands, rows)."""
        self._losses: dict[int, tuple[bytes, IntArray]] = {}
        """Cache per leaving row: the columns that only it covers, and their worth to each demand."""
        self._regains: dict[int, tuple[bytes, IntArray, IntArray]] = {}
        """Cache per leaving row: key of columns and demands; cells of (demands, rows), and their sums."""

    @property
    def missing(self) -> IntArray:
        """Shortfall of each demand (demands,)."""
        return np.maximum(0, self._cover.needed - self._reached)

    def state(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Views that columns need, shortage and penalty of demands, gains by demand: for a kernel."""
        return self._left, self._cover.needed - self._reached, self.weight, self._adds.ravel()

    def raise_penalties(self) -> None:
        """Raise the penalty of each unmet demand, so that the search leaves local minima."""
        self.weight[self.missing > 0] += 1

    def take(self, row: int) -> None:
        """Add a row to the selection."""
        columns = self._cover.columns_of(row)
        self._reach(columns[self._left[columns] == 1], sign=1)
        self._offer(columns[self._left[columns] == 2], sign=1)
        self._left[columns] -= 1

    def drop(self, row: int) -> None:
        """Remove a row from the selection."""
        columns = self._cover.columns_of(row)
        self._left[columns] += 1
        self._reach(columns[self._left[columns] == 1], sign=-1)
        self._offer(columns[self._left[columns] == 2], sign=-1)

    def after_takes(self) -> IntArray:
        """Weighted shortfall after each row is added and none is removed (rows,)."""
        asked = self.missing
        open_demands = np.flatnonzero(asked)
        short = np.maximum(0, asked[open_demands][:, None] - self._adds[open_demands])
        return self.weight[open_demands] @ short

    def after_drop(self, out: int) -> int:
        """Weighted shortfall after this row is removed and none is added."""
        columns = self._cover.columns_of(out)
        left = self._reached - self._lost_with(out, columns[self._left[columns] == 0])
        return int(self.weight @ np.maximum(0, self._cover.needed - left))

    def after_swaps(self, out: int) -> tuple[IntArray, IntArray]:
        """Weighted shortfall and covered weight after `out` is exchanged for each row (rows,)."""
        columns = self._cover.columns_of(out)
        alone, almost = (columns[self._left[columns] == short] for short in (0, 1))
        left = self._reached - self._lost_with(out, alone)
        asked = self._cover.needed - left
        is_open = asked > 0
        is_open[0] = True
        open_demands = np.flatnonzero(is_open)
        adds = self._adds[open_demands]
        cells, sums = self._regains_after(out, alone, almost, open_demands)
        adds.reshape(-1)[cells] += sums
        short = np.maximum(0, asked[open_demands][:, None] - adds)
        return self.weight[open_demands] @ short, left[0] + adds[0]

    def _lost_with(self, out: int, alone: IntArray) -> IntArray:
        """Worth to each demand of the columns that only this row covers; cached while they are the same."""
        known = alone.tobytes()
        if out not in self._losses or self._losses[out][0] != known:
            self._losses[out] = known, self._worths.of(alone)
        return self._losses[out][1]

    def _regains_after(
        self, out: int, alone: IntArray, almost: IntArray, demands: IntArray
    ) -> tuple[IntArray, IntArray]:
        """Change of each row's gain once `out` leaves: columns it could cover again, less those two short.

        Cached until a swap changes the columns or the demands.
        """
        known = b"|".join(part.tobytes() for part in (alone, almost, demands))
        if out not in self._regains or self._regains[out][0] != known:
            regained = self._worths.by_row(alone, demands)
            if len(almost):
                regained -= self._worths.by_row(almost, demands)
            cells = np.flatnonzero(regained)
            self._regains[out] = known, cells, regained.ravel()[cells]
        return self._regains[out][1:]

    def _reach(self, columns: IntArray, *, sign: int) -> None:
        """Count the worth of these columns as reached (1), or as no longer reached (-1)."""
        self._reached += sign * self._worths.of(columns)
        self._offer(columns, sign=-sign)

    def _offer(self, columns: IntArray, *, sign: int) -> None:
        """Add the worth of these columns to the gain of every row that sees them (1), or remove it (-1)."""
        demands = np.flatnonzero(self._worths.of(columns))
        self._adds[demands] += sign * self._worths.by_row(columns, demands)
