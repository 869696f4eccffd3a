"""The vehicle led from outside: to places and headings that a station tells, one after another."""

from __future__ import annotations

from bridge.link.clock import Clock
from bridge.mavlink.simulated.rover import Rover
from mission.document import Point

PATIENCE_NS = 1_000_000_000
"""An autopilot that wants a stream of setpoints waits so long for the next one, by the wall's clock."""


class GuidedTarget:
    """Where a station wants the vehicle."""

    def __init__(self, rover: Rover, wall: Clock) -> None:
        self._rover, self._wall = rover, wall
        self._heard_ns = -PATIENCE_NS
        self._to: tuple[Point, float | None] | None = None

    @property
    def goes_somewhere(self) -> bool:
        return self._to is not None

    @property
    def fresh(self) -> bool:
        """Whether a setpoint came just now."""
        return self._wall.now_ns() - self._heard_ns <= PATIENCE_NS

    def hear(self) -> None:
        """A setpoint has come, followed or not."""
        self._heard_ns = self._wall.now_ns()

    def go(self, point: Point, heading: float | None, now_ns: int) -> None:
        """Drive to a point; the same one again changes nothing."""
        if (point, heading) != self._to:
            self._to = (point, heading)
            self._rover.drive(point, now_ns, heading=heading)

    def turn(self, heading: float, now_ns: int) -> None:
        """Turn on the spot."""
        here = self._rover.at(now_ns)[0]
        if self._to is None or self._to[1] != heading:
            self.go((here.x, here.y), heading, now_ns)

    def again(self, now_ns: int) -> None:
        """Set out anew, for the speed has changed."""
        if self._to is not None:
            self._rover.drive(self._to[0], now_ns, heading=self._to[1])

    def forget(self) -> None:
        self._to = None
