"""Connected selection: the fewest rows that meet every demand and form one network by overlap.

Rows that separate two components of a selection are a node separator: every connected selection has one
of them. This is one more demand on the covering problem. So the problem grows until its solution is
connected, and its lower bound holds for connected selections. (Álvarez-Miranda, Ljubić and Mutzel, "The
maximum weight connected subgraph problem", 2013.) Components that remain are connected by more rows, and
rows without further use are removed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import block_array, csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.connecting_rows import connecting_rows
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.link_graph import LinkGraph
from stopgo.planner.selection.running_coverage import RunningCoverage
from stopgo.planner.selection.separators import (
    Conditions,
    SeparatorSearch,
    components_of,
    regions_of,
)

Search = Callable[[Cover, IntArray, Conditions], tuple[IntArray, int]]
"""`(problem, start, conditions) -> (rows, bound)`: an improved solution, from the solution `start`."""
QUICK_ROUNDS = 20
"""Rounds in which a greedy selection is searched for separators."""


@dataclass(eq=False)
class ConnectedCover:
    """A covering problem with the demand for connection; it grows by the separators of selections."""

    cover: Cover
    links: csr_array
    """1 where two rows register with one another (rows, rows)."""
    offered: IntArray
    regions: list[IntArray] = field(init=False)
    """Connected components of the rows offered; only as many of them as are needed."""
    cuts: dict[bytes, IntArray] = field(default_factory=dict)
    _problems: dict[int, Cover] = field(default_factory=dict)
    """By the number of cuts, so that the same problem is the same instance; only the latest."""

    def __post_init__(self) -> None:
        self.regions = regions_of(self.cover, components_of(self.links, self.offered))

    @property
    def problem(self) -> Cover:
        """The covering problem with one demand for each separator found."""
        if len(self.cuts) not in self._problems:
            self._problems.clear()  # before the next one: each is a large part of the memory
            self._offering.forget_seers()
            self._problems[len(self.cuts)] = self._with_cuts()
        return self._problems[len(self.cuts)]

    def _with_cuts(self) -> Cover:
        return self._offering.with_one_of_each(list(self.cuts.values()))

    @cached_property
    def _offering(self) -> Cover:
        rows = np.sort(np.concatenate([np.empty(0, np.int64), *self.regions]))
        return self.cover.offering(rows)

    def take_cuts(self, rows: IntArray) -> bool:
        """Add the separators of these rows to the problem; return True if any is new."""
        before = len(self.cuts)
        for cut in self.separating.separators(rows):
            self.cuts.setdefault(cut.tobytes(), cut)
        return len(self.cuts) > before

    @cached_property
    def graph(self) -> LinkGraph:
        """The links, prepared for searches around rows."""
        return LinkGraph(self.links)

    @cached_property
    def separating(self) -> SeparatorSearch:
        return SeparatorSearch(self.cover, self.graph, self.regions)

    @cached_property
    def _region_of(self) -> IntArray:
        """Region of each row, -1 for none (all rows,)."""
        region_of = np.full(self.links.shape[0], -1, dtype=np.int64)
        for number, region in enumerate(self.regions):
            region_of[region] = number
        return region_of

    def parts(self, rows: IntArray) -> int:
        """Surplus components of these rows: those that rows on offer could connect."""
        inside = rows[self._region_of[rows] >= 0]  # no link leads out of a region
        return len(components_of(self.links, inside)) - len(np.unique(self._region_of[inside]))

    def parts_with_each(self, rows: IntArray) -> IntArray:
        """Surplus components of these rows and one more, for each other row (all rows,)."""
        return _parts_with_each(self.graph, self._region_of, rows)

    def among(self, rows: IntArray, others: IntArray) -> Callable[[IntArray], IntArray]:
        """`parts_with_each` for selections of `others` and some of the `rows`, and for each of these rows.

        Each component of the others counts as one row, as no link between them changes. Rows are given by
        their index in `rows`, and so is the result.
        """
        components = components_of(self.links, others[self._region_of[others] >= 0])
        sizes = [len(component) for component in components]
        ends = np.concatenate([np.empty(0, np.int64), *components])
        entries = (np.ones(len(ends), np.int64), (np.repeat(np.arange(len(sizes)), sizes), ends))
        whole = csr_array(entries, shape=(len(sizes), self.links.shape[0]))
        joined = (whole @ self.links.astype(np.int64))[:, rows]
        among = self.links[rows][:, rows].astype(np.int64)
        links = csr_array(block_array([[among, joined.T], [joined, None]]) if sizes else among)
        regions = [self._region_of[component[:1]] for component in components]
        region_of = np.concatenate([self._region_of[rows], *regions])
        graph, fixed = LinkGraph(links), np.arange(len(rows), len(rows) + len(sizes))
        return lambda chosen: _parts_with_each(graph, region_of, np.append(chosen, fixed))[: len(rows)]

    def in_region(self, rows: IntArray, number: int) -> IntArray:
        """Those of the rows that are in the region of this number."""
        return rows[self._region_of[rows] == number]

    def inside(self, rows: IntArray) -> IntArray:
        """1 for each of these rows that is in a region, else 0 (all rows,)."""
        found = np.zeros(self.links.shape[0], dtype=np.int64)
        found[rows] = self._region_of[rows] >= 0
        return found

    def splits(self, row: int, inside: IntArray) -> bool:
        """True if the rows `inside`, connected in each region, were not without this one."""
        if inside[row] == 0:
            return False
        inside[row] = 0
        parts = self.graph.parts_around(self.graph.ends(np.array([row])), inside)
        inside[row] = 1
        return len(parts.whole) + min(1, len(parts.last)) > 1


def connected(
    task: ConnectedCover,
    search: Search,
    *,
    rounds: int,
    patience: int | None = None,
    known: tuple[IntArray, int] | None = None,
) -> tuple[IntArray, int]:
    """Rows that meet every demand and are connected as far as links allow, and a lower bound.

    It begins at `known` rows and their bound, and ends after so many rounds, or before, once `patience` of
    them brought no better rows.
    """
    best, bound = (_by_greedy(task), 0) if known is None else known
    conditions, waited = Conditions(task.cover.rows), 0
    for _ in range(rounds):
        rows, at_least = search(task.problem, best, conditions)
        bound = max(bound, at_least)
        found = connected_rows(task, rows)
        waited = 0 if len(found) < len(best) else waited + 1
        best = found if waited == 0 else best
        if len(best) <= bound or waited == patience or not task.parts(rows):
            break
        if not task.take_cuts(rows) and not conditions.take(task.separating.conditions(rows)):
            break
    return best, bound


def _by_greedy(task: ConnectedCover) -> IntArray:
    """A first connected selection by greedy; the problem keeps the separators found."""
    rows = greedy(task.problem)
    for _ in range(QUICK_ROUNDS):
        if not task.take_cuts(rows):
            break
        rows = greedy(task.problem)
    return connected_rows(task, rows)


def connected_rows(task: ConnectedCover, rows: IntArray) -> IntArray:
    """The rows, with others that connect their components and without superfluous ones."""
    coverage, near_of = RunningCoverage(task.cover, rows), _Neighbours(task.graph)
    for number, region in enumerate(task.regions):
        inside = task.in_region(rows, number)
        while len(found := components_of(task.links, inside)) > 1:
            near = [near_of[one] for one in found]
            more = np.setdiff1d(connecting_rows(task.links, region, found, near, coverage.added_by), inside)
            coverage.add(more)
            inside = np.concatenate([inside, more])
        rows = np.union1d(rows, inside)
    return _without_idle(task, np.unique(rows))


class _Neighbours:
    """Neighbours of components; most components are the same from one look to the next."""

    def __init__(self, graph: LinkGraph) -> None:
        self._graph, self._known = graph, dict[bytes, IntArray]()

    def __getitem__(self, component: IntArray) -> IntArray:
        key = component.tobytes()
        if key not in self._known:
            self._known[key] = self._graph.neighbours(component)
        return self._known[key]


def _without_idle(task: ConnectedCover, rows: IntArray) -> IntArray:
    """The rows without those needed neither for coverage nor for connection."""
    before = len(rows) + 1
    while len(rows) < before:  # a row may be needed only to connect another that is idle
        before = len(rows)
        rows = _without_some_idle(task, rows)
    return rows


def _without_some_idle(task: ConnectedCover, rows: IntArray) -> IntArray:
    """One look at each row, in each region of which the rows are connected.

    Rows without which too little of the whole is covered are needed, and all other rows look less idle then.
    """
    cover, coverage, inside = task.cover, RunningCoverage(task.cover, rows), task.inside(rows)
    alone = np.array([
        int(cover.weight[seen][coverage.covered[seen] <= cover.asks[seen]].sum())
        for seen in map(cover.columns_of, rows.tolist())
    ])  # fmt: skip
    spare = coverage.reached[0] - cover.needed[0]
    order = np.argsort(alone, kind="stable")
    for row in rows[order[alone[order] <= spare]].tolist():
        one = np.array([row])
        if coverage.enough_without(one) and not task.splits(row, inside):
            coverage.remove(one)
            inside[row] = 0
            rows = rows[rows != row]
    return rows


def _parts_with_each(graph: LinkGraph, region_of: IntArray, rows: IntArray) -> IntArray:
    """Surplus components of rows and one more, for each other row (all rows,), by the region of each."""
    inside = rows[region_of[rows] >= 0]
    components, begun = components_of(graph.links, inside), np.unique(region_of[inside])
    met = [np.empty(0, np.int64), *map(graph.neighbours, components)]
    joined = np.bincount(np.concatenate(met), minlength=len(region_of))
    added = np.isin(region_of, begun).astype(np.int64) - joined
    added[region_of < 0] = 0
    added[rows] = 0
    parts: IntArray = len(components) - len(begun) + added
    return parts
