"""Rotation and shift between the mission's frame and the map of a robot.

A building's drawing and the map a robot has made of it share scale but not origin or direction. Only
the base itself uses the map's frame; all other code uses the mission's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from threading import Event

from stopgo.bridge.robot.base import Base, BaseHealth, Outcome, Rest, finds_way
from stopgo.mission.document import Mission, Point, RobotSpec
from stopgo.mission.frames.transform import SAME, Transform
from stopgo.mission.run.events import Pose


class OnMap:
    """A base with poses and paths in the mission's frame; the base inside drives in its own map."""

    def __init__(self, base: Base, own: Transform | None = None) -> None:
        self._base = base
        self._own = own
        self.to_map = own or SAME

    def take(self, mission: Mission) -> None:
        """Use the mission's transform, unless the robot was given one."""
        self.to_map = self._own or mission.frame.to_map or SAME

    def pose(self) -> Pose:
        return turned_back(self._base.pose(), self.to_map)

    def speed(self) -> float:
        return self._base.speed()

    def battery(self) -> float | None:
        return self._base.battery()

    def health(self) -> BaseHealth:
        return self._base.health()

    def endurance_s(self) -> float | None:
        return self._base.endurance_s()

    def rest(self) -> Rest:
        return self._base.rest()

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        points = [self.to_map.point(point) for point in path]
        on_map = None if heading is None else heading + self.to_map.heading
        return self._base.goto(points, heading=on_map, limits=limits, interrupt=interrupt)

    def stop(self) -> None:
        self._base.stop()

    def unfit(self, mission: Mission) -> str:
        return self._base.unfit(mission)

    def not_ready(self) -> str:
        return self._base.not_ready()

    def finds_way(self) -> bool:
        return finds_way(self._base)

    def blocked_by(self) -> str:
        return self._base.blocked_by()


def turned(pose: Pose, to_map: Transform) -> Pose:
    """Transform a pose from the site to the map."""
    there = to_map.after(Transform(x=pose.x, y=pose.y, heading=pose.heading))
    return Pose(x=there.x, y=there.y, heading=there.heading)


def turned_back(pose: Pose, to_map: Transform) -> Pose:
    """Transform a pose from the map to the site; without a transform it is returned unchanged."""
    if to_map == SAME:
        return pose
    x, y = to_map.back((pose.x, pose.y))
    return Pose(x=x, y=y, heading=math.remainder(pose.heading - to_map.heading, math.tau))
