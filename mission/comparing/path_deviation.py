"""Cross-track error: a robot's signed distance from the legs that it drives, at every pose of a run.

The nearest point of all legs is not enough, because a leg may cross itself or run along another leg. So each
pose is measured to the path that the robot drives at that time, and only forward on this path.

Data
----
`PathFollower`
    Takes events and poses in the order of their times. Two stop numbers say which legs are driven: `_from`,
    the first leg that is not complete, and `_to`, the leg to the stop where the robot drives.
    The number `len(stops)` stands for the return leg.
`_DrivenPath`
    These legs as a row of straight segments. Each segment has its ends, its length, and its distance from
    the beginning of the path. Each has also a cost: the least sum of squared distances (m²) of all poses so
    far, if the newest pose is on this segment. A segment between that has no pose costs `SKIP_COST` per
    metre. The cost is infinite if the robot cannot be there yet.

Events replace the path that is measured:

========================  ===============================================================================
event                     path after the event
========================  ===============================================================================
Started                   the first leg; the robot may begin anywhere on it
Arrived, Settled          the same; the leg to this stop is complete; extended if events are missing
Scanned, Unconfirmed      a new one from this stop to the next
Skipped, never arrived    extended by the next leg, because the robot still drives the skipped stop's leg
Skipped, after Arrived    a new one from this stop to the next
RevisionTaken             with the legs of the new revision; extended while the robot is on an earlier leg
Homing                    the return leg if all stops are done, else the driven legs in reverse
Finished                  empty: errors are NaN from here on
========================  ===============================================================================

Invariants
----------
1. A segment's cost assumes that every earlier pose was on this segment or on one before it.
2. A pose is measured to the segment of least cost at this pose; of equal costs, to the first.
3. Later poses and events never change an error that was returned, so calls may divide the poses anywhere.
4. An extended path keeps the costs of its segments, so the robot keeps its position on it.
5. Only differences of costs count; after each call the least cost is set to 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from stopgo.mission.comparing.comparison import CrossTrack
from stopgo.mission.document import Mission, Point
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.run.events import (
    AnyEvent,
    Arrived,
    Finished,
    Homing,
    RevisionTaken,
    Scanned,
    Settled,
    Skipped,
    Started,
    Unconfirmed,
)
from stopgo.mission.run.run_log import RunLog

SKIP_COST = 1e-3
"""Cost of a metre of path without a pose, in m² of squared distance: enough to decide between segments that
lie on one another, far too little to keep a pose on a segment that it has left."""


def cross_track_of(log: RunLog, missions: Sequence[Mission]) -> CrossTrack:
    """Measure every pose of a logged run, from its start to its end."""
    follower = PathFollower(missions[0])
    poses = log.poses.between(log.began_ns or 0, log.ended_ns or 0)
    revised = {mission.revision: mission for mission in missions}
    measured, at, route = [], 0, []
    for event in log.events:
        behind = int(np.searchsorted(poses.ns, event.robot_ns, side="right"))
        measured.append(follower.measure(poses.xy[at:behind]))
        route.append(follower.begin_m + measured[-1][:, 1])
        at = max(at, behind)
        follower.take(event, revised.get(event.revision))
    measured.append(follower.measure(poses.xy[at:]))
    route.append(follower.begin_m + measured[-1][:, 1])
    table = np.concatenate(measured)
    columns = frozen(table[:, 0]), frozen(table[:, 1]), frozen(np.concatenate(route))
    return CrossTrack(poses.ns, *columns, follower.end_m)


class PathFollower:
    """Follows the driven legs by a run's events, and measures poses against them as they come."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._follow(mission)
        self._from = 0
        self._to = 0
        self._path = _DrivenPath(self._legs(), anywhere=True)
        self.begin_m = 0.0
        """Distance along all legs where the measured path begins; NaN on the way back."""
        self.end_m = 0.0
        """Distance along all legs of the last leg's end that the events report; NaN on the way back."""

    def take(self, event: AnyEvent, revised: Mission | None = None) -> None:
        """Take an event; for a `RevisionTaken`, `revised` is the new mission."""
        if isinstance(event, RevisionTaken) and revised is not None:
            self._follow(revised)
            self._head_for(min(self._to, len(revised.stops)), leaving=self._from >= self._to)
        handler = _HANDLERS.get(type(event))
        if handler is not None:
            handler(self, event)

    def measure(self, xy: FloatArray) -> FloatArray:
        """Return cross-track error and distance along the path (n, 2) of poses (n, 2) in order, metres."""
        return self._path.measure(np.asarray(xy, dtype=np.float64).reshape(-1, 2))

    def _follow(self, mission: Mission) -> None:
        self._mission = mission
        self._number = {stop.id: number for number, stop in enumerate(mission.stops)}
        lengths = (_DrivenPath([stop.approach]).length_m for stop in mission.stops)
        self._route = tuple(accumulate(lengths, initial=0.0))
        """Length of all legs before each leg, and of all."""

    def _start(self, event: Started) -> None:
        self._from = self._to = 0
        self._path = _DrivenPath(self._legs(), anywhere=True)
        self.begin_m = self.end_m = 0.0

    def _arrive(self, event: Any) -> None:
        """Complete the leg to the stop where the robot has arrived."""
        number = self._number.get(event.stop)
        if number is not None and self._from <= number:
            if number > self._to:  # events of the stops between are missing
                self._to = number
                self._path = self._path.extended(self._legs())
            self._from = number + 1
            self.end_m = self._route[self._from]

    def _leave(self, event: Any) -> None:
        """Go on to the next leg after a stop that is done, or that was skipped."""
        number = self._number.get(event.stop)
        if number is None:
            return
        if isinstance(event, Scanned | Unconfirmed):
            self._from = max(self._from, number + 1)
        self._head_for(max(self._to, number + 1), leaving=self._from > number)

    def _head_for(self, number: int, *, leaving: bool) -> None:
        self._to = number
        legs = self._legs()
        self._path = _DrivenPath(legs) if leaving else self._path.extended(legs)
        if leaving:
            self.begin_m = self.end_m = self._route[self._from]

    def _home(self, event: Homing) -> None:
        """Take the return leg if all legs are complete, else the driven legs in reverse."""
        count = len(self._mission.stops)
        if self._mission.return_ is not None and self._from >= count:
            self._path = _DrivenPath([self._mission.return_])
            self.begin_m = self.end_m = self._route[count]
            return
        self.begin_m = self.end_m = math.nan
        legs = [stop.approach for stop in self._mission.stops[: min(self._to, count - 1) + 1]]
        self._path = _DrivenPath([tuple(reversed(leg)) for leg in reversed(legs)], anywhere=True)

    def _legs(self) -> list[tuple[Point, ...]]:
        """Return the legs that are driven now."""
        stops = self._mission.stops
        legs = [stop.approach for stop in stops[self._from : self._to + 1]]
        if self._to >= len(stops) and self._mission.return_ is not None and self._from >= len(stops):
            legs.append(self._mission.return_)
        return legs

    def _end(self, event: AnyEvent) -> None:
        if self._to >= len(self._mission.stops) and self._from >= len(self._mission.stops):
            self.end_m = self.begin_m + self._path.length_m
        self._path = _DrivenPath([])


