"""Motion of a differential drive along a polyline: it turns in place at corners and drives straight between.

A straight of length L at speed v and acceleration a takes L/v + v/a when L >= v²/a (trapezoid), else
2·sqrt(L/a) (triangle); a turn takes angle / turn rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose


class Phase(Protocol):
    @property
    def duration(self) -> float: ...

    def at(self, seconds: float) -> tuple[Pose, float]:
        """Pose and speed, `seconds` after the phase began."""


@dataclass(frozen=True)
class Turn:
    """Turning in place by `angle` (radians, counter-clockwise positive)."""

    start: Pose
    angle: float
    rate: float

    @property
    def duration(self) -> float:
        return abs(self.angle) / self.rate

    def at(self, seconds: float) -> tuple[Pose, float]:
        turned = math.copysign(min(abs(self.angle), self.rate * max(0.0, seconds)), self.angle)
        return Pose(x=self.start.x, y=self.start.y, heading=wrapped(self.start.heading + turned)), 0.0


@dataclass(frozen=True)
class Straight:
    """A straight drive from standstill to standstill."""

    start: Pose
    length: float
    speed: float
    acceleration: float

    @property
    def top_speed(self) -> float:
        return min(self.speed, math.sqrt(self.length * self.acceleration))

    @property
    def duration(self) -> float:
        top = self.top_speed
        return self.length / top + top / self.acceleration if top > 0 else 0.0

    def at(self, seconds: float) -> tuple[Pose, float]:
        top, a = self.top_speed, self.acceleration
        ramp, left = top / a, self.duration - seconds
        if left <= 0:
            return ahead(self.start, self.length), 0.0
        if seconds <= ramp:
            return ahead(self.start, a * max(0.0, seconds) ** 2 / 2), a * max(0.0, seconds)
        if left <= ramp:
            return ahead(self.start, self.length - a * left**2 / 2), a * left
        return ahead(self.start, top * (seconds - ramp / 2)), top


@dataclass(frozen=True)
class Brake:
    """Braking from `speed` to standstill."""

    start: Pose
    speed: float
    deceleration: float

    @property
    def duration(self) -> float:
        return self.speed / self.deceleration

    def at(self, seconds: float) -> tuple[Pose, float]:
        t = min(max(0.0, seconds), self.duration)
        run = self.speed * t - self.deceleration * t**2 / 2
        return ahead(self.start, run), self.speed - self.deceleration * t


@dataclass(frozen=True)
class Motion:
    """Phases one after another."""

    start: Pose
    phases: tuple[Phase, ...] = ()

    @property
    def duration(self) -> float:
        return sum(phase.duration for phase in self.phases)

    def at(self, seconds: float) -> tuple[Pose, float]:
        for phase in self.phases:
            if seconds <= phase.duration:
                return phase.at(seconds)
            seconds -= phase.duration
        return (self.phases[-1].at(math.inf) if self.phases else (self.start, 0.0))[0], 0.0


def along(
    start: Pose,
    path: Sequence[Point],
    heading: float | None,
    *,
    speed: float,
    turn_rate: float,
    acceleration: float,
) -> Motion:
    """Return the motion from `start` through the points of `path`, and a final turn to `heading` if given."""
    phases: list[Phase] = []
    at = start
    for x, y in path:
        length = math.hypot(x - at.x, y - at.y)
        if length < 1e-9:
            continue
        turn = Turn(at, wrapped(math.atan2(y - at.y, x - at.x) - at.heading), turn_rate)
        straight = Straight(turn.at(math.inf)[0], length, speed, acceleration)
        phases += [turn, straight]
        at = Pose(x=x, y=y, heading=straight.start.heading)
    if heading is not None:
        phases.append(Turn(at, wrapped(heading - at.heading), turn_rate))
    return Motion(start, tuple(phases))


def ahead(pose: Pose, distance: float) -> Pose:
    """Return the pose `distance` metres straight ahead."""
    return Pose(
        x=pose.x + distance * math.cos(pose.heading),
        y=pose.y + distance * math.sin(pose.heading),
        heading=pose.heading,
    )


def wrapped(angle: float) -> float:
    """Return the angle within [-π, π]."""
    return math.remainder(angle, math.tau)
