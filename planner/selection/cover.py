"""The covering problem behind a selection: units that look alike to every candidate become one column."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, diags_array

from mission.geometry import IntArray
from mission.planning import Visibility


@dataclass(frozen=True, eq=False)
class Cover:
    """Rows are candidates, columns groups of units seen by exactly the same candidates."""

    sees: csr_array
    """(rows, columns), 1 where the candidate sees the group."""
    weight: IntArray
    """Units in each column (columns,); every column is seen by some row."""
    needed: int
    """Units that must be covered."""

    @property
    def rows(self) -> int:
        return int(self.sees.shape[0])

    @property
    def total(self) -> int:
        return int(self.weight.sum())

    def columns_of(self, row: int) -> IntArray:
        """Columns that a row sees."""
        return self.sees.indices[self.sees.indptr[row] : self.sees.indptr[row + 1]]

    @cached_property
    def seen_by(self) -> csr_array:
        """(columns, rows), the same matrix turned."""
        return _sorted(self.sees.T)

    def weights_of(self, columns: IntArray) -> IntArray:
        """Units of these columns that each row sees."""
        turned = self.seen_by
        counts = turned.indptr[columns + 1] - turned.indptr[columns]
        offsets = np.repeat(turned.indptr[columns] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
        rows = turned.indices[np.arange(int(counts.sum())) + offsets]
        return np.bincount(rows, np.repeat(self.weight[columns], counts), self.rows).astype(np.int64)

    def gains(self, covered: IntArray) -> IntArray:
        """Units each row would add, where `covered` counts the chosen rows that see each column."""
        return np.asarray(self.sees @ np.where(covered > 0, 0, self.weight))

    def covered_by(self, rows: IntArray) -> IntArray:
        """How many of `rows` see each column."""
        return np.asarray(self.sees[rows].sum(axis=0)).ravel().astype(np.int64)

    def units(self, covered: IntArray) -> int:
        """Units in the columns that are covered at least once."""
        return int(self.weight[covered > 0].sum())

    def after(self, rows: IntArray) -> Cover:
        """What is left to cover once `rows` are chosen; row numbers stay."""
        if not len(rows):
            return self
        left = self.covered_by(rows) == 0
        needed = max(0, self.needed - int(self.weight[~left].sum()))
        return Cover(_sorted(self.sees[:, np.flatnonzero(left)]), self.weight[left], needed)

    def offering(self, rows: IntArray) -> Cover:
        """The same, where only `rows` can be chosen: the others see nothing, nor is it needed."""
        if len(rows) == self.rows:
            return self
        offered = np.zeros(self.rows)
        offered[rows] = 1
        sees = _sorted((diags_array(offered) @ self.sees).tocsr().astype(np.int64))
        sees.eliminate_zeros()
        coverable = int(self.weight[np.asarray(sees.sum(axis=0)).ravel() > 0].sum())
        return Cover(sees, self.weight, min(self.needed, coverable))


def cover_of(visibility: Visibility, *, required: float) -> Cover:
    """Merge equal columns, without loss: within a run's ends nothing changes, then equal sets join."""
    piece_first, pieces = _pieces(visibility)
    sees = _piece_matrix(visibility, piece_first)
    length = np.diff(np.append(piece_first, visibility.targets.total))
    by_column = sees.T.tocsr()
    by_column.sort_indices()
    groups: dict[bytes, int] = {}
    group = np.full(pieces, -1, dtype=np.int64)
    for column in range(pieces):
        rows = by_column.indices[by_column.indptr[column] : by_column.indptr[column + 1]]
        if len(rows):
            group[column] = groups.setdefault(rows.tobytes(), len(groups))
    seen = group >= 0
    first = np.unique(group[seen], return_index=True)[1]
    weight = np.bincount(group[seen], weights=length[seen], minlength=len(groups)).astype(np.int64)
    merged = _sorted(sees[:, np.flatnonzero(seen)[first]])
    return Cover(merged, weight, needed_units(int(weight.sum()), required=required))


def _sorted(matrix: csr_array) -> csr_array:
    matrix = matrix.tocsr()
    matrix.sort_indices()
    return matrix


def needed_units(total: int, *, required: float) -> int:
    """Fewest units that are at least the share `required` of `total`."""
    return int(np.ceil(required * total - 1e-9))


def _pieces(visibility: Visibility) -> tuple[IntArray, int]:
    """First units of the stretches within which no run begins or ends."""
    cuts = np.concatenate([[0], visibility.first, visibility.last + 1])
    first = np.unique(cuts[cuts < visibility.targets.total])
    return first, len(first)


def _piece_matrix(visibility: Visibility, piece_first: IntArray) -> csr_array:
    row = np.repeat(np.arange(visibility.rows), np.diff(visibility.pointer))
    begin = np.searchsorted(piece_first, visibility.first)
    end = np.searchsorted(piece_first, visibility.last, side="right")
    lengths = end - begin
    rows = np.repeat(row, lengths)
    offset = np.repeat(begin - np.concatenate([[0], np.cumsum(lengths)[:-1]]), lengths)
    columns = np.arange(int(lengths.sum())) + offset
    shape = (visibility.rows, len(piece_first))
    matrix = csr_array((np.ones(len(rows), dtype=np.int64), (rows, columns)), shape=shape)
    matrix.data[:] = 1
    return matrix
