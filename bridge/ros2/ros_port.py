"""Interfaces between a robot's controller and ROS 2: one action that drives, one scanner, one stop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol

from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.run.events import Pose

GoalStatus = Literal["sent", "rejected", "active", "succeeded", "canceled", "aborted"]


class RosGoal(Protocol):
    """A goal of an action; another thread changes its status."""

    status: GoalStatus
    detail: str
    """Error of the action's result in words; empty if there is none."""

    def drop(self) -> None:
        """Cancel it now, or as soon as the server accepts it."""


class RosCall(Protocol):
    """A call of the scanner's service or action; another thread ends it."""

    fields: Mapping[str, Any] | None
    """Fields of the response; `None` until it is there."""
    error: str
    """The call's failure; empty if there is none."""

    def drop(self) -> None:
        """Cancel it, if it can be cancelled."""


class RosPort(Protocol):
    """The ROS side of a robot. No method waits for an answer."""

    settings: RosSettings
    telemetry: RosTelemetry

    def is_ready(self, what: Literal["drive", "spin", "scan"]) -> bool:
        """Return True if the server of the action or service is there."""

    def follow(self, path: Sequence[Pose]) -> RosGoal:
        """Send a path in the map's frame to the action that drives."""

    def spin(self, angle: float) -> RosGoal:
        """Send a turn on the spot, radians counter-clockwise."""

    def foreign_goals(self) -> tuple[str, ...]:
        """Return the goals of other clients that drive the robot at present, each by its name."""

    def stand(self) -> None:
        """Cancel every goal that drives the robot, whoever sent it, and command zero velocity."""

    def found_instead(self) -> str:
        """Return what there is in place of topics that are missing, in words."""

    def trigger(self, request: Mapping[str, Any]) -> RosCall:
        """Call the scanner."""
