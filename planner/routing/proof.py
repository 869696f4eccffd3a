"""Optimality proof of a tour: a lower bound, and for up to some hundred points the shortest tour.

Few points: all tours are compared. More: branch and bound over the relaxation of Dantzig, Fulkerson and
Johnson (1954), with cuts added during the search. Most: the one-tree bound alone.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.cuts import violated_cuts
from stopgo.planner.routing.relaxation import Relaxation
from stopgo.planner.routing.subsets import best_of_all
from stopgo.planner.routing.tour import canonical, length_of
from stopgo.planner.routing.tour_bound import one_tree_bound, useful_edges

COMPARE_ALL_UP_TO = 12
"""Points up to which all tours are compared."""
BRANCH_UP_TO = 120
"""Points up to which the relaxation is used."""
SOLVE_LIMIT = 400
"""Relaxations solved at most; a count, so that the bound does not depend on speed."""
CLOSE = 1_000
"""Tolerance in nanometres of a tour called optimal: the rounding of a mission."""
WHOLE = 1e-6
"""Tolerance of an edge's value at 0 or 1."""


@dataclass(frozen=True, eq=False)
class Proof:
    """A tour and a lower bound on every tour, both in the matrix's unit."""

    order: IntArray
    length: int
    bound: int

    @property
    def closed(self) -> bool:
        """True if the tour is proved to be the shortest, to within a micrometre."""
        return self.length - self.bound <= CLOSE


def tour_proof(cost: IntArray, order: IntArray, *, improve: bool = True) -> Proof:
    """The tour with a bound, over a symmetric matrix (n, n); if `improve`, a shorter tour if one is found.

    The given tour stays if the search finds another one of the same length.
    """
    length = length_of(cost, order)
    found = _searched(cost, order, length)
    if improve and found.length < length:
        return Proof(canonical(found.order), found.length, found.bound)
    return Proof(order, length, found.bound)


def _searched(cost: IntArray, order: IntArray, length: int) -> Proof:
    n = len(cost)
    if n <= COMPARE_ALL_UP_TO:
        best = best_of_all(cost)
        return Proof(best, length_of(cost, best), length_of(cost, best))
    tree = one_tree_bound(cost, best=length)
    known = Proof(order, length, min(tree.value, length))
    if known.closed or n > BRANCH_UP_TO:
        return known
    edges = np.argwhere(np.triu(useful_edges(tree, best=length)))
    return _branch_and_bound(cost, edges, known)


def _branch_and_bound(cost: IntArray, edges: IntArray, known: Proof) -> Proof:
    """Branch on one edge at a time, the subproblem with the lowest bound first.

    A subproblem is closed when its bound comes within CLOSE of the best tour.
    """
    relaxation = Relaxation(cost, edges, limit=known.length)
    none, all_ = np.zeros(len(edges), dtype=np.int64), np.ones(len(edges), dtype=np.int64)
    heap = [(known.bound, 0, none, all_)]
    done, made = known.length, 0
    while heap and relaxation.solved < SOLVE_LIMIT:
        least, _, low, high = heapq.heappop(heap)
        least, fraction = _bounded(relaxation, low, high, least, known.length)
        whole = np.abs(fraction - 0.5) >= 0.5 - WHOLE
        if whole.all():
            known = _better(cost, edges[fraction > 0.5], known)
        if whole.all() or known.length - least <= CLOSE:
            done = min(done, least)
            continue
        split = int(np.argmin(np.abs(fraction - 0.5)))
        for part in (_fixed(low, high, split, 1), _fixed(low, high, split, 0)):
            made += 1
            heapq.heappush(heap, (least, made, *part))
    return Proof(known.order, known.length, min([known.length, done, *(item[0] for item in heap)]))


def _bounded(
    relaxation: Relaxation, low: IntArray, high: IntArray, least: int, best: int
) -> tuple[int, FloatArray]:
    """A bound on the tours that use each edge from `low` to `high` times, and the relaxed solution."""
    while True:
        fraction = relaxation.solve(low, high)
        least = max(least, relaxation.bound(low, high))
        if best - least <= CLOSE or relaxation.solved >= SOLVE_LIMIT:
            return least, fraction
        cuts = violated_cuts(relaxation.points, relaxation.edges, fraction)
        if not cuts:
            return least, fraction
        for cut in cuts:
            relaxation.add(cut)


def _fixed(low: IntArray, high: IntArray, edge: int, times: int) -> tuple[IntArray, IntArray]:
    """The same limits with one edge forced in or out."""
    low, high = low.copy(), high.copy()
    low[edge] = high[edge] = times
    return low, high


def _better(cost: IntArray, edges: IntArray, known: Proof) -> Proof:
    """The tour made of `edges`, if they form a tour that is shorter than the best one known."""
    if cost[edges[:, 0], edges[:, 1]].sum() >= known.length:
        return known
    import networkx as nx

    graph = nx.Graph(edges.tolist())
    ring = nx.is_connected(graph) and len(graph) == len(cost) and all(d == 2 for _, d in graph.degree)
    if not ring:
        return known
    order = np.array([a for a, _ in nx.find_cycle(graph, 0)], dtype=np.int64)
    length = length_of(cost, order)
    return Proof(order, length, known.bound) if length < known.length else known
