"""Lower bound on the time of every plan over the candidates, for any choice of stops and any route.

Every plan has a stop in each zone. Of its k stops keep one for each of m zones and remove the others. The
remaining route drives from zone to zone. Each drive takes at least the quickest path between any two of
their candidates, so the route takes at least as long as a shortest tour over the zones.

Removing a stop can make a path slower: a robot that scans at a corner need not stop there to turn. Paths
therefore count as at most so many seconds (`DETOURS`) slower than the quickest path over any candidates, and
as much is subtracted for each of the k - m stops. The time of a leg above its length at full speed, from rest
to rest, counts once per leg, and a pause once per stop. With k the lower bound on the number of stops
this holds for every plan: one more stop adds its pause and subtracts less than that.

The tour over the zones uses Held and Karp's bound. Turns at stops do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.schedule import straight_time
from stopgo.mission.document.straight_times import straight_times
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.covering_tour.zones import Zone
from stopgo.planner.routing import Ends, far_edge, tour_matrix
from stopgo.planner.routing.assemble import ROUNDING_M, ROUNDING_RAD
from stopgo.planner.routing.tour import NANOMETRES, best_of_all, length_of, nanometres
from stopgo.planner.routing.tour_bound import one_tree_bound

APART_M = (0.0, 1.0, 3.0, 6.0)
"""Least distances between zones, one per set of zones; the set with the highest bound counts."""
DETOURS = (4.0, 0.0, 2.0, 8.0, 16.0, 32.0)
"""Allowed detours in seconds; the one with the highest bound counts. The first compares sets of zones."""
STEP_S = 1e-4
"""Step in seconds to which detours are rounded down."""
MOST_POINTS = 1600
"""Points up to which detours are searched; beyond, paths count by their length alone."""


@dataclass(frozen=True, eq=False)
class RouteRequirements:
    """Requirements on a route, over points: possible stops, then its start and its end."""

    lengths: FloatArray
    """(points, points) in metres."""
    seconds: FloatArray | None
    """Seconds from rest to rest, without turns at the ends (points, points); None: of straight paths."""
    offered: IntArray
    """Points where there may be a stop."""
    zones: Sequence[Zone]
    """Sets of points of which every route has one, the most important first."""
    start: int | None
    end: int | None
    closed: bool
    stops: int
    """Lower bound on the number of stops."""
    pause_s: float
    robot: RobotSpec

    @property
    def outer(self) -> list[int]:
        """Start and end, if they are given."""
        return [end for end in (self.start, self.end) if end is not None]


def least_time(route: RouteRequirements) -> float:
    """Lower bound in seconds on such a route."""
    between = _beyond_length(route, route.offered)
    outside = {end: _beyond_length(route, np.array([end])) for end in route.outer}
    paths = _PathTimes(route, between, outside)
    alone = _StopTimes(route, between, outside)
    sets = [_zones_apart(route, apart) for apart in APART_M]
    found = [_by_zones(route, paths, alone, zones, DETOURS[0]) for zones in sets]
    best = sets[int(np.argmax(found))]
    return max(*found, *(_by_zones(route, paths, alone, best, detour) for detour in DETOURS[1:]))


class _StopTimes:
    """Time of the stops and of the acceleration in each leg, without the drive between them."""

    def __init__(self, route: RouteRequirements, between: float, outside: dict[int, float]) -> None:
        self._route, self.between = route, between
        self._legs = [outside[end] for end in route.outer]
        if route.closed and route.start is not None:
            self._legs.append(outside[route.start])

    def seconds(self, stops: int) -> float:
        """Seconds of so many stops with their legs, less the effect of rounding."""
        robot = self._route.robot
        legs = stops - 1 + (self._route.closed and self._route.start is None and stops > 1)
        rounding = ROUNDING_M / robot.speed + ROUNDING_RAD / robot.turn_rate
        whole = stops * self._route.pause_s + legs * self.between + sum(self._legs)
        return whole - (legs + len(self._legs)) * rounding


def _beyond_length(route: RouteRequirements, ends: IntArray) -> float:
    """Least seconds of a leg from one of these points above its length at full speed."""
    others = (route.lengths[end, route.offered[route.offered != end]] for end in ends)
    least = min((float(away.min(initial=np.inf)) for away in others), default=np.inf)
    nearest = max(0.0, least - ROUNDING_M)
    robot = route.robot
    if not np.isfinite(nearest):
        return 0.0
    beyond = (
        straight_time(nearest, speed=robot.speed, acceleration=robot.acceleration) - nearest / robot.speed
    )
    return max(0.0, beyond)


class _PathTimes:
    """Seconds of paths at full speed, with their corners; and of the quickest detours.

    Of very many points only the asked rows are computed, as a whole matrix is a large part of the memory.
    """

    def __init__(self, route: RouteRequirements, between: float, outside: dict[int, float]) -> None:
        self._route = route
        self._begin = np.full(len(route.lengths), between)
        self._begin[list(outside)] = list(outside.values())
        few = len(route.lengths) <= MOST_POINTS
        self._quickest = _quickest(self._direct(np.arange(len(route.lengths)))) if few else None
        self._zones: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def _direct(self, points: IntArray) -> FloatArray:
        """Seconds of the paths from these points, without a detour (points, all points)."""
        route, robot = self._route, self._route.robot
        if route.seconds is None:
            lengths = route.lengths[points]
            spent = straight_times(lengths, speed=robot.speed, acceleration=robot.acceleration)
        else:
            spent = route.seconds[points]
        direct = np.maximum(spent - np.minimum(self._begin[points, None], self._begin), 0.0)
        direct[np.arange(len(points)), points] = 0.0
        return direct

    def up_to(self, detour: float, zone: IntArray) -> FloatArray:
        """The least direct times from a zone to all points, at most `detour` above the quickest detour."""
        direct, around = self._from_zone(zone)
        paths = np.minimum(direct, around + detour)
        paths[zone] = 0.0
        return paths

    def _from_zone(self, zone: IntArray) -> tuple[FloatArray, FloatArray]:
        """Least direct times, and least times of detours, from the points of a zone to all (points,)."""
        key = zone.tobytes()
        if key not in self._zones:
            if self._quickest is None:
                around = self._route.lengths[zone] / self._route.robot.speed
            else:
                around = self._quickest[zone]
            self._zones[key] = self._direct(zone).min(axis=0), around.min(axis=0)
        return self._zones[key]


def _quickest(direct: FloatArray) -> FloatArray:
    """Floyd's algorithm, in whole numbers."""
    steps = np.minimum(direct / STEP_S, 2**30).astype(np.int32)
    around = np.empty_like(steps)
    for k in range(len(steps)):
        np.add(steps[:, k, None], steps[None, k, :], out=around)
        np.minimum(steps, around, out=steps)
    return np.multiply(steps, STEP_S, dtype=np.float64)


