"""Components of a selection -> node separators: sets of rows that every connected selection must use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.selection.component_kernel import label_components
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.improve import improved
from stopgo.planner.selection.link_graph import LinkedParts, LinkGraph, adjacency_of
from stopgo.planner.selection.running_coverage import RunningCoverage

FEW = 2
"""Components of which one is needed at least; more are searched for fewer."""


def components_of(links: csr_array, rows: IntArray) -> list[IntArray]:
    """Connected components of the rows, the largest first, then by the lowest row."""
    rows = np.flatnonzero(_mask(links, rows)).astype(np.int64)
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
    kernel(*adjacency_of(links), _mask(links, rows).astype(np.int64), label, stack)
    return label[rows]


def regions_of(cover: Cover, components: list[IntArray]) -> list[IntArray]:
    """The components needed to meet every demand, as few as are found.

    The smallest superfluous ones are dropped first. Where many remain, a search for the fewest often leaves
    half of them. Where none is superfluous, each is needed.
    """
    dropped = _without_superfluous(cover, components)
    fewest = _fewest(cover, components) if FEW < len(dropped) < len(components) else dropped
    return fewest if len(fewest) < len(dropped) else dropped


def _without_superfluous(cover: Cover, components: list[IntArray]) -> list[IntArray]:
    needed: list[IntArray] = []
    coverage = RunningCoverage(cover, np.concatenate([np.empty(0, np.int64), *components]))
    for before, component in reversed(list(enumerate(components))):
        coverage.remove(component)
        if before + len(needed) == 0 or not coverage.is_enough:
            coverage.add(component)
            needed.append(component)
    return needed[::-1]


def _fewest(cover: Cover, components: list[IntArray]) -> list[IntArray]:
    """Few components that meet every demand, by the search for few stops; all of them if it finds none."""
    sizes = [len(component) for component in components]
    ends = (np.repeat(np.arange(len(components)), sizes), np.concatenate(components))
    members = csr_array((np.ones(len(ends[0]), np.int64), ends), shape=(len(components), cover.rows))
    sees = csr_array(members @ cover.sees)
    sees.data = np.ones(len(sees.data), np.int8)
    together = Cover(sees, cover.worth, cover.needed)
    chosen = [components[k] for k in np.sort(improved(together, greedy(together), at_least=1))]
    enough = RunningCoverage(cover, np.concatenate([np.empty(0, np.int64), *chosen])).is_enough
    return chosen if enough else components


@dataclass(frozen=True, eq=False)
class NodeSeparator:
    """Rows that split a region in two: every path from one side to the other contains one of them."""

    between: IntArray
    near: IntArray
    """All rows of the side of which all rows are known; the other side is the rest of the region."""
    is_here: bool
    """True if the near side is that of the component around which the separator lies."""


class SeparatorSearch:
    """The regions of a covering problem, prepared for searches for separators in them.

    What is around a component, and what a side sees, is found without a look at all the rest of its region.
    """

    def __init__(self, cover: Cover, graph: LinkGraph, regions: list[IntArray]) -> None:
        self._cover, self._graph, self._regions = cover, graph, regions
        every = np.concatenate([np.empty(0, np.int64), *regions])
        self._region_of = np.full(cover.rows, -1, dtype=np.int64)
        self._region_of[every] = np.repeat(np.arange(len(regions)), [len(region) for region in regions])
        self._every, self._elsewhere = RunningCoverage(cover, every), RunningCoverage(cover, every)
        self._left_out = np.empty(0, np.int64)
        self._weight = cover.paid_to(cover.weight.astype(float))
        self._is_near, self._is_chosen = (np.zeros(cover.rows, dtype=bool) for _ in range(2))

    def separators(self, rows: IntArray) -> Iterator[IntArray]:
        """Sets of rows (n,) of which every selection that is connected in each region has at least one.

        A node separator is such a set if neither side meets every demand by itself, with all other regions.
        """
        for separator, _, _ in self._found(rows):
            if not any(self._enough(separator)):
                yield separator.between

    def conditions(self, rows: IntArray) -> Iterator[tuple[IntArray, tuple[int, ...]]]:
        """Separators where one side suffices: they bind only if rows of both sides are chosen.

        Each is a set of rows and its ends: one row of the set is chosen if all the ends are.
        """
        for separator, k, inner in self._found(rows):
            here, beyond = self._enough(separator)
            others = np.concatenate([*inner[:k], *inner[k + 1 :]])
            is_near = np.isin(others, separator.near)
            far = int(others[~is_near if separator.is_here else is_near].min())
            ends = ((int(inner[k][0]),) if beyond else ()) + ((far,) if here else ())
            yield separator.between, ends

    def _enough(self, separator: NodeSeparator) -> tuple[bool, bool]:
        """True for the side of the component, and for the one beyond, if it meets every demand."""
        most = self._elsewhere.reached[0] + self._weight[separator.near].sum()
        near = most >= self._cover.needed[0] and self._elsewhere.enough_with(separator.near)
        far = self._every.enough_without(np.concatenate([separator.near, separator.between]))
        return (near, far) if separator.is_here else (far, near)

    def _found(self, rows: IntArray) -> Iterator[tuple[NodeSeparator, int, list[IntArray]]]:
        """Node separators between a component of the rows and the others of its region.

        With each come the number of the component, and all of them.
        """
        inside, components = np.zeros(self._cover.rows, dtype=np.int64), dict[int, list[IntArray]]()
        for one in components_of(self._graph.links, rows[self._region_of[rows] >= 0]):
            components.setdefault(int(self._region_of[one[0]]), []).append(one)
        for number, inner in sorted(components.items()):
            if len(inner) > 1:
                region, chosen = self._regions[number], np.concatenate(inner)
                inside[region], self._is_chosen[chosen] = 1, True
                self._leave_out(region)
                for k, component in enumerate(inner):
                    for separator in self._around(component, len(chosen), inside, len(region)):
                        yield separator, k, inner
                inside[region], self._is_chosen[chosen] = 0, False

    def _leave_out(self, region: IntArray) -> None:
        """Let the coverage elsewhere be that of all regions but this one; it is often the same again."""
        if region is not self._left_out:
            self._elsewhere.add(self._left_out)
            self._elsewhere.remove(region)
            self._left_out = region

    def _around(
        self, component: IntArray, chosen: int, inside: IntArray, size: int
    ) -> Iterator[NodeSeparator]:
        """Separators between a component and others, for each part of its region beyond its neighbours.

        The rows `inside` are those of the region, which has `size`, and `chosen` of them are in components.
        Large parts come first, then by their lowest row.
        """
        inside[component] = 0
        near = self._graph.neighbours(component)
        near = near[inside[near] == 1]
        inside[near] = 0
        parts = self._graph.parts_around(self._graph.neighbours(near), inside)
        inside[component], inside[near] = 1, 1
        between = self._between(near, parts)
        known = np.concatenate([component, near, *parts.whole])
        found = [
            (-len(part), int(part[0]), NodeSeparator(between[k], part, is_here=False))
            for k, part in enumerate(parts.whole) if self._is_chosen[part].any()
        ]  # fmt: skip
        if len(parts.last) and np.count_nonzero(self._is_chosen[known]) < chosen:
            rest = inside.copy()
            rest[known] = 0
            here = known[~np.isin(known, between[-1], kind="table")]
            separator = NodeSeparator(between[-1], here, is_here=True)
            found.append((len(known) - size, int(np.argmax(rest)), separator))
        return (separator for *_, separator in sorted(found, key=lambda one: one[:2]))

    def _between(self, near: IntArray, parts: LinkedParts) -> list[IntArray]:
        """The rows of those near that have a link to each part (n,), the last one included."""
        self._is_near[near] = True
        linked = [self._graph.neighbours(part) for part in (*parts.whole, parts.last)]
        found = [rows[self._is_near[rows]] for rows in linked]
        self._is_near[near] = False
        return found


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
    def sets(self) -> list[IntArray]:
        """The sets of rows, without their ends."""
        return [np.frombuffer(between, np.int64) for between, _ in self._known]

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


def _mask(links: csr_array, rows: IntArray) -> BoolArray:
    """True for each of these rows (all rows,)."""
    found = np.zeros(links.shape[0], dtype=bool)
    found[rows] = True
    return found