_HANDLERS: dict[type, Callable[[PathFollower, Any], None]] = {
    Started: PathFollower._start,
    Arrived: PathFollower._arrive,
    Settled: PathFollower._arrive,
    Scanned: PathFollower._leave,
    Unconfirmed: PathFollower._leave,
    Skipped: PathFollower._leave,
    Homing: PathFollower._home,
    Finished: PathFollower._end,
}


@dataclass(eq=False)
class _DrivenPath:
    """The straight segments of the driven path, and the least cost of being on each of them."""

    a: FloatArray
    b: FloatArray
    begin: FloatArray
    cost: FloatArray

    def __init__(self, legs: Iterable[Sequence[Point]], *, anywhere: bool = False) -> None:
        segments = [np.stack([leg[:-1], leg[1:]], axis=1) for leg in map(_distinct, legs) if len(leg) > 1]
        both = np.concatenate(segments) if segments else np.empty((0, 2, 2))
        self.a, self.b = both[:, 0], both[:, 1]
        self.length = np.hypot(*(self.b - self.a).T)
        self.begin = np.concatenate([[0.0], np.cumsum(self.length)])[:-1]
        self.cost = np.full(len(both), 0.0 if anywhere else np.inf)
        self.cost[:1] = 0.0

    @property
    def length_m(self) -> float:
        return float(self.length.sum())

    def extended(self, legs: Iterable[Sequence[Point]]) -> _DrivenPath:
        """Return a path of these legs that keeps the costs of this one's segments."""
        path = _DrivenPath(legs)
        same = min(len(self.cost), len(path.cost))
        path.cost[:same] = self.cost[:same]
        return path

    def measure(self, xy: FloatArray) -> FloatArray:
        """Return cross-track error and distance along the path of poses (n, 2); update the costs."""
        count = len(xy)
        best = np.full(count, np.inf)
        found = np.full((count, 2), np.nan)
        left = np.full(count, np.inf)
        """Least cost of having left an earlier segment after each pose, less the skip cost of its end."""
        left_before = np.inf
        """The same, before the first pose."""
        for k in range(len(self.cost) if count else 0):
            side, along, away = self._project(k, xy)
            square = np.cumsum(away**2)
            enter = np.concatenate([[min(self.cost[k], left_before + SKIP_COST * self.begin[k])], left[:-1]])
            enter[1:] += SKIP_COST * self.begin[k]
            earlier = np.concatenate([[0.0], square[:-1]])
            total = square + np.minimum.accumulate(enter - earlier)
            better = total < best - 1e-12
            best[better] = total[better]
            found[better] = np.stack([side, along], axis=1)[better]
            end = self.begin[k] + self.length[k]
            left_before = min(left_before, self.cost[k] - SKIP_COST * end)
            left = np.minimum(left, total - SKIP_COST * end)
            self.cost[k] = total[-1]
        if count and len(self.cost):
            self.cost -= self.cost.min()
        return found

    def _project(self, k: int, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return signed distance from segment k, distance along the path, and distance of poses (n, 2)."""
        along, to_pose = self.b[k] - self.a[k], xy - self.a[k]
        t = np.clip(to_pose @ along / self.length[k] ** 2, 0.0, 1.0)
        away = np.hypot(*(to_pose - t[:, None] * along).T)
        side = np.copysign(away, along[0] * to_pose[:, 1] - along[1] * to_pose[:, 0])
        return side, self.begin[k] + t * self.length[k], away


def _distinct(leg: Sequence[Point]) -> FloatArray:
    """Return the points of a leg (n, 2) without repeated ones."""
    points = np.asarray(leg, dtype=np.float64).reshape(-1, 2)
    same = np.all(points[1:] == points[:-1], axis=1)
    return points[np.concatenate([[True], ~same])[: len(points)]]
