"""Times of the paths between all points, in whole microseconds, so that a search can add them exactly.

A heading is the number of microseconds that a turn from +x to it takes, so that turns are differences.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import RobotSpec
from stopgo.mission.document.schedule import turn_time
from stopgo.mission.document.straight_times import straight_times
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import SLACK
from stopgo.planner.routing.leg_kernel import follow
from stopgo.planner.routing.legs import Legs
from stopgo.planner.routing.paths import Paths

MICROSECONDS = 1e6
"""Per second."""
NO_HEADING = -1
"""Heading of a leg without length, and of the point `free`."""
NO_WAY_S = 1e9
"""Seconds between points without a path."""
SOURCES = 128
"""Points whose paths are traced at a time."""
MANY = 300
"""Points from which tracing takes long without a compiled kernel."""


@dataclass(frozen=True, eq=False)
class LegTable:
    """Times of the paths between points, and their first and last headings (points, points)."""

    spent: IntArray
    """Microseconds of a path from rest to rest, with the turns at its own corners."""
    leaving: IntArray
    """Heading at the beginning of a path."""
    arriving: IntArray
    """Heading at the end of a path."""
    whole_turn: int
    """Microseconds of a full turn."""

    @classmethod
    def empty(cls, points: int, robot: RobotSpec) -> LegTable:
        """A table without legs; what is negative is not known yet."""
        none = (np.full((points, points), NO_HEADING, dtype=np.int64) for _ in range(3))
        return cls(*none, whole_turn=_whole_turn(robot))

    def turns(self, a: IntArray, b: IntArray) -> IntArray:
        """Microseconds to turn between headings in the shorter direction; 0 where either is none."""
        apart = np.abs(a - b)
        least: IntArray = np.where((a < 0) | (b < 0), 0, np.minimum(apart, self.whole_turn - apart))
        return least

    def heading(self, radians: float) -> int:
        """A heading in this table's unit."""
        return round(radians / math.tau * self.whole_turn) % self.whole_turn


def leg_table(legs: Legs, robot: RobotSpec) -> LegTable:
    """The table of all paths between the points of `legs`, as `legs.path` has them.

    Paths that a third-party graph finds in a way of its own count as straight: to request each of a million
    would take minutes.
    """
    whole_turn = _whole_turn(robot)
    if legs.are_over_pieces:
        with legs.graph.named_errors():
            seconds, leaving, arriving = _followed(legs.paths, len(legs.points), robot)
    else:
        step = legs.points[None, :, :] - legs.points[:, None, :]
        seconds = straight_times(legs.lengths, speed=robot.speed, acceleration=robot.acceleration)
        leaving = arriving = np.arctan2(step[..., 1], step[..., 0])
    driven = legs.lengths > 0
    seconds = np.where(np.isfinite(legs.lengths), seconds, NO_WAY_S)
    headings = [
        np.rint(angle / math.tau * whole_turn).astype(np.int64) % whole_turn for angle in (leaving, arriving)
    ]
    return LegTable(
        spent=frozen(np.where(driven, np.rint(seconds * MICROSECONDS), 0), np.int64),
        leaving=frozen(np.where(driven, headings[0], NO_HEADING), np.int64),
        arriving=frozen(np.where(driven, headings[1], NO_HEADING), np.int64),
        whole_turn=whole_turn,
    )


def _whole_turn(robot: RobotSpec) -> int:
    return round(2 * turn_time(math.pi, turn_rate=robot.turn_rate) * MICROSECONDS)


def _followed(paths: Paths, points: int, robot: RobotSpec) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Seconds (points, points) of the paths between points, and headings at their beginnings and ends."""
    kernel = compiled(follow, large=points > MANY) or follow
    seconds, leaving, arriving = tables = tuple(np.zeros((points, points)) for _ in range(3))
    x, y = np.ascontiguousarray(paths.xy.T, np.float64)
    for first in range(0, points, SOURCES):
        sources = np.arange(first, min(points, first + SOURCES))
        for source, before in zip(sources.tolist(), paths.before(sources), strict=True):
            kernel(
                source, points, x, y, np.ascontiguousarray(before, np.int32), robot.speed, robot.acceleration,
                robot.turn_rate, SLACK, *(table[source] for table in tables),
            )  # fmt: skip
    for table, other in ((seconds, seconds), (leaving, arriving), (arriving, leaving)):
        low = np.tril_indices(points, -1)
        table[low] = other.T[low] + (0.0 if table is seconds else math.pi)
    return seconds, leaving, arriving
