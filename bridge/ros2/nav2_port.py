"""The ROS side of a robot that Nav2 drives, on any node: telemetry, goals, the scanner, and the stop.

The node's thread brings what the robot publishes; nothing here waits for an answer.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.ros2.goal_guard import CANCEL
from stopgo.bridge.ros2.ros_port import RosClient, RosNode
from stopgo.bridge.ros2.ros_settings import NAVIGATORS, RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.ros_types import RosFields, check_scan, checked_fields
from stopgo.bridge.ros2.sent_goal import ACTIVE, SentCall, SentGoal
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose

FOLLOW_PATH, SPIN = "nav2_msgs/action/FollowPath", "nav2_msgs/action/Spin"
NAVIGATE = "nav2_msgs/action/NavigateToPose"
ODOMETRY, TF = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
ZERO_S, ZERO_HZ = 2.0, 20.0
"""Time and rate of zero velocity after a stop: a controller's last commands may come later than the first."""
UNIT_TOLERANCE = 0.01
"""Greatest difference of a rotation's quaternion from length 1; tf2 ignores others."""
TURN_S = 30
"""Time that a turn may take."""


class Nav2Port:
    """One robot's topics, actions and scanner (`stopgo.bridge.ros2.ros_port.RosPort`)."""

    def __init__(self, node: RosNode, settings: RosSettings, telemetry: RosTelemetry, clock: Clock) -> None:
        self.node = node
        self.settings = settings
        self.telemetry = telemetry
        self.clock = clock
        self.before_goal: Callable[[], None] = lambda: None
        """Called before a goal is sent."""
        self._ours: dict[bytes, SentGoal] = {}
        self._of_nav2: set[bytes] = set()
        """Goals that Nav2 has sent to its own servers while it found its own way for us."""
        self._finds_way = False
        self._sent: SentGoal | None = None
        self._active: dict[str, tuple[bytes, ...]] = {}
        self._told_by: dict[str, frozenset[str]] = {}
        """Publishers of each action's status when it came."""
        self._zero_until_ns = 0
        names = settings.drive
        self._follow = node.action_client(FOLLOW_PATH, names.follow_path)
        self._navigate = node.action_client(NAVIGATE, names.navigate)
        self._spin = node.action_client(SPIN, names.spin) if names.spin else None
        spin = [names.spin] if names.spin else []
        self._driving = tuple(dict.fromkeys((names.follow_path, *spin, names.navigate, *names.cancel)))
        self._cancel = {name: self._cancelling(name) for name in self._driving}
        self._listen()
        self._open_velocity()
        self._open_scanner()

    def _cancelling(self, action: str) -> RosClient:
        return self.node.client(CANCEL, f"{action}/_action/cancel_goal")

    # What the robot publishes

    def _listen(self) -> None:
        topics, listen = self.settings.topics, self.node.subscribe
        listen(ODOMETRY, topics.odometry, self._take_odometry, "best effort")
        listen(TF, topics.tf, partial(self._take_tf, static=False), "best effort")
        listen(TF, topics.tf_static, partial(self._take_tf, static=True), "kept")
        if topics.battery:
            listen("sensor_msgs/msg/BatteryState", topics.battery, self._take_battery, "best effort")
        if topics.localisation:
            kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            listen(kind, topics.localisation, self._take_covariance, "best effort")
        if topics.emergency_stop:
            listen("std_msgs/msg/Bool", topics.emergency_stop, self._take_emergency_stop, "best effort")
        for name in self._driving:
            status = f"{name}/_action/status"
            listen("action_msgs/msg/GoalStatusArray", status, partial(self._take_status, name), "kept")

    def _take_odometry(self, message: Any) -> None:
        stamp_ns = ns_of(message.header.stamp)
        behind_s = (self.node.now_ns() - stamp_ns) / 1e9
        speed, turn = message.twist.twist.linear, float(message.twist.twist.angular.z)
        velocity = math.hypot(speed.x, speed.y)
        self.telemetry.take_odometry(velocity, turn, stamp_ns=stamp_ns, behind_s=behind_s)

    def _take_tf(self, message: Any, *, static: bool) -> None:
        take_transforms(self.telemetry, message, static=static)

    def _take_battery(self, message: Any) -> None:
        self.telemetry.charge = charge_of(message)

    def _take_covariance(self, message: Any) -> None:
        covariance = message.pose.covariance
        self.telemetry.take_variances(float(covariance[0]), float(covariance[7]))

    def _take_emergency_stop(self, message: Any) -> None:
        self.telemetry.emergency_stop = bool(message.data)
        if message.data:
            self.stand()

    def _take_status(self, name: str, message: Any) -> None:
        goals = {bytes(one.goal_info.goal_id.uuid): int(one.status) for one in message.status_list}
        self._told_by[name] = self.node.publishers(f"{name}/_action/status")
        self._active[name] = tuple(goal for goal, status in goals.items() if status in ACTIVE)
        if self._finds_way and self.drives and not self._is_navigator(name):
            self._of_nav2.update(self._active[name])
        for goal, status in goals.items():
            if goal in self._ours:
                self._ours[goal].told(status)

    def _is_navigator(self, action: str) -> bool:
        return action == self.settings.drive.navigate or action.rpartition("/")[2] in NAVIGATORS

    # What drives it

    def missing(self, what: Literal["drive", "navigate", "spin", "scan"]) -> str:
        if what == "scan":
            return (self._scan_action or self._scan).missing()
        client = {"drive": self._follow, "navigate": self._navigate, "spin": self._spin}[what]
        return "no action that turns is named" if client is None else client.missing()

    def follow(self, path: Sequence[Pose]) -> SentGoal:
        drive = self.settings.drive
        goal = {
            "path": path_fields(path, self.settings.frames.map, self.node.now_ns()),
            "controller_id": drive.controller_id,
            "goal_checker_id": drive.goal_checker_id,
            "progress_checker_id": drive.progress_checker_id,
        }
        known = self._follow.goal.fields
        fields = {field: value for field, value in goal.items() if field in known}
        return self._send(self._follow, drive.follow_path, fields)

    def navigate(self, end: Pose) -> SentGoal:
        drive, header = self.settings.drive, header_fields(self.settings.frames.map, self.node.now_ns())
        fields = {"pose": {"header": header, "pose": pose_fields(end)}, "behavior_tree": drive.behavior_tree}
        return self._send(self._navigate, drive.navigate, fields)

    def spin(self, angle: float) -> SentGoal:
        assert self._spin is not None
        fields = {"target_yaw": float(angle), "time_allowance": {"sec": TURN_S}}
        return self._send(self._spin, self.settings.drive.spin, fields)

    def _send(self, client: Any, action: str, fields: RosFields) -> SentGoal:
        own_id = os.urandom(16)
        sent = SentGoal(partial(self._cancel_one, self._cancel[action], own_id))
        self._sent, self._finds_way = sent, action == self.settings.drive.navigate
        self.before_goal()
        self._ours[own_id] = sent
        self._zero_until_ns = 0
        client.send(own_id, fields, sent)
        return sent

    @staticmethod
    def _cancel_one(cancel: RosClient, goal_id: bytes) -> None:
        if not cancel.missing():
            cancel.call({"goal_info": {"goal_id": {"uuid": list(goal_id)}}})

    @property
    def drives(self) -> bool:
        """True while a goal of ours drives the robot, or may."""
        return self._sent is not None and self._sent.status in ("sent", "active")

    @property
    def guarded(self) -> dict[str, Any]:
        """Names with which a guard stops the robot, absolute ones."""
        node, topics = self.node, self.settings.topics
        return {
            "node": f"{node.name}_guard",
            "cancel": [node.resolved(f"{name}/_action/cancel_goal") for name in self._driving],
            "cmd_vel": node.resolved(topics.cmd_vel) if topics.cmd_vel else "",
            "velocity_type": velocity_type(self.settings),
        }

    def foreign_goals(self) -> tuple[str, ...]:
        known = {*self._ours, *self._of_nav2}
        return tuple(
            f"goal {goal.hex()[:8]} of {name}"
            for name, goals in list(self._active.items())
            for goal in goals
            if goal not in known and self._is_still_published(name)
        )

    def _is_still_published(self, action: str) -> bool:
        """Return False if the server whose status is known has gone, though another may have come."""
        now, before = self.node.publishers(f"{action}/_action/status"), self._told_by[action]
        return bool(now & before) if before else bool(now)

    def stand(self) -> None:
        self._zero_until_ns = self.clock.now_ns() + round(ZERO_S * 1e9)
        self._publish_zero()
        for client in self._cancel.values():
            if not client.missing():
                client.call({})  # no id and no time: every goal

    def _open_velocity(self) -> None:
        topics = self.settings.topics
        self._velocity = None
        if topics.cmd_vel:
            kind = velocity_type(self.settings)
            self._velocity = self.node.publisher(kind, topics.cmd_vel)
            self.node.subscribe(kind, topics.cmd_vel, self._take_command, "reliable")
            self.node.every(1.0 / ZERO_HZ, self._publish_while_due)

    def _take_command(self, message: Any) -> None:
        twist = message.twist if self.settings.topics.stamped else message
        self.telemetry.take_command(math.hypot(twist.linear.x, twist.linear.y), float(twist.angular.z))

    def _publish_while_due(self) -> None:
        if self.clock.now_ns() < self._zero_until_ns:
            self._publish_zero()

    def _publish_zero(self) -> None:
        if self._velocity is not None:
            stamped = self.settings.topics.stamped
            header = header_fields(self.settings.frames.base, self.node.now_ns())
            self._velocity.publish({"header": header} if stamped else {})

    # The scanner

    def _open_scanner(self) -> None:
        scan, node = self.settings.scan, self.node
        self._scan_action = None
        if scan.kind == "action":
            check_scan(scan, *node.action_kinds(scan.type))
            self._scan_action = node.action_client(scan.type, scan.name)
            self._scan = self._cancelling(scan.name)
            self._request = self._scan_action.goal
        else:
            self._request, response = node.service_kinds(scan.type)
            check_scan(scan, self._request, response)
            self._scan = node.client(scan.type, scan.name)

    def trigger(self, request: RosFields) -> SentCall:
        fields, own_id = checked_fields(self._request, request), os.urandom(16)
        if self._scan_action is None:
            call = SentCall()
            self._scan.call(fields, call.answered)
        else:
            call = SentCall(partial(self._cancel_one, self._scan, own_id))
            self._scan_action.send(own_id, fields, call)
        return call

    def found_instead(self) -> str:
        """Return topics of the odometry's type, or the type that its topic has, in words."""
        return self.node.found_instead(ODOMETRY, self.settings.topics.odometry)


