"""The vehicle led from outside: to places and headings that a station tells, one after another."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated.rover import Rover
from stopgo.bridge.mavlink.simulated.steering import Course
from stopgo.mission.document import Point

LONG_AGO_NS = 10**18


class GuidedTarget:
    """Where a station wants the vehicle, or how it wants it to drive.

    Parameters
    ----------
    patience_s
        How long a course counts that is not told again, and any setpoint of an autopilot that wants a stream
        of them, seconds of the wall's clock.
    """

    def __init__(self, rover: Rover, wall: Clock, *, patience_s: Callable[[], float]) -> None:
        self._rover, self._wall, self._patience_s = rover, wall, patience_s
        self._heard_ns = self._course_ns = -LONG_AGO_NS
        self._to: tuple[Point, float | None] | None = None
        self._course: Course | None = None

    @property
    def goes_somewhere(self) -> bool:
        return self._to is not None

    @property
    def fresh(self) -> bool:
        """Whether a setpoint came just now."""
        return self._wall.now_ns() - self._heard_ns <= self._patience_s() * 1e9

    @property
    def overdue(self) -> bool:
        """Whether a course is followed that should have been told again."""
        waited_ns = self._wall.now_ns() - self._course_ns
        return self._course is not None and waited_ns > self._patience_s() * 1e9

    def hear(self) -> None:
        """A setpoint has come, followed or not."""
        self._heard_ns = self._wall.now_ns()

    def go(self, point: Point, heading: float | None, now_ns: int) -> None:
        """Drive to a point; the same one again changes nothing."""
        self._course = None
        if (point, heading) != self._to:
            self._to = (point, heading)
            self._rover.drive(point, now_ns, heading=heading)

    def steer(self, course: Course, now_ns: int) -> None:
        """Keep a heading and a speed for a while."""
        self._to, self._course_ns = None, self._wall.now_ns()
        if course != self._course:
            self._course = course
            self._rover.course(course, now_ns)

    def again(self, now_ns: int) -> None:
        """Set out anew, for the speed has changed."""
        if self._to is not None:
            self._rover.drive(self._to[0], now_ns, heading=self._to[1])

    def forget(self) -> None:
        self._to = self._course = None
