"""Realistic driving of the simulated rover: an autopilot's loops on wheels with lag, by an estimated pose."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.chassis import Chassis
from stopgo.bridge.mavlink.simulated.estimator import Estimate, Estimator
from stopgo.bridge.mavlink.simulated.steering import LAWS, Course, RunningStraight
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose

STEP_NS = 20_000_000
"""Step of fifty times a second, as ArduPilot Rover runs its loops."""
LONGEST_NS = 60_000_000_000
"""Longest time that is simulated at once: after a longer one it was stationary meanwhile."""


class RealDrive:
    """Wheels, estimator and loops of one vehicle, by its own clock.

    Times are nanoseconds of the vehicle's clock; a question for a time simulates the steps until then.
    """

    def __init__(self, kind: str, tuning: Tuning, pose: Pose, *, seed: int) -> None:
        self.chassis = Chassis(pose, tuning)
        self.estimator = Estimator(self.chassis, tuning, seed)
        self.speed = tuning["WP_SPEED" if kind == "ardupilot" else "RO_SPEED_LIM"]
        self._law = LAWS[kind](tuning)
        self._now_ns = 0
        self._task: RunningStraight | Course | None = None
        self._heading: float | None = None

    def at(self, now_ns: int) -> tuple[Pose, float]:
        self._simulate_until(now_ns)
        return self.chassis.pose, abs(self.chassis.speed)

    def estimate(self, now_ns: int) -> Estimate:
        self._simulate_until(now_ns)
        return self.estimator.now

    def set_out(self, to: Point, now_ns: int, *, heading: float | None, to_spare: float, keeps: bool) -> int:
        """Set out for a point; return when to check the arrival."""
        self._simulate_until(now_ns)
        here = self.estimator.now
        start, away = (here.pose.x, here.pose.y), math.dist((here.pose.x, here.pose.y), to)
        fraction = max(0.0, 1.0 - to_spare / away) if away > 0 else 0.0
        end = (start[0] + (to[0] - start[0]) * fraction, start[1] + (to[1] - start[1]) * fraction)
        if isinstance(self._task, RunningStraight) and self._task.end == end and not self._task.reached:
            return now_ns + STEP_NS
        if self._task is None:
            self._law.reset()
        self._task, self._heading = RunningStraight(start, end, keeps=keeps), heading
        self._law.set_out(self._task, here)
        return now_ns + STEP_NS

    def arrival_ns(self, now_ns: int) -> int | None:
        """Time of the next check; `None` once it has arrived."""
        self._simulate_until(now_ns)
        arrived = isinstance(self._task, RunningStraight) and self._task.reached
        return None if arrived else now_ns + STEP_NS

    def course(self, course: Course, now_ns: int) -> None:
        """Follow a heading and a speed, until another command."""
        self._simulate_until(now_ns)
        if self._task is None:
            self._law.reset()
        self._task = course

    def brake(self, now_ns: int) -> None:
        self._simulate_until(now_ns)
        self._task = None

    def jump(self, metres: float, now_ns: int) -> None:
        """Let the estimate jump."""
        self._simulate_until(now_ns)
        self.estimator.jump(metres)

    def _simulate_until(self, now_ns: int) -> None:
        if now_ns - self._now_ns > LONGEST_NS:
            self._now_ns = now_ns
        while self._now_ns + STEP_NS <= now_ns:
            self._now_ns += STEP_NS
            self._step(STEP_NS / 1e9)

    def _step(self, dt: float) -> None:
        here = self.estimator.now
        throttle, steering = self._law.output(self._wanted(here, dt), here, dt)
        self.chassis.move(throttle, steering, dt)
        self.estimator.look(dt)

    def _wanted(self, here: Estimate, dt: float) -> tuple[float, float]:
        """Speed ahead and turn rate; at the end of a straight it turns to its heading if it has one."""
        task = self._task
        if isinstance(task, RunningStraight) and (task.keeps or not task.reached):
            return self._law.follow(task, here, self.speed, dt)
        if isinstance(task, RunningStraight) and self._heading is not None:
            return 0.0, self._law.steer(Course(self._heading, 0.0), here)[1]
        return self._law.steer(task, here) if isinstance(task, Course) else (0.0, 0.0)