def velocity_type(settings: RosSettings) -> str:
    """Return the type of the topic that takes velocities."""
    return f"geometry_msgs/msg/{'TwistStamped' if settings.topics.stamped else 'Twist'}"


def header_fields(frame: str, now_ns: int) -> dict[str, Any]:
    """Return the fields of a std_msgs/msg/Header."""
    return {"frame_id": frame, "stamp": {"sec": now_ns // 10**9, "nanosec": now_ns % 10**9}}


def pose_fields(pose: Pose) -> dict[str, Any]:
    """Return the fields of a geometry_msgs/msg/Pose on the floor."""
    half = pose.heading / 2
    return {
        "position": {"x": pose.x, "y": pose.y},
        "orientation": {"z": math.sin(half), "w": math.cos(half)},
    }


def path_fields(path: Sequence[Pose], frame: str, now_ns: int) -> dict[str, Any]:
    """Return the fields of a nav_msgs/msg/Path."""
    header = header_fields(frame, now_ns)
    return {"header": header, "poses": [{"header": header, "pose": pose_fields(pose)} for pose in path]}


def take_transforms(telemetry: RosTelemetry, message: Any, *, static: bool) -> None:
    """Give the transforms of a tf2_msgs/msg/TFMessage to the telemetry, but not those without a rotation."""
    for one in message.transforms:
        at, turn = one.transform.translation, one.transform.rotation
        norm = math.hypot(turn.x, turn.y, turn.z, turn.w)
        if not abs(norm - 1.0) <= UNIT_TOLERANCE:
            continue
        transform = Transform(x=at.x, y=at.y, heading=yaw_of(turn.x, turn.y, turn.z, turn.w))
        stamp_ns, parent, child = ns_of(one.header.stamp), one.header.frame_id, one.child_frame_id
        telemetry.take_transform(parent, child, transform, stamp_ns=stamp_ns, static=static)


def charge_of(message: Any) -> float | None:
    """Return the charge that a sensor_msgs/msg/BatteryState has, 0 to 1; `None` if it has none."""
    charge = float(message.percentage)
    return charge if 0.0 <= charge <= 1.0 else None


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about the vertical axis of a quaternion, in radians."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def ns_of(stamp: Any) -> int:
    """Return the nanoseconds of a builtin_interfaces/msg/Time."""
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
