"""Exact driving of the simulated rover: it reaches each point to the last digit, as no real one does."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.estimator import Estimate
from stopgo.bridge.mavlink.simulated.steering import Course
from stopgo.bridge.robot.motion import Brake, Motion, along
from stopgo.mission.document import Point, RobotSpec
from stopgo.mission.run.events import Pose

LIMITS = RobotSpec(radius=0.35, speed=0.5, turn_rate=1.0, acceleration=0.5)


class ExactDrive:
    """Driving for tests on paper: of the protocol, and of the sequence of a mission's events."""

    def __init__(self, pose: Pose) -> None:
        self.speed = LIMITS.speed
        self._motion = Motion(pose)
        self._began_ns = 0

    def at(self, now_ns: int) -> tuple[Pose, float]:
        return self._motion.at((now_ns - self._began_ns) / 1e9)

    def estimate(self, now_ns: int) -> Estimate:
        pose, speed = self.at(now_ns)
        return Estimate(pose, speed * math.cos(pose.heading), speed * math.sin(pose.heading))

    def set_out(
        self, to: Point, now_ns: int, *, heading: float | None, to_spare: float, keeps: bool = False
    ) -> int:
        """Set out for a point; return when it will be there."""
        start = self.at(now_ns)[0]
        away = math.hypot(to[0] - start.x, to[1] - start.y)
        fraction = max(0.0, 1.0 - to_spare / away) if away > 0 else 0.0
        end = (start.x + (to[0] - start.x) * fraction, start.y + (to[1] - start.y) * fraction)
        self._motion = along(
            start, [end], heading,
            speed=self.speed, turn_rate=LIMITS.turn_rate, acceleration=LIMITS.acceleration,
        )  # fmt: skip
        self._began_ns = now_ns
        return now_ns + round(self._motion.duration * 1e9)

    def arrival_ns(self, now_ns: int) -> int | None:
        ends_ns = self._began_ns + round(self._motion.duration * 1e9)
        return None if ends_ns <= now_ns else ends_ns

    def course(self, course: Course, now_ns: int) -> None:
        """Turn to a heading; a speed without a position is not followed."""
        here = self.at(now_ns)[0]
        self.set_out((here.x, here.y), now_ns, heading=course.heading, to_spare=0.0)

    def brake(self, now_ns: int) -> None:
        pose, speed = self.at(now_ns)
        self._motion = Motion(pose, (Brake(pose, speed, LIMITS.acceleration),) if speed > 0 else ())
        self._began_ns = now_ns

    def jump(self, metres: float, now_ns: int) -> None:
        """Do nothing: the estimate is the truth."""
