"""Dijkstra's search from one point of a graph, as far as its nearest points, one other or all points.

Plain functions over lists or arrays: the same source runs interpreted and compiled, with the types of
`dijkstra_kernel_compiled.pxd`. Lengths are floating-point numbers. They are added along each path from its
begin on, in either form, so that both give the same lengths. Node numbers and edges are far below 2**62.

Data, for n nodes, of which the first are the points
----------------------------------------------------
- `first`, `to`, `length`: the edges from each node, `first[a]` to `first[a + 1]`, each in both directions.
- `away`: length of the shortest path known to each node, -1 where there is none. `before`: the node before
  it on this path. `closed`: 1 for each node whose path is final. `touched`: the nodes with a path.
- `key`, `item`: a binary heap of lengths and nodes, the least length first. A node is in it once for every
  path found to it; all but the first that leaves the heap are passed over.
"""

from __future__ import annotations

from typing import Any

MOST = 1e300
"""Metres that no path has."""


def reach(
    source: int, target: int, points: int, wanted: int, first: Any, to: Any, length: Any, away: Any,
    before: Any, closed: Any, touched: Any, key: Any, item: Any, found: Any, found_away: Any,
) -> int:  # fmt: skip
    """Find the nearest points of one, until `wanted` are found or `target` is one of them (-1: none).

    `away` is -1 and `closed` 0 before and after. `found` and `found_away` receive the points, the nearest
    first, and their distances; `before` leads back from each to the source. Return the number of points.
    """
    many, ways = 0, 1
    away[source], before[source], touched[0] = 0.0, -1, source
    size = push(0, 0.0, source, key, item)
    while size > 0:
        size = pop(size, key, item)
        here = item[size]
        if closed[here] == 1:
            continue
        closed[here] = 1
        if here < points and here != source:
            found[many] = here
            found_away[many] = away[here]
            many += 1
            if many == wanted or here == target:
                break
        for edge in range(first[here], first[here + 1]):
            there = to[edge]
            total = away[here] + length[edge]
            if away[there] < 0.0:
                touched[ways] = there
                ways += 1
            elif away[there] <= total:
                continue
            away[there] = total
            before[there] = here
            size = push(size, total, there, key, item)
    forget(ways, touched, away, closed)
    return many


def forget(ways: int, touched: Any, away: Any, closed: Any) -> None:
    """Take back what a search noted of its nodes."""
    for k in range(ways):
        away[touched[k]] = -1.0
        closed[touched[k]] = 0


def push(size: int, value: float, node: int, key: Any, item: Any) -> int:
    """Add a node to the heap of `size`; return its new size."""
    at = size
    while at > 0 and key[(at - 1) // 2] > value:
        key[at], item[at] = key[(at - 1) // 2], item[(at - 1) // 2]
        at = (at - 1) // 2
    key[at], item[at] = value, node
    return size + 1


def pop(size: int, key: Any, item: Any) -> int:
    """Move the node of the least length behind the heap, to the index of its new size; return that size."""
    size -= 1
    value, node = key[size], item[size]
    key[size], item[size] = key[0], item[0]
    at = 0
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and key[below + 1] < key[below]:
            below += 1
        if key[below] >= value:
            break
        key[at], item[at] = key[below], item[below]
        at = below
    if size > 0:
        key[at], item[at] = value, node
    return size


def find_lengths(
    source: int, points: int, first: Any, to: Any, length: Any, away: Any, queue: Any, place: Any
) -> None:
    """Find the lengths of the shortest paths from one point to all points.

    `away`, infinite before, receives them, and upper bounds for other nodes. Each node is once in the heap
    `queue`, at its `place`, and four nodes follow each.
    """
    away[source], queue[0], size, left = 0.0, source, 1, points
    while size > 0 and left > 0:
        here = queue[0]
        size -= 1
        sink(queue[size], size, away, queue, place)
        left -= here < points
        for edge in range(first[here], first[here + 1]):
            there = to[edge]
            total = away[here] + length[edge]
            if total < away[there]:
                if away[there] > MOST:
                    place[there] = size
                    size += 1
                away[there] = total
                rise(there, away, queue, place)


def grow(
    source: int, limit: float, wanted: int, group: Any, first: Any, to: Any, length: Any, away: Any,
    before: Any, queue: Any, place: Any, met: Any,
) -> float:  # fmt: skip
    """Find the shortest paths from one node to all nodes, until `wanted` groups are reached.

    None is longer than the limit. `group` has the group of each node, or -1; `met` has the last source that
    reached each group. `away`, infinite before, receives the lengths, and `before`, -1 before, the node
    before each: of equally short paths the lowest. `queue` and `place` are as in `find_lengths`. Return the
    length up to which all paths are found.
    """
    away[source], queue[0], size = 0.0, source, 1
    while size > 0:
        here = queue[0]
        if group[here] >= 0 and met[group[here]] != source:
            met[group[here]] = source
            wanted -= 1
            if wanted == 0:
                return away[here]
        size -= 1
        sink(queue[size], size, away, queue, place)
        for edge in range(first[here], first[here + 1]):
            there = to[edge]
            total = away[here] + length[edge]
            if total < away[there] and total <= limit:
                if away[there] > MOST:
                    place[there] = size
                    size += 1
                away[there], before[there] = total, here
                rise(there, away, queue, place)
            elif total == away[there] and away[here] < total and here < before[there]:
                before[there] = here
    return limit


def rise(node: int, away: Any, queue: Any, place: Any) -> None:
    """Move a node towards the head of the queue, from its place or the end."""
    at = place[node]
    while at > 0 and away[queue[(at - 1) >> 2]] > away[node]:
        queue[at] = queue[(at - 1) >> 2]
        place[queue[at]] = at
        at = (at - 1) >> 2
    queue[at], place[node] = node, at


def sink(node: int, size: int, away: Any, queue: Any, place: Any) -> None:
    """Put a node in the place of the head of the queue, and move it behind all nearer nodes."""
    at = 0
    while 4 * at + 1 < size:
        best = 4 * at + 1
        for below in range(4 * at + 2, min(4 * at + 5, size)):
            if away[queue[below]] < away[queue[best]]:
                best = below
        if away[queue[best]] >= away[node]:
            break
        queue[at] = queue[best]
        place[queue[at]] = at
        at = best
    queue[at], place[node] = node, at
