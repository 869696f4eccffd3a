"""What no plan over the candidates takes less than, whichever stops it chooses and however it drives.

Every plan has a stop in each zone. Of its k stops keep one for each of m zones and leave the others out: the
route that is left drives from zone to zone, each time at least as long as the quickest way between any two of
their candidates, so no less than a shortest tour over the zones.

Leaving a stop out can make a way slower: who stops at a corner anyway need not stop there to turn. Ways are
therefore counted as at most so many seconds (`DETOURS`) slower than the quickest way over any candidates, and
as much is taken off for each of the k - m stops. What a leg takes beyond its length at full speed, from rest
to rest, is counted once for each leg, and a pause once for each stop. With k the fewest stops there can be
this holds for every plan: a further stop adds its pause, and takes off less than that.

For the tour over the zones Held and Karp's bound is taken. Turns at stops are not counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.schedule import straight_time
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.covering_tour.zones import Zone
from stopgo.planner.routing import Ends, far_edge, tour_matrix
from stopgo.planner.routing.tour import NANOMETRES, best_of_all, length_of, nanometres
from stopgo.planner.routing.tour_bound import one_tree_bound

APART_M = (0.0, 1.0, 3.0, 6.0)
"""How far zones are from one another at least, of several sets of them; the set that proves most counts."""
DETOURS = (4.0, 0.0, 2.0, 8.0, 16.0, 32.0)
"""Seconds; the one that proves most counts. With the first, sets of zones are compared."""
ROUNDING_M = 4e-6
"""Metres by which a leg of a mission, whose points are rounded, may be shorter than it was planned."""
ROUNDING_RAD = 1e-4
"""Radians by which it may turn less."""
STEP_S = 1e-4
"""Detours are compared in whole steps, rounded down."""
MOST_POINTS = 1600
"""Points up to which detours are looked for; beyond, ways are counted by their length alone."""


@dataclass(frozen=True, eq=False)
class RouteAsked:
    """What a route must do, over points: places that may be stops, then its start and its end."""

    lengths: FloatArray
    """(points, points) in metres."""
    seconds: FloatArray
    """From rest to rest, without turns at the ends."""
    offered: IntArray
    """Points where there may be a stop."""
    zones: Sequence[Zone]
    """Points of which every route has one, those that count first."""
    start: int | None
    end: int | None
    closed: bool
    stops: int
    """There are never fewer."""
    pause_s: float
    robot: RobotSpec

    @property
    def outer(self) -> list[int]:
        """Start and end, as far as they are given."""
        return [end for end in (self.start, self.end) if end is not None]


def least_time(asked: RouteAsked) -> float:
    """Seconds below which no such route is."""
    between = _beyond_length(asked, asked.offered)
    outside = {end: _beyond_length(asked, np.array([end])) for end in asked.outer}
    ways = _Ways(asked, between, outside)
    alone = _Alone(asked, between, outside)
    sets = [_kept(asked, apart) for apart in APART_M]
    found = [_by_zones(asked, ways, alone, zones, DETOURS[0]) for zones in sets]
    best = sets[int(np.argmax(found))]
    return max(*found, *(_by_zones(asked, ways, alone, best, detour) for detour in DETOURS[1:]))


class _Alone:
    """What stops and the begin of each leg take by themselves."""

    def __init__(self, asked: RouteAsked, between: float, outside: dict[int, float]) -> None:
        self._asked, self.between = asked, between
        self._legs = [outside[end] for end in asked.outer]
        if asked.closed and asked.start is not None:
            self._legs.append(outside[asked.start])

    def seconds(self, stops: int) -> float:
        """Of so many stops with their legs, less what rounding may take off."""
        robot = self._asked.robot
        legs = stops - 1 + (self._asked.closed and self._asked.start is None and stops > 1)
        rounding = ROUNDING_M / robot.speed + ROUNDING_RAD / robot.turn_rate
        whole = stops * self._asked.pause_s + legs * self.between + sum(self._legs)
        return whole - (legs + len(self._legs)) * rounding


def _beyond_length(asked: RouteAsked, ends: IntArray) -> float:
    """Seconds that a leg from one of these points takes at least beyond its length at full speed."""
    away = asked.lengths[np.ix_(ends, asked.offered)].copy()
    away[ends[:, None] == asked.offered[None, :]] = np.inf
    nearest = max(0.0, float(away.min(initial=np.inf)) - ROUNDING_M)
    robot = asked.robot
    if not np.isfinite(nearest):
        return 0.0
    beyond = (
        straight_time(nearest, speed=robot.speed, acceleration=robot.acceleration) - nearest / robot.speed
    )
    return max(0.0, beyond)


class _Ways:
    """Seconds of ways at full speed, with their corners; and of the quickest detours."""

    def __init__(self, asked: RouteAsked, between: float, outside: dict[int, float]) -> None:
        driven = asked.lengths / asked.robot.speed
        begin = np.full(len(driven), between)
        begin[list(outside)] = list(outside.values())
        self._direct = np.maximum(asked.seconds - np.minimum(begin[:, None], begin[None, :]), 0.0)
        np.fill_diagonal(self._direct, 0.0)
        self._detour = driven if len(driven) > MOST_POINTS else _quickest(self._direct)

    def up_to(self, detour: float) -> FloatArray:
        """As they are, where they are at most so much longer than the quickest detour."""
        ways: FloatArray = np.minimum(self._direct, self._detour + detour)
        np.fill_diagonal(ways, 0.0)
        return ways


def _quickest(direct: FloatArray) -> FloatArray:
    """Floyd's algorithm, in whole numbers."""
    steps = np.minimum(direct / STEP_S, 2**30).astype(np.int32)
    for k in range(len(steps)):
        np.minimum(steps, steps[:, k, None] + steps[None, k, :], out=steps)
    return np.multiply(steps, STEP_S, dtype=np.float64)


