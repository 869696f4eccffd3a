"""The smallest one-tree of a weighted matrix, by Prim's algorithm; the smallest tree of edges, by Kruskal's.

Plain functions over lists or arrays: the same source runs interpreted and compiled, with the
types of `one_tree_kernel_compiled.pxd`. The longest edge times the number of points is below 2**62, and
weights are no larger than that product, so no sum exceeds 64 bits.
"""

from __future__ import annotations

from typing import Any


def grow(cost: Any, weight: Any, away: Any, parent: Any, free: Any, degree: Any) -> int:
    """Grow the smallest one-tree where every edge costs its ends' weights more; return its length.

    The tree joins all points but the last, whose two shortest edges are added. Of equal edges the one to the
    lower point comes first.

    Parameters
    ----------
    cost
        The symmetric matrix of lengths, flat (n * n); `weight` (n,).
    away, parent
        Scratch (n,): distance of each point outside the tree from it, and its nearest point in the tree.
    free
        Scratch (n,): the points outside the tree, ascending.
    degree
        Receives the number of edges at each point (n,).
    """
    n = len(weight)
    last = n - 1
    total = 0
    for point in range(n):
        degree[point] = 0
        parent[point] = 0
        away[point] = cost[point] + weight[0] + weight[point]
        free[point] = point + 1
    inside, many = 0, last - 1
    while many > 0:
        at = -1
        least = 0
        row = inside * n
        own = weight[inside]
        for k in range(many):
            point = free[k]
            apart, before, link = cost[row + point] + own + weight[point], away[point], parent[point]
            link = inside if apart < before else link  # without a branch, which takes twice the time
            before = apart if apart < before else before
            away[point], parent[point] = before, link
            if at < 0 or before < least:
                at = k
                least = before
        inside = free[at]
        total += least
        degree[inside] += 1
        degree[parent[inside]] += 1
        many -= 1
        for k in range(at, many):
            free[k] = free[k + 1]
    return total + close(cost, weight, degree)


def close(cost: Any, weight: Any, degree: Any) -> int:
    """Add the last point's two shortest edges; return their length less twice all weights."""
    n = len(weight)
    last = n - 1
    row = last * n
    first, second = 0, 1
    if cost[row + 1] + weight[1] < cost[row] + weight[0]:
        first, second = 1, 0
    for point in range(2, last):
        apart = cost[row + point] + weight[point]
        if apart < cost[row + first] + weight[first]:
            second = first
            first = point
        elif apart < cost[row + second] + weight[second]:
            second = point
    degree[first] += 1
    degree[second] += 1
    degree[last] += 2
    total = cost[row + first] + weight[first] + cost[row + second] + weight[second] + 2 * weight[last]
    for point in range(n):
        total -= 2 * weight[point]
    return total


def join_all(order: Any, a: Any, b: Any, joined: Any, used: Any) -> int:
    """Choose a spanning tree's edges, the first in `order` that join two parts; return their number.

    Parameters
    ----------
    order
        Edges, the shortest first (edges,).
    a, b
        Points at both ends of each edge (edges,).
    joined
        The number of each point (points,); receives, for each, one of those that it is joined with.
    used
        Receives the edges chosen (points,).
    """
    count = 0
    for k in range(len(order)):
        here, there = a[order[k]], b[order[k]]
        while joined[here] != here:
            joined[here] = joined[joined[here]]
            here = joined[here]
        while joined[there] != there:
            joined[there] = joined[joined[there]]
            there = joined[there]
        if here != there:
            joined[here] = there
            used[count] = order[k]
            count += 1
            if count == len(joined) - 1:
                break
    return count
