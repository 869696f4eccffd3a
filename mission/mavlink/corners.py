"""Waypoints of a leg: the fewest points that keep the robot near it.

A planned leg goes round a corner in an arc of many short segments. A vehicle may stop at each waypoint, and
it stores only a limited number. So a few corners a little outside the arc replace it, and the lines between
them pass a little inside. The chosen path stays within the allowance with the fewest corners.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stopgo.mission.document import Point
from stopgo.mission.run.route_position import foot

THIN = 0.05
"""Fraction of the allowance that is used to leave out points of nearly straight stretches, for speed."""
OFFSETS = (0.5, 1.0)
"""Distances of a corner outside an arc, as fractions of the rest."""


@dataclass(frozen=True)
class _Corner:
    """A possible corner."""

    at: Point
    along: float
    """Position on the leg: the number of a point, or half a number more for the middle of a segment."""
    off: float
    """Metres from that position."""


def corners(leg: Sequence[Point], *, within: float) -> tuple[Point, ...]:
    """Return the leg's ends, and between them the fewest points whose lines stay within `within` of it.

    No straight line between them is farther than `within` metres from the leg, nor the leg from them, so
    that no corner is cut by more.
    """
    if len(leg) < 3:
        return tuple(leg)
    thin = _thinned(leg, within * THIN)
    rest = within * (1 - THIN)
    return _fewest(thin, tuple(_spots(thin, rest)), rest)


def _thinned(leg: Sequence[Point], within: float) -> list[Point]:
    """Return the leg without the points on the line between those that stay."""
    kept, at = [leg[0]], 0
    while at < len(leg) - 1:
        end = at + 1
        while end + 1 < len(leg) and _away(leg[at + 1 : end + 1], leg[at], leg[end + 1]) <= within:
            end += 1
        kept.append(leg[end])
        at = end
    return kept


def _spots(leg: Sequence[Point], within: float) -> Iterator[_Corner]:
    """Yield the leg's points, points outside its corners, and points next to the middle of inner segments."""
    yield _Corner(leg[0], 0.0, 0.0)
    for k in range(1, len(leg) - 1):
        before, here, after = leg[k - 1 : k + 2]
        yield _Corner(here, float(k), 0.0)
        (ux, uy), (wx, wy) = _direction(before, here), _direction(here, after)
        yield from _beside(here, (ux - wx, uy - wy), float(k), within)
        if k < len(leg) - 2:
            middle = ((here[0] + after[0]) / 2, (here[1] + after[1]) / 2)
            yield from _beside(middle, (-wy, wx), k + 0.5, within)
            yield from _beside(middle, (wy, -wx), k + 0.5, within)
    yield _Corner(leg[-1], float(len(leg) - 1), 0.0)


def _beside(place: Point, towards: Point, along: float, within: float) -> Iterator[_Corner]:
    x, y = _direction((0.0, 0.0), towards)
    if (x, y) != (0.0, 0.0):
        for share in OFFSETS:
            off = share * within
            yield _Corner((place[0] + off * x, place[1] + off * y), along, off)


def _fewest(leg: Sequence[Point], spots: Sequence[_Corner], within: float) -> tuple[Point, ...]:
    """Return the shortest chain of spots from end to end; of several, the one nearest to the leg."""
    best = [(0, 0.0), *[(len(spots), 0.0)] * (len(spots) - 1)]
    before = [0] * len(spots)
    for i in range(len(spots)):
        for j, away in _straight_on(leg, spots, i, within):
            cost = (best[i][0] + 1, best[i][1] + away + spots[j].off)
            if cost < best[j]:
                best[j], before[j] = cost, i
    chain = [len(spots) - 1]
    while chain[-1] != 0:
        chain.append(before[chain[-1]])
    return tuple(spots[i].at for i in reversed(chain))


def _straight_on(
    leg: Sequence[Point], spots: Sequence[_Corner], start: int, within: float
) -> Iterator[tuple[int, float]]:
    """Yield the spots that can be reached on a straight line from one, and their distance from the leg.

    The search ends one segment of the leg beyond the last such spot.
    """
    here = last = spots[start]
    for j in range(start + 1, len(spots)):
        there = spots[j]
        if there.along > last.along + 1:
            return
        away = _away(leg[math.floor(here.along) + 1 : math.ceil(there.along)], here.at, there.at)
        if away <= within:
            last = there
            yield j, away


def _away(points: Sequence[Point], a: Point, b: Point) -> float:
    """Return the distance in metres of the farthest of some points from the segment from `a` to `b`."""
    return max((math.dist(point, foot(a, b, point)) for point in points), default=0.0)


def _direction(a: Point, b: Point) -> Point:
    """Return the unit vector from one point to another; zero if they are the same."""
    length = math.dist(a, b)
    return ((b[0] - a[0]) / length, (b[1] - a[1]) / length) if length > 0 else (0.0, 0.0)
