"""Planned drive: poses of a mission over mission time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Mission, Point
from stopgo.mission.document.schedule import straight_time, turn_time
from stopgo.mission.files.mission_text import route_length
from stopgo.mission.geometry import FloatArray

STEP_M = 0.25
"""Greatest distance between two poses of the planned drive, if MOST_POSES are enough for it."""
MOST_POSES = 8000
"""Limit of poses; a longer drive has longer steps."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Poses (n, 3) of x, y, heading at seconds since the mission's start (n,)."""

    seconds: FloatArray
    poses: FloatArray
    leaving_s: FloatArray
    """End of each stop's scan (k,)."""


def planned_drive(mission: Mission) -> Drive:
    """Return the drive that `schedule` times: rotate on the spot, drive straight, settle, scan."""
    timer = _DriveTimer(mission)
    leaving = []
    for stop in mission.stops:
        timer.along(stop.approach)
        timer.turn_to(stop.heading)
        timer.stay(stop.settle_s + stop.scan.duration_s)
        leaving.append(timer.seconds)
    timer.along(mission.return_ or ())
    table = np.array(timer.rows)
    return Drive(table[:, 0], table[:, 1:], np.array(leaving))


class _DriveTimer:
    """Robot that drives through a plan and records a pose after each movement."""

    def __init__(self, mission: Mission) -> None:
        self.robot = mission.robot
        self.seconds = 0.0
        self.x, self.y, self.heading = mission.start.x, mission.start.y, mission.start.heading
        self.step_m = max(STEP_M, route_length(mission) / MOST_POSES)
        self.rows: list[tuple[float, float, float, float]] = []
        self._record_pose()

    def along(self, leg: tuple[Point, ...]) -> None:
        for a, b in pairwise(leg):
            if a != b:
                self.turn_to(math.atan2(b[1] - a[1], b[0] - a[0]))
                self._straight(a, b)

    def turn_to(self, heading: float) -> None:
        self.seconds += turn_time(heading - self.heading, turn_rate=self.robot.turn_rate)
        self.heading = heading
        self._record_pose()

    def stay(self, seconds: float) -> None:
        self.seconds += seconds
        self._record_pose()

    def _straight(self, a: Point, b: Point) -> None:
        """Drive evenly from a to b. Only the time at b is exact, as the robot speeds up and slows down."""
        begin, length = self.seconds, math.dist(a, b)
        duration = straight_time(length, speed=self.robot.speed, acceleration=self.robot.acceleration)
        steps = max(1, math.ceil(length / self.step_m))
        for step in range(1, steps + 1):
            t = step / steps
            self.seconds = begin + t * duration
            self.x, self.y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
            self._record_pose()

    def _record_pose(self) -> None:
        self.rows.append((self.seconds, self.x, self.y, self.heading))
