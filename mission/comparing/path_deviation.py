"""How far a robot is beside the way it drives: measured along the legs, forward only, as events tell of them.

A leg may pass itself or another one, so the nearest point of all legs tells nothing. The way that is
driven is the legs from the stop where the robot was last to the one it works on; a skipped stop's leg is
part of it, because it is still driven. Poses are laid on the way's straight pieces one after another, none
on a piece before that of an earlier pose, so that the sum of squared distances is least.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.comparing.comparison import Beside
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

SKIPPING = 1e-3
"""What it costs to leave out a metre of the way, in m² of squared distance: enough to decide between pieces
that lie on one another, far too little to keep a pose on a piece that it has left."""


def beside(log: RunLog, missions: Sequence[Mission]) -> Beside:
    """Measure every pose of a run that was logged, from its start to its end."""
    follower = WayFollower(missions[0])
    poses = log.poses.between(log.began_ns or 0, log.ended_ns or 0)
    revised = {mission.revision: mission for mission in missions}
    measured, at = [], 0
    for event in log.events:
        behind = int(np.searchsorted(poses.ns, event.robot_ns, side="right"))
        measured.append(follower.measure(poses.xy[at:behind]))
        at = max(at, behind)
        follower.tell(event, revised.get(event.revision))
    measured.append(follower.measure(poses.xy[at:]))
    table = np.concatenate(measured)
    return Beside(poses.ns, frozen(table[:, 0]), frozen(table[:, 1]))


class WayFollower:
    """Knows from a run's events which legs are driven, and measures poses beside them as they come."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self._follow(mission)
        self._from = 0
        self._to = 0
        self._path = _Path(self._legs(), anywhere=True)

    def tell(self, event: AnyEvent, revised: Mission | None = None) -> None:
        """Take an event, and with a revision that was taken its mission."""
        if isinstance(event, RevisionTaken) and revised is not None:
            self._follow(revised)
            self._head_for(min(self._to, len(revised.stops)), leaving=self._from >= self._to)
        tell = _TOLD.get(type(event))
        if tell is not None:
            tell(self, event)

    def measure(self, xy: FloatArray) -> FloatArray:
        """Of poses (n, 2) in the order of driving: metres beside the way, and along it (n, 2)."""
        return self._path.measure(np.asarray(xy, dtype=np.float64).reshape(-1, 2))

    def _follow(self, mission: Mission) -> None:
        self._mission = mission
        self._number = {stop.id: number for number, stop in enumerate(mission.stops)}

    def _start(self, event: Started) -> None:
        self._from = self._to = 0
        self._path = _Path(self._legs(), anywhere=True)

    def _arrive(self, event: Any) -> None:
        """The robot stands at a stop: the way there is behind, and ends where it stands."""
        number = self._number.get(event.stop)
        if number is not None and self._from <= number:
            if number > self._to:  # nothing was heard of the stops between
                self._to = number
                self._path = self._path.extended(self._legs())
            self._from = number + 1

    def _leave(self, event: Any) -> None:
        """A stop is behind: on by the next leg, or beyond a stop that was never come to."""
        number = self._number.get(event.stop)
        if number is None:
            return
        if isinstance(event, Scanned | Unconfirmed):
            self._from = max(self._from, number + 1)
        self._head_for(max(self._to, number + 1), leaving=self._from > number)

    def _head_for(self, number: int, *, leaving: bool) -> None:
        self._to = number
        legs = self._legs()
        self._path = _Path(legs) if leaving else self._path.extended(legs)

    def _home(self, event: Homing) -> None:
        """By the return where all legs are behind, else back the way it came."""
        count = len(self._mission.stops)
        if self._mission.return_ is not None and self._from >= count:
            self._path = _Path([self._mission.return_])
            return
        legs = [stop.approach for stop in self._mission.stops[: min(self._to, count - 1) + 1]]
        self._path = _Path([tuple(reversed(leg)) for leg in reversed(legs)], anywhere=True)

    def _legs(self) -> list[tuple[Point, ...]]:
        """The legs that are driven now."""
        stops = self._mission.stops
        legs = [stop.approach for stop in stops[self._from : self._to + 1]]
        if self._to >= len(stops) and self._mission.return_ is not None and self._from >= len(stops):
            legs.append(self._mission.return_)
        return legs

    def _end(self, event: AnyEvent) -> None:
        self._path = _Path([])


