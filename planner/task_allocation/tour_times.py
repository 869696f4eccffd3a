"""Duration of tours over some of the stops, counted as in `stopgo.mission.document.schedule`.

Points are the stops, in the order of the selection, and after them the starts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.schedule import leg_times
from stopgo.mission.document.specs import robot_of
from stopgo.mission.document.straight_times import straight_times
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import NavigableSpace, Selection
from stopgo.planner.routing import ALL_PAIRS_UP_TO, legs_between
from stopgo.planner.routing.leg_table import MICROSECONDS, LegTable
from stopgo.planner.routing.legs import Legs
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.roadmap import nearby_paths_between
from stopgo.planner.task_allocation.turn_shares import turn_shares

Tour = tuple[int, ...]
"""Stops in the order of driving."""

NEAR = 150
"""Nearest points of each point to which corners of paths are counted in advance."""
ROWS = 256
"""Points whose paths are timed as straight ones at a time."""
DETOURS_UP_TO = 500
"""Points up to which lower bounds allow for detours; this takes time with the cube of their number."""


@dataclass(frozen=True, eq=False)
class TourTimes:
    """Times of tours from the starts (points `stops` and up).

    Times are counted in whole microseconds, and headings too: those of turning from +x. Sums are therefore
    the same on every machine.
    """

    legs: Legs | NearbyPaths
    points: FloatArray
    stops: int
    robot: RobotSpec
    pause_s: float
    """Settling and scanning at a stop."""
    heading: FloatArray
    """Heading of the scan at each stop; empty if scans keep the heading of arrival."""
    start_heading: tuple[float, ...]
    """In radians."""
    closed: bool

    @cached_property
    def _table(self) -> LegTable:
        """The legs timed so far, as they are driven: another path, as short, may have other corners."""
        return LegTable.empty(len(self.points), self.robot)

    @cached_property
    def lengths(self) -> FloatArray:
        """Metres of every path (n, n); of many points lower bounds, but between near ones."""
        legs = self.legs
        return legs.lengths if isinstance(legs, Legs) else frozen(legs.at_least())

    @property
    def starts(self) -> range:
        return range(self.stops, len(self.points))

    def seconds(self, tour: Sequence[int], start: int = 0) -> float:
        """Seconds of a tour from the start of this number, and back to it if tours are closed."""
        return float(self.seconds_of([tour], start)[0])

    def seconds_of(self, tours: Sequence[Sequence[int]], start: int = 0) -> FloatArray:
        """Seconds (tours,) of tours over the same number of stops each."""
        stops = np.array(tours, dtype=np.int64).reshape(len(tours), -1)
        ends = np.full((len(stops), 1), self.stops + start)
        line = np.concatenate([ends, stops, ends] if self.closed else [ends, stops], axis=1)
        a, b = line[:, :-1], line[:, 1:]
        self._time_legs(a, b)
        spent = self._table.spent[a, b].sum(axis=1) + self._turned(a, b, start)
        seconds: FloatArray = spent / MICROSECONDS + stops.shape[1] * self.pause_s
        return seconds

    def _turned(self, a: IntArray, b: IntArray, start: int) -> IntArray:
        """Microseconds (tours,) of turning into legs and to the headings of scans."""
        leaving, arriving = self._table.leaving[a, b], self._table.arriving[a, b]
        first = np.full((len(a), 1), self._table.heading(self.start_heading[start]))
        if not len(self.heading):
            before = _last_known(np.concatenate([first, arriving[:, :-1]], axis=1))
            return self._table.turns(before, leaving).sum(axis=1)
        before = np.concatenate([first, self._scanned[a[:, 1:]]], axis=1)
        come = np.where(arriving < 0, before, arriving)
        scanned = self._table.turns(come, self._scanned[np.minimum(b, self.stops - 1)]) * (b < self.stops)
        return self._table.turns(before, leaving).sum(axis=1) + scanned.sum(axis=1)

    @cached_property
    def _scanned(self) -> IntArray:
        """Heading of the scan at each stop, counted as others are."""
        return np.array([self._table.heading(heading) for heading in self.heading.tolist()], dtype=np.int64)

    def _time_legs(self, a: IntArray, b: IntArray) -> None:
        """Time the legs from `a` to `b` that were not timed before."""
        unknown = self._table.spent[a, b] < 0
        if unknown.any():
            pairs = np.unique(np.sort(np.stack([a[unknown], b[unknown]], axis=1), axis=1), axis=0)
            away = self.lengths[tuple(pairs.T)]
            for k in np.lexsort((-away, pairs[:, 0])).tolist():  # the farthest first: one search finds all
                self._time_leg(*pairs[k].tolist())

    def _time_leg(self, a: int, b: int) -> None:
        """Time a leg from rest to rest, with its headings; in the other direction it takes as long."""
        line = self.legs.path(a, b)
        steps = np.diff(line, axis=0)
        steps = steps[np.any(steps != 0, axis=1)]
        table = self._table
        spent, leaving, arriving = table.spent, table.leaving, table.arriving
        if not len(steps):
            spent[a, b] = spent[b, a] = 0
            return
        first, last = (math.atan2(y, x) for x, y in (steps[0], steps[-1]))
        drive, turn, _ = leg_times([(x, y) for x, y in line.tolist()], heading=first, robot=self.robot)
        spent[a, b] = spent[b, a] = round((drive + turn) * MICROSECONDS)
        leaving[a, b], arriving[a, b] = table.heading(first), table.heading(last)
        leaving[b, a], arriving[b, a] = table.heading(last + math.pi), table.heading(first + math.pi)

    @cached_property
    def least(self) -> FloatArray:
        """Lower bounds in seconds (n, n) on every path; of few points no detour is shorter than these.

        Where corners were not counted, a path takes at least as long as a straight one of its length.
        """
        if len(self.points) > DETOURS_UP_TO:
            return self._driven_s
        times = np.array(self._driven_s)
        for k in range(len(times)):
            times = np.minimum(times, times[:, k, None] + times[None, k, :])
        return frozen(times)

    @cached_property
    def likely(self) -> FloatArray:
        """About the seconds (n, n) of every path, for a search; of many points upper bounds for far ones."""
        if isinstance(self.legs, Legs):
            return self.least
        times = self._straight_s(self.legs.at_most())
        times[self._counted] = self._driven_s[self._counted]
        return frozen(times)

    def _straight_s(self, lengths: FloatArray) -> FloatArray:
        """Seconds of straight paths, some rows at a time: of thousands of points each table is large."""
        speed, acceleration = self.robot.speed, self.robot.acceleration
        times = np.empty_like(lengths)
        for k in range(0, len(lengths), ROWS):
            some = straight_times(lengths[k : k + ROWS], speed=speed, acceleration=acceleration)
            times[k : k + ROWS] = some
        return times

    @cached_property
    def _driven_s(self) -> FloatArray:
        """Seconds (n, n) of paths from rest to rest, without turns at their ends.

        Corners are counted only on paths to the nearest points and to the starts.
        """
        times = self._straight_s(self.lengths)
        a, b = np.nonzero(self._counted)
        self._time_legs(a, b)
        times[a, b] = self._table.spent[a, b] / MICROSECONDS
        return frozen(times)

    @property
    def turned_s(self) -> FloatArray:
        """Lower bounds in seconds (n, n) on paths, with their shares of the turns at both ends.

        The turn at a stop takes at least the sum of the shares of the two legs that a tour uses there. A
        start has no shares. Legs whose corners were not counted may leave in any direction, so that their
        share is the negative of the largest other one.
        """
        shares = self._shares
        turned = shares + shares.T
        turned += self._driven_s
        return frozen(turned)

    @property
    def largest_share_s(self) -> FloatArray:
        """The largest share in seconds of any leg at each stop (stops,)."""
        return np.maximum(0.0, self._shares[: self.stops].max(axis=1))

    @cached_property
    def _shares(self) -> FloatArray:
        """Seconds (n, n) of turning at the first point that count for the leg to the second."""
        _ = self._driven_s  # which times the legs counted
        shares = np.zeros((len(self.points), len(self.points)))
        for stop in range(self.stops):
            near = np.flatnonzero(self._counted[stop] & (self._table.leaving[stop] >= 0))
            near = near[np.argsort(self.lengths[stop, near], kind="stable")]
            away = self._table.leaving[stop, near] / MICROSECONDS * self.robot.turn_rate
            scan = float(self.heading[stop]) if len(self.heading) else None
            found = turn_shares(away, turn_rate=self.robot.turn_rate, scan=scan)
            shares[stop] = -found.max(initial=0.0)
            shares[stop, near] = found
        return frozen(shares)

    def estimate(self, turning: float) -> FloatArray:
        """Seconds (n, n) of every path, and of a fraction of half a turn before it."""
        turn = turning * math.pi / self.robot.turn_rate
        times = self._driven_s if isinstance(self.legs, Legs) else self.likely
        return frozen(np.where(self.lengths > 0, times + turn, 0.0))

    @cached_property
    def _counted(self) -> BoolArray:
        """True (n, n) between points if corners of the path are counted: the nearest ones, and starts."""
        counted = np.zeros(self.lengths.shape, dtype=bool)
        if isinstance(self.legs, Legs):
            near = np.argsort(self.lengths, axis=1, kind="stable")[:, 1 : NEAR + 1]
            counted[np.arange(len(self.points))[:, None], near] = True
        else:
            counted[tuple(self.legs.near_pairs(NEAR)[0].T)] = True
        counted[:, self.stops :] = True
        counted |= counted.T
        np.fill_diagonal(counted, False)
        return frozen(counted, np.bool_)


def tour_times(
    selection: Selection, starts: FloatArray, headings: tuple[float, ...], *, closed: bool
) -> TourTimes:
    """Times of tours over the chosen stops from starts (n, 2)."""
    candidates = selection.candidates
    settings = candidates.settings
    points = np.concatenate([selection.xy, starts])
    rows = candidates.kept[selection.chosen]
    heading = candidates.heading[rows] if len(candidates.heading) else np.empty(0)
    return TourTimes(
        legs=_legs(candidates.space, points, len(selection.chosen)),
        points=frozen(points),
        stops=len(selection.chosen),
        robot=robot_of(settings),
        pause_s=settings.settle + settings.scan_time,
        heading=frozen(heading),
        start_heading=headings,
        closed=closed,
    )


def _legs(space: NavigableSpace, points: FloatArray, stops: int) -> Legs | NearbyPaths:
    """The paths between points, the starts after the stops; of many points those between near ones."""
    if len(points) <= ALL_PAIRS_UP_TO or space.settings.graph != "exact":
        return legs_between(space, points, trees=True)
    paths = nearby_paths_between(space, points)
    for start in range(stops, len(points)):
        paths.keep_paths_to(start)
    return paths


def _last_known(headings: IntArray) -> IntArray:
    """The headings (tours, legs), each that is missing replaced by the one before it; the first is known."""
    known = np.where(headings >= 0, np.arange(headings.shape[1]), 0)
    found: IntArray = np.take_along_axis(headings, np.maximum.accumulate(known, axis=1), axis=1)
    return found
