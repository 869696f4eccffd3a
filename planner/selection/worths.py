"""Worth of columns: what they add to each demand, in all and for each row that sees them."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.selection.worth_kernel import add_worth, add_worth_by_row, take_gain


class _Entries(NamedTuple):
    """Demands (in 64-bit integers) or rows (in 32 bits) of each column of the covering problem."""

    first: IntArray
    """First entry of each column, and their end (columns + 1,)."""
    to: IntArray
    """Demand or row of each entry (entries,)."""


class Transposed:
    """The transpose of a sparse matrix, made when it is used.

    What holds this does not hold the covering problem, which would then keep itself until garbage is sought.
    """

    def __init__(self, matrix: csr_array) -> None:
        self._of = matrix

    @cached_property
    def matrix(self) -> csr_array:
        made = self._of.T.tocsr()
        made.sort_indices()
        return made


class Worths:
    """Sums of what the columns of one covering problem add to its demands."""

    def __init__(self, adds_to: csr_array, seen_by: Transposed) -> None:
        """`adds_to` has the worth of columns (columns, demands), `seen_by` who sees them (columns, rows)."""
        self._demands, self._seen_by = int(adds_to.shape[1]), seen_by
        self._adds = _entries(adds_to, np.int64)
        self._worth = np.ascontiguousarray(adds_to.data, np.int64)
        self._sums = np.zeros(self._demands, dtype=np.int64)
        self._gains = np.zeros(3, dtype=np.int64)

    @cached_property
    def _seen(self) -> _Entries:
        return _entries(self._seen_by.matrix, np.int32)

    @cached_property
    def _rows(self) -> int:
        return int(self._seen_by.matrix.shape[1])

    @property
    def rows_of(self) -> tuple[IntArray, IntArray]:
        """First entry of each column, and their end (columns + 1,); and the rows that see it: for kernels."""
        return self._seen

    @property
    def added(self) -> tuple[IntArray, IntArray, IntArray]:
        """First entry of each column and their end (columns + 1,); demands; and the worth to each."""
        return (*self._adds, self._worth)

    def of(self, columns: IntArray) -> IntArray:
        """Worth of columns to each demand (demands,)."""
        kernel = compiled(add_worth, large=False)
        if kernel is None:
            _, demand, worth = self._entries(columns)
            return np.bincount(demand, worth, self._demands).astype(np.int64)
        sums = np.zeros(self._demands, dtype=np.int64)
        kernel(columns, *self._adds, self._worth, sums)
        return sums

    def gain(
        self, columns: IntArray, covered: IntArray, asks: IntArray, short: IntArray, missing: IntArray
    ) -> tuple[int, int, int]:
        """Worth of the columns that still need views: to what is short, to unmet demands, to the whole.

        `covered` and `asks` are views of each column (columns,), `short` and `missing` views and worth that
        each demand still needs (demands,). A demand counts in the first for no more than it is short.
        """
        kernel = compiled(take_gain, large=False)
        if kernel is None:
            adds = self.of(columns[covered[columns] < asks[columns]])
            return int(np.minimum(adds, short).sum()), int(adds[missing > 0].sum()), int(adds[0])
        kernel(columns, covered, asks, *self._adds, self._worth, short, missing, self._sums, self._gains)
        first, second, whole = self._gains.tolist()
        return first, second, whole

    def by_row(self, columns: IntArray, demands: IntArray) -> IntArray:
        """Worth of those of the columns that each row sees (demands, rows)."""
        place = np.full(self._demands, -1, dtype=np.int64)
        place[demands] = np.arange(len(demands))
        kernel = compiled(add_worth_by_row, large=False)
        if kernel is None:
            return self._by_row(columns, place, len(demands))
        sums = np.zeros(len(demands) * self._rows, dtype=np.int64)
        kernel(columns, *self._seen, *self._adds, self._worth, place, self._rows, sums)
        return sums.reshape(len(demands), self._rows)

    def _by_row(self, columns: IntArray, place: IntArray, asked: int) -> IntArray:
        counts = self._seen.first[columns + 1] - self._seen.first[columns]
        row = self.seers(columns)
        counts, demand, worth = self._entries(np.repeat(columns, counts))
        is_asked = place[demand] >= 0
        cell = place[demand[is_asked]] * self._rows + np.repeat(row, counts)[is_asked]
        sums = np.bincount(cell, worth[is_asked], asked * self._rows)
        return sums.astype(np.int64).reshape(asked, self._rows)

    def _entries(self, columns: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Number of demands that each column adds to, their indices, and the worth to each."""
        counts = self._adds.first[columns + 1] - self._adds.first[columns]
        entry = ranges(self._adds.first[columns], counts)
        return counts, self._adds.to[entry], self._worth[entry]

    def demands(self, columns: IntArray) -> IntArray:
        """Demands that the columns add to, once for each column (n,)."""
        return self._entries(columns)[1]

    def seers(self, columns: IntArray) -> IntArray:
        """Rows that see the columns, once for each column (n,)."""
        counts = self._seen.first[columns + 1] - self._seen.first[columns]
        return self._seen.to[ranges(self._seen.first[columns], counts)].astype(np.int64)


def _entries(by_column: csr_array, of: type[np.signedinteger]) -> _Entries:
    first, to = by_column.indptr, by_column.indices
    return _Entries(np.ascontiguousarray(first, np.int64), np.ascontiguousarray(to, of))
