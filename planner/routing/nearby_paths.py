"""Shortest paths from each point to its nearest points, and bounds on the lengths of all others.

Shortest paths between all pairs of points take time with the square of their number. A short tour hardly
uses a pair of points that are far apart. So the search from a point ends at its `NEAREST` points. Other
lengths are bounded by way of landmarks, points from which paths to all others are known: a path is no
longer than that over a landmark, and no shorter than the difference of the paths from it (Goldberg and
Harrelson, "Computing the shortest path: A* search meets graph theory", SODA 2005).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.side_work import in_halves
from stopgo.planner.routing.dijkstra_kernel import reach
from stopgo.planner.routing.paths import edge_lengths, straightened

NEAREST = 100
"""Points to which paths are found from each point; a count, so that a plan depends on no speed."""
MANY = 500
"""Points from which on two processes search."""
LANDMARKS = 32
ROUNDING = 1e-9
"""Fraction and metres by which bounds are widened, so that they hold in spite of rounding."""
BLOCK = 16
"""Points whose bounds are computed at a time, so that they stay in the processor's cache."""


class NearbyPaths:
    """Shortest paths between the first `points` of the nodes `xy` (n, 2) over straight `edges` (m, 2)."""

    def __init__(
        self,
        xy: FloatArray,
        edges: IntArray,
        points: int,
        *,
        nearest: int = NEAREST,
        landmarks: int = LANDMARKS,
    ) -> None:
        self._xy, self.points = xy, points
        self._search = _PointSearch(edge_lengths(xy, edges), points)
        self._away = self._from_landmarks(landmarks)
        """Metres from each landmark to each point (landmarks, points)."""
        self._pairs = np.empty((0, 2), dtype=np.int64)
        self._lengths = np.empty(0)
        if self.connected:
            self._find_near(min(nearest, points - 1))

    @property
    def connected(self) -> bool:
        """True if a path leads from each point to every other."""
        return bool(np.isfinite(self._away).all())

    def _from_landmarks(self, landmarks: int) -> FloatArray:
        """Distances of all points from the first one, and from each point farthest from all those before."""
        found = [self._search.distances(0)]
        nearest = found[0].copy()
        for _ in range(min(landmarks, self.points) - 1):
            found.append(self._search.distances(int(np.argmax(nearest))))
            np.minimum(nearest, found[-1], out=nearest)
        return np.array(found)

    def _find_near(self, nearest: int) -> None:
        """Search from each point; half of many points are searched from in a process of its own."""

        def found_from(points: Sequence[int]) -> list[tuple[IntArray, FloatArray]]:
            return [self._search.nearest(point, nearest) for point in points]

        found = in_halves(found_from, range(self.points), forked=self.points >= MANY)
        self._others: IntArray = np.array([ends for ends, _ in found])
        self._nearest: FloatArray = np.array([away for _, away in found])
        """Nearest other points of each, and their distances (points, nearest)."""
        begin = np.repeat(np.arange(self.points), [len(ends) for ends, _ in found])
        end = np.concatenate([ends for ends, _ in found])
        self._take(np.stack([begin, end], axis=1), np.concatenate([away for _, away in found]))

    def near_pairs(self, many: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """Pairs (n, 2) of each point with the nearest others, so `many`; their lengths; and how far that is.

        A pair that is in neither direction among them is at least as long as the last of either point.
        """
        many = min(many, self._nearest.shape[1])
        begin, end = np.repeat(np.arange(self.points), many), self._others[:, :many].ravel()
        low, high = np.minimum(begin, end), np.maximum(begin, end)
        pairs, which = np.unique(low * self.points + high, return_inverse=True)
        lengths = np.full(len(pairs), np.inf)
        np.minimum.at(lengths, which, self._nearest[:, :many].ravel())
        ends = np.stack(np.divmod(pairs, self.points), axis=1).astype(np.int64)
        return ends, lengths, self._nearest[:, many - 1]

    def lengths_from(self, point: int) -> FloatArray:
        """Metres from a point to every point (points,)."""
        return self._search.distances(point)

    @property
    def farthest(self) -> float:
        """Metres that no two points are farther apart."""
        return 2 * float(self._away[0].max())

    def learn(self, pairs: IntArray) -> FloatArray:
        """Find the exact lengths of pairs of points (n, 2)."""
        lengths = np.array([self._search.length(a, b) for a, b in pairs.tolist()])
        self._take(pairs, lengths)
        return lengths

    def _take(self, pairs: IntArray, lengths: FloatArray) -> None:
        """Note lengths, those from the lower point of a pair to the higher last, so that these count."""
        self._pairs = np.concatenate([self._pairs, pairs])
        self._lengths = np.concatenate([self._lengths, lengths])
        order = np.argsort(self._pairs[:, 0] < self._pairs[:, 1], kind="stable")
        self._pairs, self._lengths = self._pairs[order], self._lengths[order]

    def at_most(self, order: IntArray | None = None, *, out: FloatArray | None = None) -> FloatArray:
        """Metres between all points (points, points): exact for known pairs, an upper bound for others.

        With an `order`, the points are in this order, and the result is written into `out` if that is given.
        """
        order = np.arange(self.points) if order is None else order
        most = np.empty((self.points, self.points)) if out is None else out
        most[:] = np.inf
        from_landmarks = self._away[:, order]
        for k in range(0, self.points, BLOCK):
            some = most[k : k + BLOCK]
            for away in from_landmarks:
                np.minimum(some, away[k : k + BLOCK, None] + away, out=some)
        return self._with_known(most, order, 1 + ROUNDING, ROUNDING)

    def at_least(self) -> FloatArray:
        """Metres between all points (points, points): exact for known pairs, a lower bound for others."""
        least = np.zeros((self.points, self.points))
        for k in range(0, self.points, BLOCK):
            some = least[k : k + BLOCK]
            for away in self._away:
                np.maximum(some, np.abs(away[k : k + BLOCK, None] - away), out=some)
        return self._with_known(least, np.arange(self.points), 1 - ROUNDING, -ROUNDING)

    def _with_known(self, lengths: FloatArray, order: IntArray, times: float, plus: float) -> FloatArray:
        """Bounds widened by rounding, with the exact lengths in their places; the points are in an order."""
        lengths *= times
        lengths += plus
        np.maximum(lengths, 0.0, out=lengths)
        np.fill_diagonal(lengths, 0.0)
        place = np.argsort(order)
        low, high = place[np.sort(self._pairs, axis=1)].T
        lengths[low, high] = self._lengths
        lengths[high, low] = lengths[low, high]
        return lengths

    def path(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one point to another, both included: the same in both directions."""
        if start > end:
            return frozen(self.path(end, start)[::-1])
        return straightened(self._xy[self._search.nodes(start, end)])

    def keep_paths_to(self, point: int) -> None:
        """Find the paths from all points to one, so that none is searched for later."""
        self._search.keep(point)


class _PointSearch:
    """Dijkstra's search over a graph from one of its points, prepared for many searches."""

    def __init__(self, upper: csr_array, points: int) -> None:
        graph = (upper + upper.T).tocsr()
        n, edges = graph.shape[0], graph.nnz
        self._kernel: Any = compiled(reach, large=True)
        whole, real = np.int64, np.float64
        given = [graph.indptr.astype(whole), graph.indices.astype(whole), graph.data.astype(real)]
        scratch = [np.full(n, -1.0), np.zeros(n, whole), np.zeros(n, whole), np.zeros(n, whole)]
        scratch += [np.zeros(edges + 1), np.zeros(edges + 1, whole), np.zeros(points, whole)]
        arrays: list[Any] = [*given, *scratch, np.zeros(points)]
        if self._kernel is None:
            self._kernel, arrays = reach, [array.tolist() for array in arrays]
        self.points, self._arrays = points, arrays
        self._before, self._found, self._away = arrays[4], arrays[9], arrays[10]
        self._kept: dict[int, Any] = {}
        """By point: the next node of each node on its path to the point."""
        self._place: dict[int, int] = {}
        """Place of each point among those found by the last search."""
        self._source = -1

    def keep(self, target: int) -> None:
        """Find the paths from all points to one, and keep them."""
        self.nearest(target, self.points)
        self._kept[target] = self._before.copy()

    def nearest(self, source: int, wanted: int) -> tuple[IntArray, FloatArray]:
        """The nearest other points of one, fewer where no path leads to so many, and their distances."""
        self._source = -1
        many = self._kernel(source, -1, self.points, wanted, *self._arrays) if wanted else 0
        return np.array(self._found[:many], dtype=np.int64), np.array(self._away[:many], dtype=np.float64)

    def distances(self, source: int) -> FloatArray:
        """Distance of every point (points,); infinite where no path leads."""
        found, lengths = self.nearest(source, self.points)
        away = np.full(self.points, np.inf)
        away[source] = 0.0
        away[found] = lengths
        return away

    def length(self, source: int, target: int) -> float:
        """Length of the shortest path from one point to another."""
        return float(self._away[self._found_at(source, target)])

    def nodes(self, source: int, target: int) -> list[int]:
        """The nodes on the shortest path from one point to another, both included."""
        if target in self._kept:
            return _followed(self._kept[target], source, target)
        self._found_at(source, target)
        return _followed(self._before, target, source)[::-1]

    def _found_at(self, source: int, target: int) -> int:
        """Search up to a point, unless the last search reached it; its place among the points found."""
        if source != self._source or target not in self._place:
            many = self._kernel(source, target, self.points, self.points, *self._arrays)
            self._source, self._place = (
                source,
                dict(zip(map(int, self._found[:many]), range(many), strict=True)),
            )
        if target not in self._place:
            raise ValueError(f"no path from point {source} to point {target}")
        return self._place[target]


def _followed(following: Any, node: int, end: int) -> list[int]:
    """The nodes from one to another, by the node that follows each."""
    nodes = [node]
    while nodes[-1] != end:
        nodes.append(int(following[nodes[-1]]))
    return nodes
