"""Components of a selection -> node separators: sets of rows that every connected selection must use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.selection.component_kernel import label_components
from stopgo.planner.selection.cover import Cover


def components_of(links: csr_array, rows: IntArray) -> list[IntArray]:
    """Connected components of the rows, the largest first, then by the lowest row."""
    rows = _without(links, rows)
    if not len(rows):
        return []
    label = _labels(links, rows)
    ends = np.cumsum(np.bincount(label))
    found = np.split(rows[np.argsort(label, kind="stable")], ends[:-1])
    return sorted(found, key=lambda component: (-len(component), int(component[0])))


def _labels(links: csr_array, rows: IntArray) -> IntArray:
    """Number of the component of each row (n,)."""
    kernel = compiled(label_components, large=False)
    if kernel is None:
        return np.asarray(connected_components(links[rows][:, rows], directed=False)[1])
    label, stack = np.full(links.shape[0], -1, dtype=np.int64), np.empty(links.shape[0], dtype=np.int64)
    kernel(*_adjacency(links), _mask(links, rows).astype(np.int64), label, stack)
    return label[rows]


@instance_cached
def _adjacency(links: csr_array) -> tuple[IntArray, IntArray]:
    """First link of each row and the rows of all links, in 64-bit integers."""
    first, to = (np.ascontiguousarray(part, np.int64) for part in (links.indptr, links.indices))
    return first, to


def regions_of(cover: Cover, components: list[IntArray]) -> list[IntArray]:
    """The components needed to meet every demand: the smallest superfluous ones are dropped first."""
    needed = list(components)
    for component in reversed(components):
        rest = [other for other in needed if other is not component]
        if rest and meets(cover, np.concatenate(rest)):
            needed = rest
    return needed


@dataclass(frozen=True, eq=False)
class NodeSeparator:
    """Rows that split a region in two: every path from one side to the other contains one of them."""

    between: IntArray
    here: IntArray
    beyond: IntArray
    elsewhere: IntArray
    """All rows of other regions."""

    def enough(self, cover: Cover) -> tuple[bool, bool]:
        """True for each side that meets every demand by itself, with all other regions."""
        here, beyond = (np.concatenate([side, self.elsewhere]) for side in (self.here, self.beyond))
        return meets(cover, here), meets(cover, beyond)


def separators(cover: Cover, links: csr_array, regions: list[IntArray], rows: IntArray) -> Iterator[IntArray]:
    """Sets of rows (n,) of which every selection that is connected in each region has at least one.

    A node separator is such a set if neither side meets every demand by itself, with all other regions.
    """
    for separator, _, _ in _separators(links, regions, rows):
        if not any(separator.enough(cover)):
            yield separator.between


@dataclass(eq=False)
class Conditions:
    """Constraints of a linear programme that bind only if some rows are chosen: `matrix` x >= `least`."""

    columns: int

    def __post_init__(self) -> None:
        self._known: dict[tuple[bytes, tuple[int, ...]], None] = {}

    def take(self, found: Iterable[tuple[IntArray, tuple[int, ...]]]) -> bool:
        """Add conditions: one of a set of rows is chosen if all of its ends are; True if any is new."""
        before = len(self._known)
        self._known |= {(between.tobytes(), ends): None for between, ends in found}
        return len(self._known) > before

    @property
    def matrix(self) -> csr_array:
        entries = np.zeros((len(self._known), self.columns))
        for k, (between, ends) in enumerate(self._known):
            entries[k, np.frombuffer(between, np.int64)] = 1.0
            entries[k, list(ends)] = -1.0
        return csr_array(entries)

    @property
    def least(self) -> FloatArray:
        return np.array([1.0 - len(ends) for _, ends in self._known])


def conditions_between(
    cover: Cover, links: csr_array, regions: list[IntArray], rows: IntArray
) -> Iterator[tuple[IntArray, tuple[int, ...]]]:
    """Separators where one side suffices: they bind only if rows of both sides are chosen.

    Each is a set of rows and its ends: one row of the set is chosen if all the ends are.
    """
    for separator, component, others in _separators(links, regions, rows):
        here, beyond = separator.enough(cover)
        far = int(np.intersect1d(separator.beyond, others)[0])
        ends = ((int(component[0]),) if beyond else ()) + ((far,) if here else ())
        yield separator.between, ends


def _separators(
    links: csr_array, regions: list[IntArray], rows: IntArray
) -> Iterator[tuple[NodeSeparator, IntArray, IntArray]]:
    """Node separators between each component of the rows and its others, with both."""
    for k, region in enumerate(regions):
        elsewhere = np.concatenate([np.empty(0, np.int64), *regions[:k], *regions[k + 1 :]])
        inner = components_of(links, np.intersect1d(rows, region))
        for component in inner if len(inner) > 1 else []:
            is_other = _mask(links, *inner)
            is_other[component] = False
            others = np.flatnonzero(is_other)
            for beyond in components_of(links, _without(links, region, neighbours(links, component))):
                if is_other[beyond].any():
                    between = neighbours(links, beyond)
                    here = _without(links, region, beyond, between)
                    yield NodeSeparator(between, here, beyond, elsewhere), component, others


def neighbours(links: csr_array, rows: IntArray) -> IntArray:
    """Other rows that have a link to one of these."""
    return _without(links, links[rows].indices, rows)


def _without(links: csr_array, rows: IntArray, *others: IntArray) -> IntArray:
    """The rows that are in none of the others, once each and ascending."""
    kept = _mask(links, rows)
    for some in others:
        kept[some] = False
    return np.flatnonzero(kept).astype(np.int64)


def _mask(links: csr_array, *sets: IntArray) -> BoolArray:
    """True for each row that is in one of the sets (all rows,)."""
    found = np.zeros(links.shape[0], dtype=bool)
    for some in sets:
        found[some] = True
    return found


def meets(cover: Cover, rows: IntArray) -> bool:
    """True if these rows meet every demand."""
    if 2 * len(rows) < cover.rows:
        covered = cover.covered_by(rows)
    else:
        others = np.ones(cover.rows, dtype=bool)
        others[rows] = False
        covered = cover.seers - cover.covered_by(np.flatnonzero(others))
    return not cover.missing(covered).any()
