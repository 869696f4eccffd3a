"""The smallest one-tree of a weighted matrix, by Prim's algorithm; the smallest tree of edges, by Kruskal's.

Plain functions over lists or arrays: the same source runs interpreted and compiled, with the
types of `one_tree_kernel_compiled.pxd`. The longest edge times the number of points is below 2**62, and
weights are no larger than that product, so no sum exceeds 64 bits.
"""

from __future__ import annotations

from typing import Any


def grow(cost: Any, weight: Any, away: Any, parent: Any, degree: Any) -> int:
    """Grow the smallest one-tree where every edge costs its ends' weights more; return its length.

    The tree joins all points but the last, whose two shortest edges are added. Of equal edges the one to the
    lower point comes first.

    Parameters
    ----------
    cost
        The symmetric matrix of lengths, flat (n * n); `weight` (n,).
    away, parent
        Scratch (n,): distance of each open point from the tree, -1 where it is in it, and its nearest point.
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
    away[0] = -1
    parent[0] = -1
    inside = 0
    for _ in range(1, last):
        nearest = -1
        least = 0
        row = inside * n
        for point in range(last):
            if parent[point] < 0:
                continue
            apart = cost[row + point] + weight[inside] + weight[point]
            if apart < away[point]:
                away[point] = apart
                parent[point] = inside
            if nearest < 0 or away[point] < least:
                nearest = point
                least = away[point]
        total += least
        degree[nearest] += 1
        degree[parent[nearest]] += 1
        parent[nearest] = -1
        inside = nearest
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
