"""A robot with Nav2 as a controller's base: exactly the mission's legs, one goal per straight.

A mission whose policy allows `own_way` lets Nav2 find its own way to each stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from threading import Event

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import BaseHealth, Outcome, Rest
from stopgo.bridge.ros2.goal_drive import LOOK_S, GoalDrive, RosDriveEnded
from stopgo.bridge.ros2.ros_port import RosPort
from stopgo.bridge.ros2.ros_scanner import RosScanner
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.document import Mission, Point, RobotSpec
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot, legs_of

FACES_RAD = math.radians(1.5)
"""Greatest heading error after a turn on the spot."""


class RosBase:
    """The base of one robot (`stopgo.bridge.robot.base.Base`); poses and paths are in the map's frame."""

    def __init__(
        self,
        port: RosPort,
        telemetry: RosTelemetry,
        *,
        clock: Clock,
        settings: RosSettings,
        scanner: RosScanner,
    ) -> None:
        self._port = port
        self._telemetry = telemetry
        self._clock = clock
        self._settings = settings
        self._drive = GoalDrive(port, telemetry, clock, settings)
        self._scanner = scanner
        self._blocked_by = ""
        self._route: tuple[tuple[Point, Point], ...] = ()
        self._own_way = False

    def take(self, mission: Mission, to_map: Transform) -> None:
        """Drive only near the legs of this mission from now on, unless its policy allows its own way."""
        self._own_way = mission.policy.own_way is True
        legs = [[to_map.point(point) for point in leg] for leg in legs_of(mission)]
        self._route = tuple(straight for leg in legs for straight in pairwise(leg))

    def pose(self) -> Pose:
        return self._telemetry.pose()

    def speed(self) -> float:
        return self._telemetry.speed()

    def battery(self) -> float | None:
        return self._telemetry.charge

    def health(self) -> BaseHealth:
        return self._telemetry.health()

    def endurance_s(self) -> float | None:
        return None

    def rest(self) -> Rest:
        return Rest(metres=self._settings.limits.rest_m, radians=self._settings.limits.rest_rad)

    def unfit(self, mission: Mission) -> str:
        return ""

    def not_ready(self) -> str:
        """Return why the robot must not drive. Commands ask this: who gives one has seen a jump before it."""
        self._telemetry.jump = None
        return self._why_not_ready()

    def _why_not_ready(self) -> str:
        return self._telemetry.silence() or self._telemetry.unusable() or self._cannot_drive()

    def _cannot_drive(self) -> str:
        own_way = self._port.missing("navigate") if self._own_way else ""
        if missing := self._port.missing("drive") or own_way:
            return missing
        foreign = self._port.foreign_goals()
        return f"another client drives the robot ({foreign[0]})" if foreign else ""

    def finds_way(self) -> bool:
        return self._own_way

    def blocked_by(self) -> str:
        return self._blocked_by

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        self._blocked_by = ""
        try:
            self._begin(interrupt)
            if self._own_way:
                self._drive.navigate(_end_of(path, heading, self.pose()), limits.radius, interrupt)
                path = path[-1:]
            for number, end in enumerate(path, 1):
                last = heading if number == len(path) else None
                self._drive.straight((float(end[0]), float(end[1])), last, limits.radius, interrupt)
            if heading is not None and self._settings.drive.spin:
                self._drive.turn(heading, FACES_RAD, interrupt)
        except RosDriveEnded as end_of_drive:
            self._blocked_by = end_of_drive.why
            return end_of_drive.outcome
        return "arrived"

    def stop(self) -> None:
        self._port.stand()

    def _begin(self, interrupt: Event) -> None:
        """Wait for what the scanner still does; raise `RosDriveEnded` if the robot must not drive."""
        self._await_scanner(interrupt)
        gone_ns = self._clock.now_ns() + round(self._settings.limits.gap_s * 1e9)
        while why := self._telemetry.silence():
            if self._clock.wait(LOOK_S, interrupt):
                raise RosDriveEnded("interrupted")
            if self._clock.now_ns() > gone_ns:
                raise RosDriveEnded("blocked", why)
        why = self._jumped() or self._why_not_ready() or self._off_route()
        if why:
            raise RosDriveEnded("blocked", why)

    def _await_scanner(self, interrupt: Event) -> None:
        """A scan that may be in progress keeps the robot where it is, until a person lets it go on."""
        why = self._scanner.wait_until_free(interrupt)
        if interrupt.is_set():
            raise RosDriveEnded("interrupted")
        if why:
            raise RosDriveEnded("blocked", why)

    def _jumped(self) -> str:
        """Return the last jump of the localisation, once: it has happened while the robot did not drive."""
        jump, self._telemetry.jump = self._telemetry.jump, None
        if jump is None or jump.metres < self._settings.limits.jump_m:
            return ""
        return f"{jump.words}; see where the robot is, then let it go on"

    def _off_route(self) -> str:
        if self._own_way:
            return ""
        pose = self._telemetry.pose()
        here = (pose.x, pose.y)
        off_m = min((math.dist(foot(*straight, here), here) for straight in self._route), default=0.0)
        if off_m <= self._settings.limits.off_path_m:
            return ""
        return f"the robot is {off_m:.2f} m off its route; bring it back there, or localise it again"


def _end_of(path: Sequence[Point], heading: float | None, here: Pose) -> Pose:
    """Return the pose at a path's end; without a heading it is that of the path there."""
    before, end = [(here.x, here.y), *path][-2:]
    along = math.atan2(end[1] - before[1], end[0] - before[0])
    return Pose(x=float(end[0]), y=float(end[1]), heading=along if heading is None else heading)
