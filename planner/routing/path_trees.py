"""Trees of shortest paths from some nodes of a graph: of equally short paths those over the lowest nodes."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.dijkstra_kernel import grow

NONE = -1
"""Node before a source, and before a node that no path leads to."""


def path_trees(graph: csr_array, sources: IntArray, *, limit: float = np.inf) -> tuple[FloatArray, IntArray]:
    """Lengths of the shortest paths from each source to all nodes, and the node before each (n, nodes).

    `graph` has the positive length of the piece from each node to others (nodes, nodes). Paths longer than
    the limit are not found: their length is infinite.
    """
    kernel = compiled(grow, large=False)
    if kernel is None:
        return _by_scipy(graph, sources, limit)
    pieces = (graph.indptr.astype(np.int64), graph.indices.astype(np.int64), graph.data)
    away = np.full((len(sources), graph.shape[0]), np.inf)
    before = np.full(away.shape, NONE, dtype=np.int64)
    queue, place = (np.zeros(graph.shape[0], dtype=np.int64) for _ in range(2))
    for k, source in enumerate(sources.tolist()):
        kernel(source, limit, *pieces, away[k], before[k], queue, place)
    return away, before


def _by_scipy(graph: csr_array, sources: IntArray, limit: float) -> tuple[FloatArray, IntArray]:
    """The same by scipy, whose trees depend on the order of its search."""
    away: FloatArray = dijkstra(graph, True, sources, limit=limit)
    before = np.full(away.shape, NONE, dtype=np.int64)
    begin, end = np.repeat(np.arange(graph.shape[0]), np.diff(graph.indptr)), graph.indices
    for lengths, nodes in zip(away, before, strict=True):
        last = np.flatnonzero(np.isfinite(lengths[begin]) & (lengths[begin] + graph.data == lengths[end]))
        nodes[end[last[::-1]]] = begin[last[::-1]]  # the lowest is written last
    return away, before