_TOLD: dict[type, Callable[[WayFollower, Any], None]] = {
    Started: WayFollower._start,
    Arrived: WayFollower._arrive,
    Settled: WayFollower._arrive,
    Scanned: WayFollower._leave,
    Unconfirmed: WayFollower._leave,
    Skipped: WayFollower._leave,
    Homing: WayFollower._home,
    Finished: WayFollower._end,
}


@dataclass(eq=False)
class _Path:
    """The straight pieces of a way, and what it has cost to have come to each of them."""

    a: FloatArray
    b: FloatArray
    begin: FloatArray
    cost: FloatArray

    def __init__(self, legs: Iterable[Sequence[Point]], *, anywhere: bool = False) -> None:
        pieces = [np.stack([leg[:-1], leg[1:]], axis=1) for leg in map(_distinct, legs) if len(leg) > 1]
        both = np.concatenate(pieces) if pieces else np.empty((0, 2, 2))
        self.a, self.b = both[:, 0], both[:, 1]
        self.length = np.hypot(*(self.b - self.a).T)
        self.begin = np.concatenate([[0.0], np.cumsum(self.length)])[:-1]
        self.cost = np.full(len(both), 0.0 if anywhere else np.inf)
        self.cost[:1] = 0.0

    def extended(self, legs: Iterable[Sequence[Point]]) -> _Path:
        """A way that goes on from this one, at the place that was come to."""
        path = _Path(legs)
        kept = min(len(self.cost), len(path.cost))
        path.cost[:kept] = self.cost[:kept]
        return path

    def measure(self, xy: FloatArray) -> FloatArray:
        """Metres beside and along of poses (n, 2), in their order; the way remembers where it was come to."""
        count = len(xy)
        best = np.full(count, np.inf)
        found = np.full((count, 2), np.nan)
        before = np.full(count, np.inf)
        """Least cost of having been on an earlier piece at the pose before."""
        came = np.inf
        for k in range(len(self.cost) if count else 0):
            side, along, away = self._beside(k, xy)
            square = np.cumsum(away**2)
            enter = np.concatenate([[min(self.cost[k], came + SKIPPING * self.begin[k])], before[:-1]])
            enter[1:] += SKIPPING * self.begin[k]
            earlier = np.concatenate([[0.0], square[:-1]])
            total = square + np.minimum.accumulate(enter - earlier)
            better = total < best - 1e-12
            best[better] = total[better]
            found[better] = np.stack([side, along], axis=1)[better]
            left = self.begin[k] + self.length[k]
            came = min(came, self.cost[k] - SKIPPING * left)
            before = np.minimum(before, total - SKIPPING * left)
            self.cost[k] = total[-1]
        if count and len(self.cost):
            self.cost -= self.cost.min()
        return found

    def _beside(self, k: int, xy: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Signed distance from piece k, place along the way, and distance of poses (n, 2)."""
        along, to_pose = self.b[k] - self.a[k], xy - self.a[k]
        t = np.clip(to_pose @ along / self.length[k] ** 2, 0.0, 1.0)
        away = np.hypot(*(to_pose - t[:, None] * along).T)
        side = np.copysign(away, along[0] * to_pose[:, 1] - along[1] * to_pose[:, 0])
        return side, self.begin[k] + t * self.length[k], away


def _distinct(leg: Sequence[Point]) -> FloatArray:
    """The points of a leg (n, 2), none like the one before."""
    points = np.asarray(leg, dtype=np.float64).reshape(-1, 2)
    same = np.all(points[1:] == points[:-1], axis=1)
    return points[np.concatenate([[True], ~same])[: len(points)]]
