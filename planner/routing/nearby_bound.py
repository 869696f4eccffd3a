"""A lower bound on a tour through many points, from paths between near ones only.

Every other pair (a, b) is at least as long as the farthest near point of either, so as half the sum of both
distances, q_a + q_b. Of all edges with such lengths, those of the point with the least q suffice for a
smallest tree: any other closes a cycle with two of them, and is not shorter than either. So a one-tree
(Held and Karp, 1970) of the edges between near points and those of one point is no longer than that of all
edges, also where every point's edges are changed by its weight. Its cost grows with the points, not their
square.
"""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.one_tree_kernel import join_all
from stopgo.planner.routing.tour import nanometres
from stopgo.planner.routing.tour_bound import highest

NEAREST = 24
"""Near points of each point."""
STEPS = 1_000
"""Most one-trees; a count, so that the bound does not depend on speed."""
WORK = 30_000_000
"""Edges sorted in all one-trees together, so that those of long tours are fewer."""
FIRST_STEP = 1.0
"""First change of a weight, in lengths of half a mean edge.

Of 4 649 stops of an office twice as long a step never reached a higher bound than none.
"""


def nearby_bound(paths: NearbyPaths, last: FloatArray | None, *, best: int) -> int:
    """Lower bound in nanometres on a closed tour over all points; `best` is the length of one.

    `last` are the lengths from one more point to each, metres (points,). Without it the last of the points
    closes the tour.
    """
    tree = _NearTree(paths, last)
    steps = min(STEPS, WORK // tree.edges)
    return highest(tree.at, tree.points + 1, best=best, steps=steps, first_step=FIRST_STEP)[0]


class _NearTree:
    """Smallest one-trees over the edges between near points; the point that closes them comes last."""

    def __init__(self, paths: NearbyPaths, last: FloatArray | None) -> None:
        pairs, lengths, far = paths.near_pairs(NEAREST)
        self.points = len(far) - (last is None)
        own = pairs[:, 1] < self.points
        self._a, self._b = (np.ascontiguousarray(pairs[own, k]) for k in range(2))
        self._length, self._far = nanometres(lengths[own]), nanometres(far[: self.points]) // 2
        row = paths.lengths_from(self.points)[: self.points] if last is None else last
        self._last = nanometres(row)
        self._order = np.argsort(self._length, kind="stable")

    @property
    def edges(self) -> int:
        return len(self._a) + self.points

    def at(self, weight: IntArray) -> tuple[int, IntArray]:
        """Length of the smallest one-tree with these weights (points + 1,); degrees of all points."""
        q = self._far + weight[:-1]
        centre = int(np.argmin(q))
        a = np.concatenate([self._a, np.full(self.points, centre)])
        b = np.concatenate([self._b, np.arange(self.points)])
        cost = np.concatenate([self._length + weight[self._a] + weight[self._b], q + q[centre]])
        used = self._chosen(a, b, cost)
        ends = np.argsort(self._last + weight[:-1], kind="stable")[:2]
        value = cost[used].sum() + (self._last + weight[:-1])[ends].sum() + 2 * weight[-1] - 2 * weight.sum()
        both = np.concatenate([a[used], b[used], ends, [self.points, self.points]])
        return int(value), np.bincount(both, minlength=self.points + 1)

    def _chosen(self, a: IntArray, b: IntArray, cost: IntArray) -> IntArray:
        """Edges of the smallest tree."""
        near = len(self._a)
        self._order = self._order[np.argsort(cost[self._order], kind="stable")]
        added = near + np.argsort(cost[near:], kind="stable")
        place = np.searchsorted(cost[self._order], cost[added], side="right")
        order = np.insert(self._order, place, added)
        joined, used = np.arange(self.points), np.zeros(self.points, dtype=np.int64)
        kernel = compiled(join_all, large=True)
        if kernel is None:
            lists = [array.tolist() for array in (order, a, b, joined, used)]
            return np.array(lists[-1][: join_all(*lists)], dtype=np.int64)
        return used[: kernel(order, a, b, joined, used)]
