"""Which points of a leg must be driven through."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mission.document import Point


def corners(leg: Sequence[Point], *, within: float) -> tuple[Point, ...]:
    """The leg's ends, and the points between them without which it would be left by more than `within`.

    Straight lines between the points that stay run nowhere farther than `within` metres from the leg, so a
    corner is never cut by more.
    """
    if not leg:
        return ()
    kept, at = [leg[0]], 0
    while at < len(leg) - 1:
        at = _reach(leg, at, within)
        kept.append(leg[at])
    return tuple(kept)


def _reach(leg: Sequence[Point], at: int, within: float) -> int:
    """The farthest point that can be driven to straight from `at`, all points between staying near."""
    end = at + 1
    while end + 1 < len(leg) and all(
        _distance(point, leg[at], leg[end + 1]) <= within for point in leg[at + 1 : end + 1]
    ):
        end += 1
    return end


def _distance(point: Point, a: Point, b: Point) -> float:
    """Metres from a point to the segment from `a` to `b`."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    if length == 0:
        return math.dist(point, a)
    along = ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / length
    along = min(1.0, max(0.0, along))
    return math.dist(point, (a[0] + along * dx, a[1] + along * dy))
