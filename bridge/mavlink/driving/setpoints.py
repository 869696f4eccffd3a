"""Setpoints for an autopilot in its guided mode: a position, a course or a yaw."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from stopgo.bridge.mavlink.driving.autopilot_telemetry import AutopilotTelemetry
from stopgo.bridge.mavlink.vehicle_link.messages import course_setpoint, position_setpoint, yaw_setpoint
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.document import Point

COURSE_S = 4.0
"""Longest time for which an autopilot follows a course that is not sent again."""
TURNING_M_S = 0.05
"""Least speed of a course for an autopilot that takes its heading from the velocity."""


class Setpoints:
    """Setpoints for one vehicle. Positions are metres north and east of its origin, yaws from north."""

    def __init__(self, peer: Peer, telemetry: AutopilotTelemetry) -> None:
        self._peer = peer
        self._telemetry = telemetry
        self._by_vector = peer.autopilot.driving.courses == "vector"
        self._standing: Point | None = None
        self._course_s = -math.inf

    @property
    def is_driving(self) -> bool:
        """True if the vehicle may still follow a course that it was sent: a standstill ends it."""
        return time.monotonic() - self._course_s < COURSE_S

    def go_to(self, position: Point) -> None:
        """Drive to a position in a straight line."""
        self._peer.send(position_setpoint(self._peer.who, position, **self._height_and_time))

    def keep_course(self, yaw: float, speed: float) -> None:
        """Turn to a yaw and drive along it, backwards if the speed is negative.

        The vehicle keeps a course for `OnboardAutopilot.gives_up_s` at most, unless it is sent again.
        """
        self._course_s = time.monotonic()
        speed = max(speed, TURNING_M_S) if self._by_vector else speed
        velocity = (speed * math.cos(yaw), speed * math.sin(yaw)) if self._by_vector else (speed, 0.0)
        self._peer.send(course_setpoint(self._peer.who, velocity, yaw, **self._height_and_time))

    def halt(self) -> None:
        """Stay at the present position, and neither drive nor turn."""
        if self._by_vector:
            self.go_to(self._telemetry.position())
        else:
            self.keep_course(self._telemetry.yaw(), 0.0)
        self._course_s = -math.inf

    def turn_to(self, yaw: float) -> None:
        """Turn on the spot."""
        self._course_s = time.monotonic()
        self._peer.send(yaw_setpoint(self._peer.who, yaw, **self._height_and_time))

    @contextmanager
    def standing_at(self, position: Point) -> Iterator[None]:
        """Have `repeat` send this position until the block ends; it is the only repeated setpoint."""
        self._standing = position
        try:
            yield
        finally:
            self._standing = None

    def repeat(self) -> None:
        """Send the position of `standing_at` again, if there is one."""
        standing = self._standing
        if standing is not None:
            self.go_to(standing)

    @property
    def _height_and_time(self) -> dict[str, Any]:
        """Fields of every setpoint: the present height, and the time."""
        return {"down": self._telemetry.down(), "now_ms": int(time.monotonic() * 1000)}
