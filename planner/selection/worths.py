"""Worth of columns: what they add to each demand, in all and for each row that sees them."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import distinct, ranges
from stopgo.planner.selection.worth_kernel import (
    add_worth,
    add_worth_by_row,
    count_runs,
    note_runs,
    take_gain,
)


class _Entries(NamedTuple):
    """Demands (in 64-bit integers), or runs of rows (in 32 bits), of each column of the covering problem."""

    first: IntArray
    """First entry of each column, and their end (columns + 1,)."""
    to: NDArray[Any]
    """Demand of each entry (entries,); or its first row, and the one after its last (2 * entries,)."""


class Transposed:
    """The transpose of a sparse matrix, made when it is used.

    What holds this does not hold the covering problem, which would then keep itself until garbage is sought.
    """

    def __init__(self, matrix: csr_array) -> None:
        self._of = matrix
        self.rows = int(matrix.shape[0])

    @cached_property
    def matrix(self) -> csr_array:
        made = self._of.T.tocsr()
        made.sort_indices()
        return made

    @cached_property
    def runs(self) -> _Entries:
        """Runs of successive rows that see each column: at long ranges, an eighth of the entries."""
        count, note = compiled(count_runs, large=False), compiled(note_runs, large=False)
        if count is None or note is None:
            return _runs_of(self.matrix)
        entries = np.ascontiguousarray(self._of.indptr, np.int64), _narrow(self._of.indices)
        many, columns = np.zeros(self._of.shape[1], dtype=np.int64), self._of.shape[1]
        count(*entries, np.full(columns, -2, dtype=np.int32), many)
        first = np.concatenate([[0], np.cumsum(many)]).astype(np.int64)
        runs = np.empty(2 * int(first[-1]), dtype=np.int32)
        note(*entries, np.full(columns, -2, dtype=np.int32), first[:-1].copy(), runs)
        return _Entries(first, runs)


def _runs_of(seen_by: csr_array) -> _Entries:
    """Runs of successive indices of each row of a matrix with sorted ones."""
    row = np.repeat(np.arange(seen_by.shape[0]), np.diff(seen_by.indptr))
    begins = np.ones(len(row) + 1, dtype=bool)
    begins[1:-1] = (np.diff(seen_by.indices) != 1) | (np.diff(row) != 0)
    at = np.flatnonzero(begins)
    runs = np.stack([seen_by.indices[at[:-1]], seen_by.indices[at[1:] - 1] + 1], axis=1)
    return _Entries(np.searchsorted(row[at[:-1]], np.arange(seen_by.shape[0] + 1)), _narrow(runs.ravel()))


class Worths:
    """Sums of what the columns of one covering problem add to its demands."""

    def __init__(self, adds_to: csr_array, seen_by: Transposed) -> None:
        """`adds_to` has the worth of columns (columns, demands), `seen_by` who sees them (columns, rows)."""
        self._demands, self._seen_by = int(adds_to.shape[1]), seen_by
        first, to = adds_to.indptr, adds_to.indices
        self._adds = _Entries(np.ascontiguousarray(first, np.int64), np.ascontiguousarray(to, np.int64))
        self._worth = np.ascontiguousarray(adds_to.data, np.int64)
        self._sums = np.zeros(self._demands, dtype=np.int64)
        self._gains = np.zeros(3, dtype=np.int64)

    @property
    def runs_of_rows(self) -> tuple[IntArray, NDArray[np.int32]]:
        """First run of each column, and their end (columns + 1,); and runs of rows that see it: for kernels.

        Run k is of the rows from entry 2 k to before entry 2 k + 1.
        """
        return self._seen_by.runs

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
        rows = self._seen_by.rows
        sums = np.zeros(len(demands) * rows, dtype=np.int64)
        kernel(columns, *self.runs_of_rows, *self._adds, self._worth, place, rows, sums)
        return sums.reshape(len(demands), rows)

    def _by_row(self, columns: IntArray, place: IntArray, asked: int) -> IntArray:
        counts, row = self._seers(columns)
        rows, each = self._seen_by.rows, np.repeat(columns, counts)
        counts, demand, worth = self._entries(each)
        is_asked = place[demand] >= 0
        cell = place[demand[is_asked]] * rows + np.repeat(row, counts)[is_asked]
        sums = np.bincount(cell, worth[is_asked], asked * rows)
        return sums.astype(np.int64).reshape(asked, rows)

    def _entries(self, columns: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Number of demands that each column adds to, their indices, and the worth to each."""
        counts = self._adds.first[columns + 1] - self._adds.first[columns]
        entry = ranges(self._adds.first[columns], counts)
        return counts, self._adds.to[entry], self._worth[entry]

    def demands(self, columns: IntArray) -> IntArray:
        """Demands that the columns add to, once for each column (n,)."""
        return self._entries(columns)[1]

    def seers(self, columns: IntArray) -> IntArray:
        """Rows that see any of the columns, ascending (n,)."""
        (begin, end), rows = self._runs(columns).T, self._seen_by.rows
        if int((end - begin).sum()) < rows:
            return distinct(ranges(begin, end - begin), rows)
        begun, ended = (np.bincount(at, minlength=rows + 1) for at in (begin, end))
        return np.flatnonzero(np.cumsum(begun - ended))

    def _seers(self, columns: IntArray) -> tuple[IntArray, IntArray]:
        """Number of rows that see each column (columns,), and these rows, column by column (n,)."""
        first = self.runs_of_rows[0]
        runs = first[columns + 1] - first[columns]
        begin, end = self._runs(columns).T
        counts = np.bincount(np.repeat(np.arange(len(columns)), runs), end - begin, len(columns))
        return counts.astype(np.int64), ranges(begin, end - begin)

    def _runs(self, columns: IntArray) -> IntArray:
        """Runs of rows that see the columns, column by column (n, 2)."""
        first, ends = self.runs_of_rows
        runs = ranges(first[columns], first[columns + 1] - first[columns])
        return ends.reshape(-1, 2)[runs].astype(np.int64)


def _narrow(indices: NDArray[Any]) -> NDArray[np.int32]:
    return np.ascontiguousarray(indices, np.int32)
