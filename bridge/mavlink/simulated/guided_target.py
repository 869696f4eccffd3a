"""Target of the guided mode: positions, headings and courses that a station commands, one after another."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated.rover import Rover
from stopgo.bridge.mavlink.simulated.steering import Course
from stopgo.mission.document import Point

LONG_AGO_NS = 10**18


class GuidedTarget:
    """Position or course that a station commands.

    Parameters
    ----------
    patience_s
        Time for which a course counts that is not sent again, seconds of the wall's clock. It holds for any
        setpoint of an autopilot that needs a stream of them.
    """

    def __init__(self, rover: Rover, wall: Clock, *, patience_s: Callable[[], float]) -> None:
        self._rover, self._wall, self._patience_s = rover, wall, patience_s
        self._setpoint_ns = self._course_ns = -LONG_AGO_NS
        self._to: tuple[Point, float | None] | None = None
        self._course: Course | None = None

    @property
    def goes_somewhere(self) -> bool:
        return self._to is not None

    @property
    def fresh(self) -> bool:
        """True if a setpoint came just now."""
        return self._wall.now_ns() - self._setpoint_ns <= self._patience_s() * 1e9

    @property
    def overdue(self) -> bool:
        """True if the vehicle follows a course that should have been sent again."""
        waited_ns = self._wall.now_ns() - self._course_ns
        return self._course is not None and waited_ns > self._patience_s() * 1e9

    def note_setpoint(self) -> None:
        """Note that a setpoint came, followed or not."""
        self._setpoint_ns = self._wall.now_ns()

    def go(self, point: Point, heading: float | None, now_ns: int) -> None:
        """Drive to a point; the same one again changes nothing."""
        self._course = None
        if (point, heading) != self._to:
            self._to = (point, heading)
            self._rover.drive(point, now_ns, heading=heading)

    def steer(self, course: Course, now_ns: int) -> None:
        """Follow a heading and a speed for a while."""
        self._to, self._course_ns = None, self._wall.now_ns()
        if course != self._course:
            self._course = course
            self._rover.course(course, now_ns)

    def restart(self, now_ns: int) -> None:
        """Set out again, because the speed has changed."""
        if self._to is not None:
            self._rover.drive(self._to[0], now_ns, heading=self._to[1])

    def forget(self) -> None:
        self._to = self._course = None
