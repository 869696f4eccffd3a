"""Shortest paths between points over a graph of straight pieces, by Dijkstra's algorithm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.shapes import SLACK
from stopgo.planner.geometry.side_work import in_halves
from stopgo.planner.routing.dijkstra_kernel import find_lengths
from stopgo.planner.routing.path_trees import path_trees

NodeArray = NDArray[np.int32]
"""Numbers of nodes, of which very many are kept."""
CHUNK = 256
"""Points whose distances to all nodes are in memory at a time."""
MANY = 20_000_000
"""Pieces in all searches together from which on two processes search."""
FEW = 3
"""Paths from a point that are searched one by one; a route has two at each point."""
ROUNDING, WIDER = 1e-9, 1e-6
"""Fractions, and metres, by which a path may be longer than its length, and farther from its ends."""
MOST_KEPT = 32_000_000
"""Nodes of all the trees of paths that are kept, 128 MB."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Shortest paths between given points."""

    xy: FloatArray
    """Node positions in the drawing's coordinates; the points come first."""
    lengths: FloatArray
    """(points, points) in metres; infinite where there is no path."""
    graph: csr_array
    """(nodes, nodes): lengths of the straight pieces."""
    limit: float = np.inf
    """Metres beyond which paths were not searched."""
    _trees: dict[int, NodeArray] = field(default_factory=dict)
    """By point: the node before each node (nodes,), if it is kept."""
    _asked: dict[int, int] = field(default_factory=dict)
    """By point: how many paths were searched from it, one by one."""

    def path(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one point to another, both included."""
        tree = self._tree(start)
        nodes = self._nodes_between(start, end) if tree is None else _followed(tree, start, end)
        if not len(nodes):
            raise ValueError(f"no path from point {start} to point {end}")
        return straightened(self.xy[nodes])

    def _tree(self, start: int) -> NodeArray | None:
        """The node before each node on its shortest path from `start` (nodes,), if many paths begin there."""
        kept = self._trees.get(start)
        if kept is None:
            self._asked[start] = self._asked.get(start, 0) + 1
            if self._asked[start] > FEW and len(self.xy) * (len(self._trees) + 1) <= MOST_KEPT:
                kept = self._trees[start] = self._found_before(np.array([start]))[0]
        return kept

    def _nodes_between(self, start: int, end: int) -> IntArray:
        """The nodes on the shortest path between two points; none if there is no path of its length.

        None of them is farther from both points together than the path is long. A third-party graph may have
        other lengths, and then all nodes are searched.
        """
        length = float(self.lengths[start, end])
        apart = sum(np.hypot(*(self.xy - self.xy[point]).T) for point in (start, end))
        near = np.union1d(np.flatnonzero(apart <= length * (1 + WIDER) + WIDER), [start, end])
        for nodes in (near, np.arange(len(self.xy))):
            own = self._both_ways[nodes][:, nodes]
            first, last = np.searchsorted(nodes, (start, end)).tolist()
            limit = length * (1 + ROUNDING) + ROUNDING
            before = path_trees(own, np.array([first]), limit=limit)[1].astype(np.int32)
            if len(path := _followed(before[0], first, last)):
                break
        return nodes[path]

    @cached_property
    def _both_ways(self) -> csr_array:
        """The graph with each piece in both directions, those to higher nodes first, as scipy takes them."""
        back = self.graph.T.tocsr()
        first = self.graph.indptr + back.indptr
        ahead, many = ranges(first[:-1], np.diff(self.graph.indptr)), first[-1]
        after = np.delete(np.arange(many), ahead)
        to, length = np.empty(many, dtype=first.dtype), np.empty(many)
        for place, half in ((ahead, self.graph), (after, back)):
            to[place], length[place] = half.indices, half.data
        return csr_array((length, to, first), shape=self.graph.shape)

    def before(self, points: IntArray) -> NodeArray:
        """The node before each node on its shortest path from each of these points (n, nodes)."""
        kept = [self._trees.get(point) for point in points.tolist()]
        return self._found_before(points) if any(tree is None for tree in kept) else np.array(kept)

    def _found_before(self, points: IntArray) -> NodeArray:
        return path_trees(self._both_ways, points, limit=self.limit)[1].astype(np.int32)

    way = path  # its name in 0.1; ends with 0.3


def _followed(before: NodeArray, start: int, end: int) -> IntArray:
    """The nodes from one to another, by the node before each; none if no path leads there."""
    nodes = [end]
    while nodes[-1] != start:
        if before[nodes[-1]] < 0:
            return np.empty(0, dtype=np.int64)
        nodes.append(int(before[nodes[-1]]))
    return np.array(nodes[::-1])


def straightened(line: FloatArray) -> FloatArray:
    """A polyline (n, 2) without points on its straight pieces, at which the robot would stop."""
    if len(line) < 2 or np.all(line == line[0]):
        return frozen(line[:1])
    simple = shapely.simplify(shapely.LineString(line - line[0]), SLACK, preserve_topology=False)
    inner = shapely.get_coordinates(simple)[1:-1] + line[0]
    return frozen(np.concatenate([line[:1], inner, line[-1:]]))


def shortest_paths(
    xy: FloatArray, edges: IntArray, points: int, *, trees: bool = False, limit: float = np.inf
) -> Paths:
    """Shortest paths between the first `points` of the nodes `xy` (n, 2) over straight `edges` (m, 2).

    With `trees` what leads to each node is kept, if there is room for it. Paths longer than the limit, in
    metres, are not found.
    """
    graph = edge_lengths(xy, edges)
    found = Paths(frozen(xy), np.empty((0, 0)), graph, limit=limit)
    if not trees or points * len(xy) > MOST_KEPT:
        return replace(found, lengths=frozen(_lengths(graph, points, limit)))
    lengths = np.empty((points, points))
    for chunk in np.split(np.arange(points), range(CHUNK, points, CHUNK)):
        away, before = path_trees(found._both_ways, chunk, limit=limit)
        found._trees.update(zip(chunk.tolist(), before.astype(np.int32), strict=True))
        lengths[chunk] = away[:, :points]
    return replace(found, lengths=frozen(lengths))


def _lengths(graph: csr_array, points: int, limit: float) -> FloatArray:
    """Lengths of the paths between the first points (points, points); a second process finds half of many."""
    kernel = compiled(find_lengths, large=False)
    if kernel is None or np.isfinite(limit):
        chunks = np.split(np.arange(points), range(CHUNK, points, CHUNK))
        return np.concatenate([dijkstra(graph, False, chunk, limit=limit)[:, :points] for chunk in chunks])
    both = (graph + graph.T).tocsr()
    pieces = (both.indptr.astype(np.int64), both.indices.astype(np.int64), both.data)

    def found_from(sources: Sequence[int]) -> list[FloatArray]:
        lengths, away = np.empty((len(sources), points)), np.empty(graph.shape[0])
        queue, place = (np.zeros(len(away), dtype=np.int64) for _ in range(2))
        for k, source in enumerate(sources):
            away[:] = np.inf
            kernel(source, points, *pieces, away, queue, place)
            lengths[k] = away[:points]
        return [lengths]

    return np.concatenate(in_halves(found_from, range(points), forked=points * graph.nnz >= MANY))


def edge_lengths(xy: FloatArray, edges: IntArray) -> csr_array:
    """Lengths of straight edges (m, 2) between nodes (n, 2), each once, from the lower node to the higher."""
    low, high = edges.min(axis=1), edges.max(axis=1)
    key = np.unique(low[low < high] * len(xy) + high[low < high])
    pair = np.stack([key // len(xy), key % len(xy)], axis=1)
    length = np.hypot(*(xy[pair[:, 0]] - xy[pair[:, 1]]).T)
    # a length of exactly 0 would mean "no edge" to the sparse solver
    return csr_array((np.maximum(length, 1e-12), (pair[:, 0], pair[:, 1])), shape=(len(xy),) * 2)
