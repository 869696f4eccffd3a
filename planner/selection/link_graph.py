"""A graph of rows that register, prepared for searches that go no farther than they need to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.selection.component_kernel import find_neighbours, grow_parts


@instance_cached
def adjacency_of(links: csr_array) -> tuple[IntArray, NDArray[np.int32]]:
    """First link of each row, and the rows of all links in 32 bits: there are millions."""
    return np.ascontiguousarray(links.indptr, np.int64), np.ascontiguousarray(links.indices, np.int32)


class LinkedParts(NamedTuple):
    """Connected parts around some rows; of the last one, not all rows may be known."""

    whole: list[IntArray]
    """All rows of each other part, ascending (n,)."""
    last: IntArray
    """Some rows of the last part, with all rows from which the search began (n,)."""


class LinkGraph:
    """A symmetric graph of rows that register."""

    def __init__(self, links: csr_array) -> None:
        self.links = links
        rows = links.shape[0]
        self._first, self._to = adjacency_of(links)
        self._label = np.full(rows, -1, dtype=np.int64)
        self._is_end = np.zeros(rows, dtype=np.uint8)
        self._following, self._met, self._found = (np.zeros(rows, dtype=np.int64) for _ in range(3))

    def ends(self, rows: IntArray) -> IntArray:
        """Rows to which the links of some rows lead (links,)."""
        ends = self._to[ranges(self._first[rows], self._first[rows + 1] - self._first[rows])]
        return ends.astype(np.int64)

    def neighbours(self, rows: IntArray) -> IntArray:
        """Rows that have a link to one of these, once each, ascending (n,)."""
        kernel = compiled(find_neighbours, large=False)
        if kernel is None:
            return np.unique(self.ends(rows))
        rows = np.ascontiguousarray(rows, np.int64)
        many = kernel(self._first, self._to, rows, self._is_end, self._found)
        return np.sort(self._found[:many])

    def parts_around(self, seeds: IntArray, inside: IntArray) -> LinkedParts:
        """The connected parts around rows, of those with `inside` 1 (rows,)."""
        kernel = compiled(grow_parts, large=False)
        if kernel is None:
            return self._all_parts(seeds, inside)
        seeds = np.ascontiguousarray(seeds, np.int64)
        parts = (np.zeros(len(seeds), dtype=np.int64) for _ in range(4))
        parent, head, tail, turn = parts
        tables = (self._label, parent, head, tail, turn, self._following, self._met)
        met = self._met[: kernel(self._first, self._to, inside, seeds, *tables)].copy()
        label = self._label[met]
        self._label[met] = -1
        numbers = np.flatnonzero(np.bincount(label))
        parts = {number: met[label == number] for number in numbers.tolist()}
        growing = [part for number, part in parts.items() if head[number] >= 0]
        last = growing[0] if growing else met[:0]
        return LinkedParts([np.sort(part) for part in parts.values() if part is not last], last)

    def _all_parts(self, seeds: IntArray, inside: IntArray) -> LinkedParts:
        """`parts_around` by a search of the whole graph."""
        rows = np.flatnonzero(inside)
        label = connected_components(self.links[rows][:, rows], directed=False)[1]
        parts: list[IntArray] = [rows[label == part] for part in np.unique(label[np.isin(rows, seeds)])]
        last: IntArray = max(parts, key=len, default=rows[:0])
        return LinkedParts([part for part in parts if part is not last], last)
