"""A proven lower bound on a tour's length: Held and Karp's one-tree bound (Operations Research, 1970)."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from mission.geometry import FloatArray

STEPS = 200
"""Subgradient steps; a count, so that the bound does not depend on speed."""
EXACT_UP_TO = 11
"""Points for which all tours are compared (dynamic programming)."""


def tour_bound(lengths: FloatArray, *, best: float) -> float:
    """No closed tour over the symmetric matrix (n, n) is shorter; `best` is a tour's length, to steer by."""
    n = len(lengths)
    if n <= 3:
        return best
    return min(best, _optimum(lengths)) if n <= EXACT_UP_TO else _one_tree_bound(lengths, best)


def _optimum(lengths: FloatArray) -> float:
    """Length of the shortest tour, by dynamic programming over subsets (Held and Karp, 1962)."""
    n = len(lengths) - 1
    reach = np.full((1 << n, n), np.inf)
    for k in range(n):
        reach[1 << k, k] = lengths[n, k]
    for subset in range(1, 1 << n):
        for last in range(n):
            if np.isfinite(reach[subset, last]):
                for then in range(n):
                    if not subset >> then & 1:
                        new = subset | 1 << then
                        reach[new, then] = min(reach[new, then], reach[subset, last] + lengths[last, then])
    return float(np.min(reach[-1] + lengths[n, :n]))


def _one_tree_bound(lengths: FloatArray, best: float) -> float:
    """Raise the cost of points that a smallest one-tree uses too often, lower it where too seldom."""
    n = len(lengths)
    weight, bound = np.zeros(n), -np.inf
    step = 1.0
    for _ in range(STEPS):
        value, degree = _one_tree(lengths, weight)
        bound = max(bound, value)
        off = degree - 2
        if not off.any() or step < 1e-6:
            break
        weight = weight + step * max(best - value, 1e-3) / float(off @ off) * off
        step *= 0.97
    return min(bound, best)


def _one_tree(lengths: FloatArray, weight: FloatArray) -> tuple[float, FloatArray]:
    """Cost and point degrees of a smallest spanning tree plus the two shortest edges of the last point."""
    costs = lengths + weight[:, None] + weight[None, :]
    shift = 1.0 - min(0.0, float(costs.min()))  # the sparse solver takes only positive edges
    n = len(lengths)
    tree = minimum_spanning_tree(np.triu(costs[:-1, :-1] + shift, 1)).tocoo()
    ends = np.argsort(costs[-1, :-1], kind="stable")[:2]
    degree = np.bincount(np.concatenate([tree.row, tree.col, ends, [n - 1, n - 1]]), minlength=n)
    value = float(tree.data.sum()) - shift * (n - 2) + float(costs[-1, ends].sum()) - 2 * float(weight.sum())
    return value, degree.astype(float)
