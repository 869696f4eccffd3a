"""Duration of tours over some of the stops, counted as in `stopgo.mission.document.schedule`.

Points are the stops, in the order of the selection, and after them the starts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.schedule import leg_times, turn_time
from stopgo.mission.document.specs import robot_of
from stopgo.mission.document.straight_times import straight_times
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import Selection
from stopgo.planner.routing import legs_between
from stopgo.planner.routing.legs import Legs

Tour = tuple[int, ...]
"""Stops in the order of driving."""

NEAR = 30
"""Nearest points of each point to which corners of paths are counted in advance."""


@dataclass(frozen=True)
class LegFacts:
    """A path between two points: seconds from rest to rest, and the headings at its ends.

    A path without length has no headings.
    """

    seconds: float
    ends: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class TourTimes:
    """Times of tours from the starts (points `stops` and up)."""

    legs: Legs
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
    _facts: dict[tuple[int, int], LegFacts] = field(default_factory=dict)
    """Cache by points."""

    @property
    def starts(self) -> range:
        return range(self.stops, len(self.points))

    def seconds(self, tour: Sequence[int], start: int = 0) -> float:
        """Seconds of a tour from the start of this number, and back to it if tours are closed."""
        heading = self.start_heading[start]
        here, total = self.stops + start, len(tour) * self.pause_s
        for stop in tour:
            spent, heading = self._driven(here, stop, heading)
            total += spent
            if len(self.heading):
                wanted = float(self.heading[stop])
                total += self._turn(wanted, heading)
                heading = wanted
            here = stop
        return total + (self._driven(here, self.stops + start, heading)[0] if self.closed else 0.0)

    def _driven(self, a: int, b: int, heading: float) -> tuple[float, float]:
        """Seconds to turn into a leg and drive it, and the heading at its end."""
        facts = self.facts(a, b)
        if facts.ends is None:
            return 0.0, heading
        return facts.seconds + self._turn(facts.ends[0], heading), facts.ends[1]

    def _turn(self, wanted: float, heading: float) -> float:
        return turn_time(wanted - heading, turn_rate=self.robot.turn_rate)

    def facts(self, a: int, b: int) -> LegFacts:
        """The path from point a to point b."""
        if (a, b) not in self._facts:
            self._facts[a, b] = self._facts_of(self.line(a, b))
        return self._facts[a, b]

    def line(self, a: int, b: int) -> FloatArray:
        """The polyline (n, 2) from point a to point b: the same in both directions."""
        line = self.legs.path(min(a, b), max(a, b))
        return line if a <= b else frozen(line[::-1])

    def _facts_of(self, line: FloatArray) -> LegFacts:
        steps = np.diff(line, axis=0)
        steps = steps[np.any(steps != 0, axis=1)]
        if not len(steps):
            return LegFacts(0.0, None)
        first, last = (math.atan2(y, x) for x, y in (steps[0], steps[-1]))
        drive, turn, _ = leg_times([(x, y) for x, y in line.tolist()], heading=first, robot=self.robot)
        return LegFacts(drive + turn, (first, last))

    @cached_property
    def least(self) -> FloatArray:
        """Lower bounds in seconds (n, n) on every path, for which no detour is shorter.

        Where corners were not counted, a path takes at least as long as a straight one of its length.
        """
        times = np.array(self._driven_s)
        for k in range(len(times)):
            times = np.minimum(times, times[:, k, None] + times[None, k, :])
        return frozen(times)

    @cached_property
    def _driven_s(self) -> FloatArray:
        """Seconds (n, n) of paths from rest to rest, without turns at their ends.

        Corners are counted only on paths to the nearest points and to the starts.
        """
        speed, acceleration = self.robot.speed, self.robot.acceleration
        times = straight_times(self.legs.lengths, speed=speed, acceleration=acceleration)
        for a, near in enumerate(self._near()):
            for b in (*near.tolist(), *self.starts):
                if a != b:
                    times[a, b] = times[b, a] = self.facts(min(a, b), max(a, b)).seconds
        return frozen(times)

    def estimate(self, turning: float) -> FloatArray:
        """Seconds (n, n) of every path, and of a fraction of half a turn before it."""
        turn = turning * math.pi / self.robot.turn_rate
        return frozen(np.where(self.legs.lengths > 0, self._driven_s + turn, 0.0))

    def _near(self) -> IntArray:
        return np.argsort(self.legs.lengths, axis=1, kind="stable")[:, 1 : NEAR + 1]


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
        legs=legs_between(candidates.space, points),
        points=frozen(points),
        stops=len(selection.chosen),
        robot=robot_of(settings),
        pause_s=settings.settle + settings.scan_time,
        heading=frozen(heading),
        start_heading=headings,
        closed=closed,
    )
