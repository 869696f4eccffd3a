"""The rover driven as a real one is: an autopilot's loops on wheels with lag, by an estimate of its place."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.chassis import Chassis
from stopgo.bridge.mavlink.simulated.estimator import Estimate, Estimator
from stopgo.bridge.mavlink.simulated.steering import LAWS, Course, RunningStraight
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose

STEP_NS = 20_000_000
"""Fifty times a second, as ArduPilot Rover runs its loops."""
LONGEST_NS = 60_000_000_000
"""After a longer absence it has stood meanwhile."""


class RealDrive:
    """Wheels, estimator and loops of one vehicle, by its own clock.

    Times are nanoseconds of the vehicle's clock; what happened until then is worked out when somebody asks.
    """

    def __init__(self, kind: str, tuning: Tuning, pose: Pose, *, seed: int) -> None:
        self.chassis = Chassis(pose, tuning)
        self.estimator = Estimator(self.chassis, tuning, seed)
        self.speed = tuning["WP_SPEED" if kind == "ardupilot" else "RO_SPEED_LIM"]
        self._law = LAWS[kind](tuning)
        self._now_ns = 0
        self._order: RunningStraight | Course | None = None
        self._heading: float | None = None

    def at(self, now_ns: int) -> tuple[Pose, float]:
        self._go_on(now_ns)
        return self.chassis.pose, abs(self.chassis.speed)

    def told(self, now_ns: int) -> Estimate:
        self._go_on(now_ns)
        return self.estimator.now

    def set_out(self, to: Point, now_ns: int, *, heading: float | None, to_spare: float, keeps: bool) -> int:
        """When to look whether it has arrived."""
        self._go_on(now_ns)
        here = self.estimator.now
        place, away = (here.pose.x, here.pose.y), math.dist((here.pose.x, here.pose.y), to)
        share = max(0.0, 1.0 - to_spare / away) if away > 0 else 0.0
        end = (place[0] + (to[0] - place[0]) * share, place[1] + (to[1] - place[1]) * share)
        if isinstance(self._order, RunningStraight) and self._order.end == end and not self._order.reached:
            return now_ns + STEP_NS
        if self._order is None:
            self._law.reset()
        self._order, self._heading = RunningStraight(place, end, keeps=keeps), heading
        self._law.set_out(self._order, here)
        return now_ns + STEP_NS

    def arrival_ns(self, now_ns: int) -> int | None:
        """When to look again; `None` once it has arrived."""
        self._go_on(now_ns)
        arrived = isinstance(self._order, RunningStraight) and self._order.reached
        return None if arrived else now_ns + STEP_NS

    def course(self, course: Course, now_ns: int) -> None:
        """Keep a heading and a speed, until told otherwise."""
        self._go_on(now_ns)
        if self._order is None:
            self._law.reset()
        self._order = course

    def brake(self, now_ns: int) -> None:
        self._go_on(now_ns)
        self._order = None

    def jump(self, metres: float, now_ns: int) -> None:
        """The estimate jumps."""
        self._go_on(now_ns)
        self.estimator.jump(metres)

    def _go_on(self, now_ns: int) -> None:
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
        order = self._order
        if isinstance(order, RunningStraight) and (order.keeps or not order.reached):
            return self._law.follow(order, here, self.speed, dt)
        if isinstance(order, RunningStraight) and self._heading is not None:
            return 0.0, self._law.steer(Course(self._heading, 0.0), here)[1]
        return self._law.steer(order, here) if isinstance(order, Course) else (0.0, 0.0)
