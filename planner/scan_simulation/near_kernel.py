"""Points of two clouds near one another, found in buckets of cubes.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
`near_kernel_compiled.pxd`. Points have six coordinates, three of a position and three more. Numbers of
cubes stay below 2**27 for positions within 10 000 km of 0, and their sums with the factors below 2**62.
"""

from __future__ import annotations

from typing import Any

SHIFT = 67108864
"""2**26, added to a cube's numbers along the axes, so that none is negative."""
ALONG_X, ALONG_Y = 73856093, 19349663
"""Factors of a cube's numbers; their sum modulo the number of buckets is its bucket."""
SLACK_M = 1e-6
"""Distance that rounding may displace the border of a cube, at most."""


def mark_near(
    points: Any, first: Any, mask: int, per_metre: float, queries: Any, within: float, query_near: Any,
    point_near: Any,
) -> None:  # fmt: skip
    """Mark the points and queries that lie nearer than `within` to one another.

    Parameters
    ----------
    points
        Coordinates of the points, six each, by ascending bucket (6 n,).
    first
        First point of each bucket, and their end.
    mask
        Number of buckets, a power of two, less 1. Behind them some repeat the first ones.
    per_metre
        Cubes along an edge of 1 m.
    queries
        Coordinates of the queries, six each (6 m,).
    within
        Distance over all six coordinates.
    query_near, point_near
        Zeros (m,) and (n,); receive 1 for queries and points near one another.
    """
    limit, wide = within * within, within + SLACK_M
    for query in range(len(query_near)):
        at = 6 * query
        x0, x1 = cube(queries[at] - wide, per_metre), cube(queries[at] + wide, per_metre)
        y0, y1 = cube(queries[at + 1] - wide, per_metre), cube(queries[at + 1] + wide, per_metre)
        z0, z1 = cube(queries[at + 2] - wide, per_metre), cube(queries[at + 2] + wide, per_metre)
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                bucket = (x * ALONG_X + y * ALONG_Y + z0) & mask
                for point in range(first[bucket], first[bucket + z1 - z0 + 1]):
                    total = 0.0
                    for axis in range(6):
                        away = queries[at + axis] - points[6 * point + axis]
                        total += away * away
                    if total < limit:
                        query_near[query] = point_near[point] = 1


def cube(place: float, per_metre: float) -> int:
    """Number of the cube at a place along an axis."""
    return int(place * per_metre + SHIFT)
