"""Interfaces between a robot's controller and ROS 2: what drives and scans, and the node that does so."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Protocol

from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.ros_types import MessageKind, RosFields
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

    def missing(self, what: Literal["drive", "navigate", "spin", "scan"]) -> str:
        """Return why the action or service cannot be used, such as a missing server; empty if it can."""

    def follow(self, path: Sequence[Pose]) -> RosGoal:
        """Send a path in the map's frame to the action that drives."""

    def navigate(self, end: Pose) -> RosGoal:
        """Send a pose in the map's frame to the action that finds its own way there."""

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


RosQuality = Literal["best effort", "reliable", "kept"]
"""RosQuality of service; with `kept`, late subscribers get what was published before."""


class RosPublisher(Protocol):
    def publish(self, fields: RosFields) -> None: ...

    def is_heard(self) -> bool:
        """Return True if anybody subscribes."""


class RosClient(Protocol):
    """A client of a service."""

    def missing(self) -> str:
        """Return why the service cannot be called; empty if it can."""

    def call(self, fields: RosFields, answered: Callable[[Any], None] = lambda response: None) -> None:
        """Send a request; `answered` gets the response, or `None` if there will be none."""


class GoalEvents(Protocol):
    """Receiver of what an action's server says about a goal."""

    def accepted(self, yes: bool) -> None: ...

    def ended(self, status: int, result: Any) -> None:
        """Take the final value of action_msgs/msg/GoalStatus, and the action's result."""


class RosActionClient(Protocol):
    """A client of an action; goals are cancelled by the service of the action that does that."""

    @property
    def goal(self) -> MessageKind: ...

    @property
    def result(self) -> MessageKind: ...

    def missing(self) -> str: ...

    def send(self, goal_id: bytes, fields: RosFields, events: GoalEvents) -> None: ...


class RosNode(Protocol):
    """A node of ROS 2, by rclpy or over zenoh.

    Types are written as nav_msgs/msg/Path, names as ROS users write them: `odom`, `/tf`, `~/state`. Callbacks
    run one after the other in a thread of the node, and wait for nothing. They get messages with attributes.
    """

    name: str
    namespace: str

    def now_ns(self) -> int:
        """Return the node's time; simulated time if it uses that."""

    def resolved(self, name: str) -> str:
        """Return the absolute name of a topic or service."""

    def every(self, seconds: float, happens: Callable[[], None]) -> None: ...

    def subscribe(
        self, kind: str, topic: str, take: Callable[[Any], None], quality: RosQuality, depth: int = 50
    ) -> None: ...

    def publisher(
        self, kind: str, topic: str, quality: RosQuality = "reliable", depth: int = 10
    ) -> RosPublisher:
        """Return a publisher; subscribers see it at once."""

    def client(self, kind: str, service: str) -> RosClient: ...

    def action_client(self, kind: str, action: str) -> RosActionClient: ...

    def serve(self, kind: str, service: str, answer: Callable[[], RosFields]) -> None:
        """Serve a service whose requests have no fields."""

    def is_published(self, topic: str) -> bool: ...

    def publishers(self, topic: str) -> frozenset[str]:
        """Return the names of a topic's publishers; one that was restarted has another."""

    def service_kinds(self, kind: str) -> tuple[MessageKind, MessageKind]:
        """Return request and response of a service's type; raises `InputError` if it is not known here."""

    def action_kinds(self, kind: str) -> tuple[MessageKind, MessageKind]:
        """Return goal and result of an action's type; raises `InputError` if it is not known here."""

    def found_instead(self, kind: str, topic: str) -> str:
        """Return which topics there are of this type, or what a topic is instead, in words."""
