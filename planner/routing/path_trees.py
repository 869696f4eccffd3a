"""Trees of shortest paths from some nodes of a graph: of equally short paths those over the lowest nodes."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.dijkstra_kernel import grow

NONE = -1
"""Node before a source, and before a node that no path leads to; group of a node that is in none."""


def path_trees(graph: csr_array, sources: IntArray, *, limit: float = np.inf) -> tuple[FloatArray, IntArray]:
    """Lengths of the shortest paths from each source to all nodes, and the node before each (n, nodes).

    `graph` has the positive length of the piece from each node to others (nodes, nodes). Paths longer than
    the limit are not found: their length is infinite.
    """
    group = np.full(graph.shape[0], NONE, dtype=np.int64)
    return trees_to_groups(graph, sources, group, 0, limit=limit)[:2]


def trees_to_groups(
    graph: csr_array, sources: IntArray, group: IntArray, wanted: int, *, limit: float = np.inf
) -> tuple[FloatArray, IntArray, FloatArray]:
    """The same up to the length at which `wanted` groups of nodes are reached, and this length (n,).

    `group` has the number of each node's group, or NONE (nodes,). Where fewer groups can be reached within
    the limit, all paths within it are found.
    """
    kernel = compiled(grow, large=False)
    if kernel is None:
        return _by_scipy(graph, sources, group, wanted, limit)
    pieces = (graph.indptr.astype(np.int64), graph.indices.astype(np.int64), graph.data)
    away = np.full((len(sources), graph.shape[0]), np.inf)
    before = np.full(away.shape, NONE, dtype=np.int64)
    queue, place = (np.zeros(graph.shape[0], dtype=np.int64) for _ in range(2))
    met = np.full(group.max(initial=NONE) + 1, NONE, dtype=np.int64)
    ends = np.array(
        [
            kernel(source, limit, wanted, group, *pieces, away[k], before[k], queue, place, met)
            for k, source in enumerate(sources.tolist())
        ]
    )
    return *_up_to(away, before, ends), ends


def _up_to(away: FloatArray, before: IntArray, ends: FloatArray) -> tuple[FloatArray, IntArray]:
    """The trees without paths longer than these lengths (n,)."""
    far = away > ends[:, None]
    away[far], before[far] = np.inf, NONE
    return away, before


def _by_scipy(
    graph: csr_array, sources: IntArray, group: IntArray, wanted: int, limit: float
) -> tuple[FloatArray, IntArray, FloatArray]:
    """The same by scipy, whose trees depend on the order of its search."""
    away: FloatArray = dijkstra(graph, True, sources, limit=limit)
    before = np.full(away.shape, NONE, dtype=np.int64)
    begin, end = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr)), graph.indices
    for lengths, nodes in zip(away, before, strict=True):
        last = np.flatnonzero((lengths[begin] < lengths[end]) & (lengths[begin] + graph.data == lengths[end]))
        nodes[end[last[::-1]]] = begin[last[::-1]]  # the lowest is written last
    ends = np.full(len(sources), limit)
    members = np.flatnonzero(group >= 0)
    if 0 < wanted <= group.max(initial=NONE) + 1:
        nearest = np.full((len(sources), group.max() + 1), np.inf)
        np.minimum.at(nearest.T, group[members], away[:, members].T)
        ends = np.minimum(ends, np.sort(nearest, axis=1)[:, wanted - 1])
    return *_up_to(away, before, ends), ends
