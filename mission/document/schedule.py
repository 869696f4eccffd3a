"""Duration of a mission: a differential drive that stops, turns in place, drives straight, and scans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from stopgo.mission.document import Mission, Point, RobotSpec


@dataclass(frozen=True, eq=False)
class Schedule:
    """Planned duration of a mission, in seconds."""

    drive_s: float
    turn_s: float
    settle_s: float
    scan_s: float
    arrival_s: tuple[float, ...] = ()
    """Planned time of arrival at each stop, from the mission's start."""

    @property
    def total_s(self) -> float:
        return self.drive_s + self.turn_s + self.settle_s + self.scan_s


def schedule(mission: Mission) -> Schedule:
    """Return the times of a mission without failures.

    The robot turns in place at every corner of a leg, and at each stop to the stop's heading. It drives each
    straight segment from rest to rest. The arrival at a stop is the time when the robot is stationary there,
    at its heading, and begins to settle. The return leg ends without a last turn.
    """
    drive_s = turn_s = settle_s = scan_s = 0.0
    heading = mission.start.heading
    arrivals: list[float] = []
    for stop in mission.stops:
        drive, turn, heading = leg_times(stop.approach, heading=heading, robot=mission.robot)
        drive_s += drive
        turn_s += turn + turn_time(stop.heading - heading, turn_rate=mission.robot.turn_rate)
        heading = stop.heading
        arrivals.append(drive_s + turn_s + settle_s + scan_s)
        settle_s += stop.settle_s
        scan_s += stop.scan.duration_s
    drive, turn, _ = leg_times(mission.return_ or (), heading=heading, robot=mission.robot)
    return Schedule(drive_s + drive, turn_s + turn, settle_s, scan_s, tuple(arrivals))


def leg_times(leg: Sequence[Point], *, heading: float, robot: RobotSpec) -> tuple[float, float, float]:
    """Return seconds driving, seconds turning, and the heading at the end of a polyline."""
    drive_s = turn_s = 0.0
    for (x0, y0), (x1, y1) in pairwise(leg):
        length = math.hypot(x1 - x0, y1 - y0)
        if length == 0:
            continue
        direction = math.atan2(y1 - y0, x1 - x0)
        turn_s += turn_time(direction - heading, turn_rate=robot.turn_rate)
        drive_s += straight_time(length, speed=robot.speed, acceleration=robot.acceleration)
        heading = direction
    return drive_s, turn_s, heading


def turn_time(angle: float, *, turn_rate: float) -> float:
    """Return the seconds to turn in place by `angle` radians, the short way round."""
    return abs(math.remainder(angle, math.tau)) / turn_rate


def straight_time(length: float, *, speed: float, acceleration: float) -> float:
    """Return the seconds for `length` metres from rest to rest: trapezoid, or triangle below full speed."""
    if length >= speed**2 / acceleration:
        return length / speed + speed / acceleration
    return 2 * math.sqrt(length / acceleration)
