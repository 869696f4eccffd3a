"""A graph of rows that register, prepared for searches that go no farther than they need to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.selection.component_kernel import grow_parts, mark_neighbours
from stopgo.planner.visibility.unit_ranges import ranges


@instance_cached
def adjacency_of(links: csr_array) -> tuple[IntArray, IntArray]:
    """First link of each row and the rows of all links, in 64-bit integers."""
    first, to = (np.ascontiguousarray(part, np.int64) for part in (links.indptr, links.indices))
    return first, to


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
        self._is_end = np.zeros(rows, dtype=bool)
        self._following, self._met = (np.zeros(rows, dtype=np.int64) for _ in range(2))

    def ends(self, rows: IntArray) -> IntArray:
        """Rows to which the links of some rows lead (links,)."""
        return self._to[ranges(self._first[rows], self._first[rows + 1] - self._first[rows])]

    def neighbours(self, rows: IntArray) -> IntArray:
        """Rows that have a link to one of these, once each, ascending (n,)."""
        kernel = compiled(mark_neighbours, large=False)
        if kernel is None:
            self._is_end[self.ends(rows)] = True
        else:
            kernel(self._first, self._to, np.ascontiguousarray(rows, np.int64), self._is_end.view(np.uint8))
        found = np.flatnonzero(self._is_end).astype(np.int64)
        self._is_end[found] = False
        return found

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
        numbers = np.unique(label)
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