def _by_zones(asked: RouteAsked, ways: _Ways, alone: _Alone, zones: list[IntArray], detour: float) -> float:
    """The bound by these zones and this detour."""
    if detour > asked.pause_s + alone.between:
        return 0.0  # a stop more might pay
    apart = len(zones) - len(asked.outer)
    stops = max(asked.stops, apart)
    driven = _tour_over(asked, zones, ways.up_to(detour)) - (stops - apart) * detour
    return alone.seconds(stops) + max(0.0, driven)


def _tour_over(asked: RouteAsked, zones: list[IntArray], seconds: FloatArray) -> float:
    """Seconds below which no tour over the zones is, ends included."""
    if len(zones) < 2:
        return 0.0
    between = np.array([seconds[zone].min(axis=0) for zone in zones])
    between = np.array([between[:, zone].min(axis=1) for zone in zones])
    np.fill_diagonal(between, 0.0)
    between = np.minimum(between, between.T)
    first = None if asked.start is None else 0
    last = None if asked.end is None else len(asked.outer) - 1
    ends = Ends(first, last, asked.closed, "")
    cost = nanometres(tour_matrix(between, ends))
    return max(0.0, _least_tour(cost) / NANOMETRES - far_edge(between, ends))


def _least_tour(cost: IntArray) -> int:
    """What no closed tour over the points is shorter than, as cost is counted."""
    if len(cost) <= 9:
        return length_of(cost, best_of_all(cost))
    away, order = cost.copy(), [0]
    for _ in range(len(cost) - 1):
        away[:, order[-1]] = np.iinfo(np.int64).max
        order.append(int(np.argmin(away[order[-1]])))
    return one_tree_bound(cost, best=length_of(cost, np.array(order))).value


def _kept(asked: RouteAsked, apart: float) -> list[IntArray]:
    """Start and end, and zones, the first ones first, each so far from all before it."""
    kept = [np.array([end]) for end in asked.outer]
    near = [asked.lengths[points].min(axis=0) for points in kept]
    for zone in asked.zones:
        away = min((float(its[zone.rows].min()) for its in near), default=np.inf)
        if away > apart:
            kept.append(zone.rows)
            near.append(asked.lengths[zone.rows].min(axis=0))
    return kept