def _by_zones(
    route: RouteRequirements, paths: _PathTimes, alone: _StopTimes, zones: list[IntArray], detour: float
) -> float:
    """The bound by these zones and this detour."""
    if detour > route.pause_s + alone.between:
        return 0.0  # one more stop might save time
    apart = len(zones) - len(route.outer)
    stops = max(route.stops, apart)
    driven = _tour_over(route, zones, lambda zone: paths.up_to(detour, zone)) - (stops - apart) * detour
    return alone.seconds(stops) + max(0.0, driven)


def _tour_over(
    route: RouteRequirements, zones: list[IntArray], seconds: Callable[[IntArray], FloatArray]
) -> float:
    """Lower bound in seconds on a tour over the zones, ends included; `seconds` are from a zone to all."""
    if len(zones) < 2:
        return 0.0
    between = np.array([seconds(zone) for zone in zones])
    between = np.array([between[:, zone].min(axis=1) for zone in zones])
    np.fill_diagonal(between, 0.0)
    between = np.minimum(between, between.T)
    first = None if route.start is None else 0
    last = None if route.end is None else len(route.outer) - 1
    ends = Ends(first, last, route.closed, "")
    cost = nanometres(tour_matrix(between, ends))
    return max(0.0, _least_tour(cost) / NANOMETRES - far_edge(between, ends))


def _least_tour(cost: IntArray) -> int:
    """Lower bound on a closed tour over the points, in the unit of `cost`."""
    if len(cost) <= 9:
        return length_of(cost, best_of_all(cost))
    away, order = cost.copy(), [0]
    for _ in range(len(cost) - 1):
        away[:, order[-1]] = np.iinfo(np.int64).max
        order.append(int(np.argmin(away[order[-1]])))
    return one_tree_bound(cost, best=length_of(cost, np.array(order))).value


def _zones_apart(route: RouteRequirements, apart: float) -> list[IntArray]:
    """Start, end, and zones in their order, each farther than `apart` from all before it."""
    zones = [np.array([end]) for end in route.outer]
    near = [route.lengths[points].min(axis=0) for points in zones]
    for zone in route.zones:
        away = min((float(its[zone.rows].min()) for its in near), default=np.inf)
        if away > apart:
            zones.append(zone.rows)
            near.append(route.lengths[zone.rows].min(axis=0))
    return zones
