"""A lower bound on a tour's length from smallest one-trees, and the edges that a shorter tour may use.

Held and Karp, "The traveling-salesman problem and minimum spanning trees", Operations Research 1970;
steps that shrink to nothing, after Volgenant and Jonker, EJOR 1982. Weights are whole numbers like the
lengths, so a one-tree's value is exact, however its weights were found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.one_tree_kernel import grow

STEPS = 300
"""One-trees computed for few points; a count, so that the bound does not depend on speed."""
FEW = 120
"""Points up to which branch and bound goes on from the bound."""
WORK = 1_000_000_000
"""Edges examined in all one-trees of more points, so that those of long tours are fewer."""
MOST_STEPS = 3_000
"""One-trees of more points."""
FIRST_STEP = 2.0
"""First change of a weight, in lengths of half a mean edge, for a point that is used once too often.

Tours into corridors and back need weights of several edges: at 0.5 the bound of 300 such stops is 2.7 %
lower, at 8 that of 1 000 is 4 % lower. Of stops in four far clusters the bound is 78 to 100 % of the route.
With steps in proportion to the gap, halved without a gain, it was 68 to 90 %.
"""
MEMORY = 0.3
"""Share of the previous direction in each step's direction."""
NEVER = np.iinfo(np.int64).max
"""Cost of an edge that must not be used."""


@dataclass(frozen=True, eq=False)
class OneTree:
    """A smallest spanning tree of all points but the last, and the last point's two shortest edges."""

    value: int
    """No closed tour is shorter."""
    degree: IntArray
    costs: IntArray
    """Lengths plus the weights of both ends (n, n)."""
    before: IntArray
    """Parent in the tree of each point of `reached` (n - 1,)."""
    reached: IntArray
    """Points 0 to n - 2 in the order in which the tree reached them (n - 1,)."""


def one_tree_bound(cost: IntArray, *, best: int) -> OneTree:
    """The one-tree of the highest value found; a tour of the length `best` ends the search."""
    n = len(cost)
    steps = STEPS if n <= FEW else min(MOST_STEPS, WORK // n**2)
    _, weight = highest(growing(cost), n, best=best, steps=steps)
    return one_tree(cost, weight)


def highest(
    tree_at: Callable[[IntArray], tuple[int, IntArray]],
    points: int,
    *,
    best: int,
    steps: int,
    first_step: float = FIRST_STEP,
    start: IntArray | None = None,
) -> tuple[int, IntArray]:
    """The highest value found of one-trees at weights of the points, and these weights (points,).

    The search begins at the weights `start`, else at none.

    The weight of a point rises if a one-tree uses the point too often, and falls if too seldom, by steps
    that shrink to nothing with the square of those that are left. Every tour changes by the same amount, so
    that the value less that amount remains a bound.
    """
    top = np.zeros(points, dtype=np.int64) if start is None else start
    weight, before = top.astype(float), np.zeros(points)
    value, degree = tree_at(top)
    most, longest = value, first_step * max(value, 1) / (2 * points)
    for k in range(steps):
        off = (degree - 2).astype(float)
        if not off.any() or most >= best:
            break
        direction = (1 - MEMORY) * off + MEMORY * before if k else off
        weight += longest * (1 - k / steps) ** 2 * direction
        before = off
        rounded = np.rint(weight).astype(np.int64)
        value, degree = tree_at(rounded)
        if value > most:
            most, top = value, rounded
    return most, top


def growing(cost: IntArray) -> Callable[[IntArray], tuple[int, IntArray]]:
    """The value of the smallest one-tree at given weights, and the degrees of its points (n,)."""
    n = len(cost)
    kernel = compiled(grow, large=n > FEW)
    if kernel is None:
        return lambda weight: _told(one_tree(cost, weight))
    flat, scratch = np.ascontiguousarray(cost).ravel(), np.zeros((3, n), dtype=np.int64)

    def grown(weight: IntArray) -> tuple[int, IntArray]:
        degree = np.empty(n, dtype=np.int64)
        return kernel(flat, weight, *scratch, degree), degree

    return grown


def _told(tree: OneTree) -> tuple[int, IntArray]:
    return tree.value, tree.degree


def one_tree(cost: IntArray, weight: IntArray) -> OneTree:
    """The smallest one-tree where every edge costs its ends' weights more (Prim's algorithm)."""
    costs = cost + weight[:, None]
    costs += weight[None, :]
    n = len(cost)
    away, parent = costs[0, :-1].copy(), np.zeros(n - 1, dtype=np.int64)
    reached = np.zeros(n - 1, dtype=np.int64)
    away[0] = NEVER
    open_ = np.ones(n - 1, dtype=bool)
    open_[0] = False
    for k in range(1, n - 1):
        point = int(np.argmin(away))
        reached[k] = point
        open_[point] = False
        row = costs[point, :-1]
        nearer = open_ & (row < away)
        away[nearer] = row[nearer]
        parent[nearer] = point
        away[point] = NEVER
    before = parent[reached]
    ends = np.argsort(costs[-1, :-1], kind="stable")[:2]
    value = costs[reached[1:], before[1:]].sum() + costs[-1, ends].sum() - 2 * weight.sum()
    used = np.concatenate([reached[1:], before[1:], ends, [n - 1, n - 1]])
    return OneTree(int(value), np.bincount(used, minlength=n), costs, before, reached)


def useful_edges(tree: OneTree, *, best: int) -> BoolArray:
    """True for edges (n, n) that a tour no longer than `best` may use.

    A one-tree forced to use an edge gains that edge and loses the longest edge of the cycle it closes
    (Volgenant and Jonker 1983).
    """
    n = len(tree.costs)
    longest = np.full((n - 1, n - 1), -(2**62))
    for k in range(1, n - 1):
        point, on = tree.reached[k], tree.before[k]
        so_far = tree.reached[:k]
        longest[point, so_far] = np.maximum(longest[on, so_far], tree.costs[point, on])
        longest[so_far, point] = longest[point, so_far]
    second = np.sort(tree.costs[-1, :-1])[1]
    spare = best - tree.value
    useful = np.zeros((n, n), dtype=bool)
    useful[:-1, :-1] = tree.costs[:-1, :-1] - longest <= spare
    useful[-1, :-1] = useful[:-1, -1] = tree.costs[-1, :-1] - second <= spare
    np.fill_diagonal(useful, False)
    return useful
