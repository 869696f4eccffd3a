"""The covering problem of a selection: units seen by the same candidates become one column."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csr_array, diags_array, hstack, vstack

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import Visibility
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.selection.demands import Demands
from stopgo.planner.selection.stretch_kernel import count_columns, note_columns
from stopgo.planner.selection.worth_kernel import add_views, add_worth_of_rows, sum_by_row
from stopgo.planner.selection.worths import Transposed, Worths

BLOCK = 1_000_000
"""Runs of units, and entries, that are widened at a time: long ranges have many millions."""


@dataclass(frozen=True, eq=False)
class Cover:
    """Rows are candidates, columns groups of units seen by exactly the same candidates.

    Every demand is a fraction of something that must be seen: demand 0 of the whole, the others of a room
    or of a kind of element. A column counts once enough chosen rows see it (`asks`).
    """

    sees: csr_array
    """(rows, columns), 1 where the candidate sees the group, in 8 bits: large floors have many."""
    worth: csr_array
    """Weight that each column adds to each demand (demands, columns)."""
    needed: IntArray
    """Required weight of each demand (demands,)."""
    views: IntArray | int = 1
    """Number of chosen rows that must see each column until it counts (columns,), or one for all."""

    @classmethod
    def of_whole(cls, sees: csr_array, weight: IntArray, needed: int) -> Cover:
        """A problem with one demand: weight `needed` of columns with these weights (columns,)."""
        return cls(sees, csr_array(np.asarray(weight, dtype=np.int64)[None, :]), np.array([needed]))

    @property
    def rows(self) -> int:
        return int(self.sees.shape[0])

    @property
    def columns(self) -> int:
        return int(self.sees.shape[1])

    @cached_property
    def asks(self) -> IntArray:
        """Number of chosen rows that must see each column until it counts (columns,)."""
        return np.array(np.broadcast_to(self.views, self.columns), dtype=np.int64)

    @cached_property
    def once(self) -> bool:
        """True if every column counts with the first row that sees it."""
        return bool((self.asks == 1).all())

    @cached_property
    def weight(self) -> IntArray:
        """Weight that each column adds to the whole (columns,)."""
        weight, end = np.zeros(self.columns, dtype=np.int64), self.worth.indptr[1]
        weight[self.worth.indices[:end]] = self.worth.data[:end]
        return weight

    @property
    def total(self) -> int:
        """Weight of everything that any candidate sees."""
        return int(self.weight.sum())

    @property
    def seen_by(self) -> csr_array:
        """The transpose of `sees` (columns, rows)."""
        return self._transposed.matrix

    @cached_property
    def _transposed(self) -> Transposed:
        return Transposed(self.sees)

    def forget_seers(self) -> None:
        """Forget who sees each column, as much as the matrix itself; it is found again where it is used."""
        for name in ("_transposed", "worths"):
            vars(self).pop(name, None)

    @cached_property
    def adds_to(self) -> csr_array:
        """The transpose of `worth` (columns, demands)."""
        return _sorted(self.worth.T)

    @cached_property
    def adds(self) -> csr_array:
        """Worth that each row adds to each demand before any is chosen (rows, demands)."""
        kernel = compiled(add_worth_of_rows, large=False)
        if kernel is None:
            return self.sums_of(self.adds_to)
        demands, parts = len(self.needed), []
        some = max(1, BLOCK // max(1, demands))
        for low in range(0, max(1, self.rows), some):
            high = min(low + some, self.rows)
            sums = np.zeros((high - low, demands), dtype=np.int64)
            kernel(low, high, *self.seen_columns, *self.worths.added, demands, sums.ravel())
            parts.append(_compressed(sums))
        return csr_array(vstack(parts, format="csr"))

    def sums_of(self, values: csr_array) -> csr_array:
        """Sums of values of the columns (columns, n) that each row sees (rows, n)."""
        return csr_array(vstack([part @ values for part in self._parts()], format="csr"))

    def _parts(self) -> Iterator[csr_array]:
        """The matrix by some rows at a time (n, columns): products are computed in 64 bits for each entry."""
        blocks = list(_blocks(self.sees.indptr))
        yield from (self.sees[low:high] for low, high in blocks if len(blocks) > 1)
        if len(blocks) <= 1:
            yield self.sees

    @cached_property
    def worths(self) -> Worths:
        """Sums of what columns add to the demands."""
        return Worths(self.adds_to, self._transposed)

    @cached_property
    def seen_columns(self) -> tuple[IntArray, NDArray[np.int32]]:
        """First entry of each row, and their end (rows + 1,); and the columns that rows see: for kernels."""
        first, to = self.sees.indptr, self.sees.indices
        return np.ascontiguousarray(first, np.int64), np.ascontiguousarray(to, np.int32)

    @cached_property
    def most_demands(self) -> int:
        """Most demands to which the columns of one row add."""
        if self.worth.data.all():
            return int(np.diff(self.adds.indptr).max(initial=0))
        adds = _pattern(self.adds_to)
        most = [np.diff(csr_array(_pattern(part) @ adds).indptr).max(initial=0) for part in self._parts()]
        return int(max(most))

    def columns_of(self, row: int) -> IntArray:
        """Columns that a row sees."""
        return self.sees.indices[self.sees.indptr[row] : self.sees.indptr[row + 1]].astype(np.int64)

    def columns_of_each(self, rows: IntArray) -> IntArray:
        """Columns that each of the rows sees, one row after the other (n,)."""
        begin = self.sees.indptr[rows]
        entries = ranges(begin, self.sees.indptr[np.asarray(rows) + 1] - begin)
        return self.sees.indices[entries].astype(np.int64)

    def covered_by(self, rows: IntArray) -> IntArray:
        """Number of `rows` that see each column (columns,)."""
        kernel = compiled(add_views, large=False)
        if kernel is None:
            return np.bincount(self.columns_of_each(rows), minlength=self.columns)
        views = np.zeros(self.columns, dtype=np.int64)
        kernel(np.ascontiguousarray(rows, np.int64), *self.seen_columns, views)
        return views

    def paid_to(self, price: FloatArray) -> FloatArray:
        """Sum of the prices (columns,) of all columns that each row sees (rows,)."""
        kernel = compiled(sum_by_row, large=False)
        if kernel is None:
            return np.asarray(self.sees @ price)
        sums = np.zeros(self.rows)
        kernel(*self.seen_columns, np.ascontiguousarray(price, np.float64), sums)
        return sums

    def seen_weight(self, covered: IntArray) -> int:
        """Weight of the columns that have all views they need."""
        return int(self.weight[covered >= self.asks].sum())

    def reached(self, covered: IntArray) -> IntArray:
        """Weight reached for each demand (demands,); `covered` counts chosen rows per column."""
        return np.asarray(self.worth @ (covered >= self.asks).astype(np.int64)).ravel()

    def missing(self, covered: IntArray) -> IntArray:
        """Shortfall of each demand (demands,)."""
        return np.maximum(0, self.needed - self.reached(covered))

    def after(self, rows: IntArray) -> Cover:
        """The problem that remains after `rows` are chosen; row numbers stay."""
        if not len(rows):
            return self
        covered = self.covered_by(rows)
        left = np.flatnonzero(covered < self.asks)
        more = _without(self.sees, rows) if not self.once else self.sees
        views = (self.asks - covered)[left]
        return Cover(_sorted(more[:, left]), _sorted(self.worth[:, left]), self.missing(covered), views)

    def offering(self, rows: IntArray) -> Cover:
        """The problem where only `rows` can be chosen; demands that they cannot meet are lowered."""
        if len(rows) == self.rows:
            return self
        sees = _without(self.sees, np.setdiff1d(np.arange(self.rows), rows))
        coverable = self.reached(np.asarray(sees.sum(axis=0)).ravel())
        return Cover(sees, self.worth, np.minimum(self.needed, coverable), self.views)

    @cached_property
    def views_needed(self) -> IntArray:
        """Fewest views, by weight, with which each demand could be met (demands,)."""
        if self.once:
            return self.needed
        begin, demand = self.worth.indptr, np.repeat(np.arange(len(self.needed)), np.diff(self.worth.indptr))
        asks = self.asks[self.worth.indices]
        order = np.lexsort((asks, demand))  # of each demand the columns with the fewest views first
        worth, asks = self.worth.data[order].astype(np.int64), asks[order]
        sums = np.concatenate([[0], np.cumsum(worth)])
        before = sums[:-1] - sums[begin[demand]]
        taken = np.clip(self.needed[demand] - before, 0, worth) * asks
        views: IntArray = np.diff(np.concatenate([[0], np.cumsum(taken)])[begin])
        return views

    @cached_property
    def usual_worth(self) -> int:
        """About what a row sees, to guide greedy among other demands."""
        return max(1, int(self.paid_to(self.weight.astype(float)).mean()))

    def with_one_of_each(self, sets: Sequence[IntArray]) -> Cover:
        """The problem with one more demand for each set of rows (n,): one of the set must be chosen."""
        if not sets:
            return self
        worth = self.usual_worth
        sizes = [len(rows) for rows in sets]
        rows, numbers = np.concatenate(sets).astype(np.int64), np.repeat(np.arange(len(sets)), sizes)
        adds = csr_array((np.full(len(rows), worth), (rows, numbers)), shape=(self.rows, len(sets)))
        priced = diags_array(np.full(len(sets), float(worth))).astype(np.int64)
        worths = block_diag([self.worth, priced])
        made = Cover(
            _with_columns(self.sees, rows, numbers, len(sets)),
            _sorted(worths.astype(np.int64)),
            np.concatenate([self.needed, np.full(len(sets), worth)]),
            np.concatenate([self.asks, np.ones(len(sets), np.int64)]),
        )
        vars(made)["adds"] = hstack([self.adds, adds], format="csr")
        return made


def cover_of(visibility: Visibility, demands: Demands) -> Cover:
    """Merge equal columns without loss: first units between ends of runs, then equal sets of rows."""
    runs = _Runs(visibility)
    weighs = np.add.reduceat(demands.weight, runs.stretch_first) > 0
    group, first = _alike(runs, visibility.rows, weighs)
    worth = _worth(demands, np.repeat(group, np.diff(np.append(runs.stretch_first, len(demands.weight)))))
    needed = demands.needed(np.asarray(worth.sum(axis=1)).ravel())
    return Cover(runs.matrix(first), worth, needed, visibility.asked[runs.stretch_first[first]])


class _Runs:
    """Runs of *stretches* that rows see: units between which no run of any row begins or ends."""

    def __init__(self, visibility: Visibility) -> None:
        begins = np.zeros(visibility.targets.total + 1, dtype=bool)
        begins[0] = True
        begins[visibility.first] = True
        begins[visibility.last + 1] = True
        self.stretch_first = np.flatnonzero(begins[:-1])
        """First unit of each stretch (stretches,)."""
        stretch = np.cumsum(begins, dtype=np.int32) - 1
        self.first = np.zeros(visibility.rows + 1, dtype=np.int64)
        """First run of each row, and their end (rows + 1,)."""
        parts: list[list[NDArray[np.int32]]] = [[np.empty(0, np.int32)], [np.empty(0, np.int32)]]
        for row, _, first, last in visibility.runs_apart_by_rows():
            begin, end = stretch[first], stretch[last + 1]
            apart = np.ones(len(row) + 1, dtype=bool)  # runs that go on on the next segment become one
            apart[1:-1] = (np.diff(row) != 0) | (begin[1:] != end[:-1])
            parts[0].append(begin[apart[:-1]])
            parts[1].append(end[apart[1:]])
            self.first[1:] += np.bincount(row[apart[:-1]], minlength=visibility.rows)
        np.cumsum(self.first, out=self.first)
        self.begin, self.end = (_joined(part) for part in parts)
        """Of each run, by row and then by stretch: its first stretch, and the one after its last."""

    def matrix(self, columns: IntArray) -> csr_array:
        """1 where the row sees the stretch (rows, columns), of these stretches, ascending."""
        before = np.searchsorted(columns, np.arange(len(self.stretch_first) + 1)).astype(np.int32)
        count, note = compiled(count_columns, large=False), compiled(note_columns, large=False)
        if count is None or note is None:
            many = before[self.end] - before[self.begin]
            pointer = np.concatenate([[0], np.cumsum(many, dtype=np.int64)])[self.first]
            to = ranges(before[self.begin].astype(np.int64), many).astype(np.int32)
        else:
            pointer = np.zeros(len(self.first), dtype=np.int64)
            count(self.first, self.begin, self.end, before, pointer)
            to = np.empty(int(pointer[-1]), dtype=np.int32)
            note(self.begin, self.end, before, to)
        small = pointer.astype(np.int32) if pointer[-1] < np.iinfo(np.int32).max else pointer
        shape = (len(pointer) - 1, len(columns))
        return csr_array((_ones(len(to)), to, small), shape=shape)

    def numbers_of(self, number: NDArray[np.uint64]) -> NDArray[np.uint64]:
        """Sum of the numbers of the rows that see each stretch, modulo 2**64 (stretches,)."""
        change = np.zeros(len(self.stretch_first) + 1, dtype=np.uint64)
        for low, high in _blocks(self.first):
            each = np.repeat(number[low:high], np.diff(self.first[low : high + 1]))
            own = slice(self.first[low], self.first[high])
            np.add.at(change, self.begin[own], each)
            np.subtract.at(change, self.end[own], each)
        return np.cumsum(change)[:-1]


def _alike(runs: _Runs, rows: int, weighs: BoolArray) -> tuple[IntArray, IntArray]:
    """Group of each stretch by the rows that see it, and the first stretch of each group, ascending.

    The group is -1 where no row sees the stretch, or where it does not weigh. Sets of rows are compared by
    the sums of two random numbers of each row, which take no memory to speak of.
    """
    numbers = np.random.default_rng(0).integers(0, 2**64, (2, rows), dtype=np.uint64)
    seen = runs.numbers_of(np.ones(rows, dtype=np.uint64))
    asked = np.flatnonzero((seen > 0) & weighs)
    sums = np.stack([runs.numbers_of(number)[asked] for number in numbers], axis=1)
    _, first, which = np.unique(sums, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.argsort(order)
    group = np.full(len(weighs), -1, dtype=np.int64)
    group[asked] = rank[which.reshape(-1)]
    return group, asked[first[order]]


def _blocks(pointer: IntArray) -> Iterator[tuple[int, int]]:
    """The first row and the row after the last one, of the rows of some entries at a time."""
    begins = np.searchsorted(pointer, np.arange(0, pointer[-1], BLOCK)).tolist()
    return pairwise(np.unique([0, *begins, len(pointer) - 1]).tolist())


def _joined(parts: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    """The parts in one array; they are forgotten."""
    whole = np.concatenate(parts)
    parts.clear()
    return whole


def _worth(demands: Demands, column: IntArray) -> csr_array:
    """Weight in each demand of the units of each column (demands, columns); `column` is -1 for none."""
    worth = csr_array((len(demands.fraction), int(column.max(initial=-1)) + 1), dtype=np.int64)
    for demand in demands.member:
        unit = np.flatnonzero((column >= 0) & (demand >= 0))
        places = (demand[unit].astype(np.int32), column[unit].astype(np.int32))
        worth += coo_array((demands.weight[unit], places), shape=worth.shape, dtype=np.int64).tocsr()
    return _sorted(worth)


def _without(sees: csr_array, rows: IntArray) -> csr_array:
    """The matrix in which these rows see nothing."""
    many = np.diff(sees.indptr)
    stays = np.ones(sees.shape[0], dtype=bool)
    stays[rows] = False
    entries = np.repeat(stays, many)
    pointer = np.concatenate([[0], np.cumsum(np.where(stays, many, 0))]).astype(np.int32)
    return _sorted(csr_array((_ones(int(pointer[-1])), sees.indices[entries], pointer), shape=sees.shape))


def _with_columns(sees: csr_array, rows: IntArray, numbers: IntArray, more: int) -> csr_array:
    """The matrix and `more` columns, of which these rows see those of these numbers (n,).

    Each entry is copied once, since a matrix may have many millions.
    """
    order, many = np.lexsort((numbers, rows)), np.bincount(rows, minlength=sees.shape[0])
    added = (sees.shape[1] + numbers[order]).astype(sees.indices.dtype)
    to = np.insert(sees.indices, sees.indptr[rows[order] + 1], added)
    pointer = sees.indptr + np.concatenate([[0], np.cumsum(many)])
    shape = (sees.shape[0], sees.shape[1] + more)
    return csr_array((_ones(len(to)), to, pointer.astype(sees.indptr.dtype)), shape=shape)


def _ones(many: int) -> NDArray[np.int8]:
    """So many ones that take no memory."""
    return np.broadcast_to(np.int8(1), many)


def _pattern(matrix: csr_array) -> csr_array:
    """True where the matrix has an entry, even of 0."""
    ones = np.ones(len(matrix.indices), dtype=bool)
    return csr_array((ones, matrix.indices, matrix.indptr), shape=matrix.shape)


def _sorted(matrix: csr_array) -> csr_array:
    matrix = matrix.tocsr()
    matrix.sort_indices()
    return matrix


def _compressed(dense: IntArray) -> csr_array:
    """The matrix without its zeros, in a fifth of scipy's time."""
    rows, columns = dense.shape
    at = np.flatnonzero(dense.ravel() != 0)
    first = np.searchsorted(at, np.arange(rows + 1) * columns)
    return csr_array((dense.ravel()[at], at % max(1, columns), first), shape=dense.shape)
