"""The ROS side of a robot by rclpy; no other module loads ROS.

The node's callbacks run in a thread of its own. They store what came, and wait for nothing.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.ros2.goal_guard import GoalGuard
from stopgo.bridge.ros2.ros_port import GoalStatus
from stopgo.bridge.ros2.ros_settings import RosSettings, changed_settings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.ros_types import RosFields, checked_scan_type, filled_message, load, plain_fields
from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose

ENDED: dict[int, GoalStatus] = {4: "succeeded", 5: "canceled", 6: "aborted"}
"""Final values of action_msgs/msg/GoalStatus."""
ACTIVE = (1, 2, 3)
ZERO_S, ZERO_HZ = 2.0, 20.0
"""Time and rate of zero velocity after a stop: a controller's last commands may come later than the first."""


class SentGoal:
    """A goal that was sent; the node's thread changes its status."""

    def __init__(self) -> None:
        self.status: GoalStatus = "sent"
        self.detail = ""
        self._handle: Any = None
        self._dropped = False

    def accepted(self, future: Any) -> None:
        """Take the server's answer to the goal."""
        handle = future.result()
        if handle is None or not handle.accepted:
            self.status = "rejected"
            return
        self._handle, self.status = handle, "active"
        handle.get_result_async().add_done_callback(self.ended)
        if self._dropped:
            handle.cancel_goal_async()

    def ended(self, future: Any) -> None:
        answer = future.result()
        self.detail = error_text(answer.result)
        self.status = ENDED.get(answer.status, "aborted")

    def drop(self) -> None:
        self._dropped = True
        if self._handle is not None and self.status == "active":
            self._handle.cancel_goal_async()


class SentCall:
    """A call of the scanner that was sent."""

    def __init__(self) -> None:
        self.fields: Mapping[str, Any] | None = None
        self.error = ""
        self._handle: Any = None
        self._dropped = False

    def answered(self, future: Any) -> None:
        """Take the response of a service."""
        if future.exception() is not None:
            self.error = str(future.exception())
        else:
            self.fields = plain_fields(future.result())

    def accepted(self, future: Any) -> None:
        """Take the answer of an action's server to the goal."""
        self._handle = future.result()
        if self._handle is None or not self._handle.accepted:
            self.error = "the action server has rejected the goal"
            return
        self._handle.get_result_async().add_done_callback(self._ended)
        if self._dropped:
            self._handle.cancel_goal_async()

    def _ended(self, future: Any) -> None:
        answer = future.result()
        status = ENDED.get(answer.status, "aborted")
        if status == "succeeded":
            self.fields = plain_fields(answer.result)
        else:
            self.error = f"{status}{f': {error_text(answer.result)}' if error_text(answer.result) else ''}"

    def drop(self) -> None:
        self._dropped = True
        if self._handle is not None and self._handle.accepted and self.fields is None:
            self._handle.cancel_goal_async()


def error_text(result: Any) -> str:
    """Return the error code and message of an action's result in words; empty if it names none."""
    code, message = getattr(result, "error_code", 0), getattr(result, "error_msg", "")
    names = [name for name in dir(result) if name.isupper() and getattr(result, name) == code]
    return " ".join(filter(None, [names[0] if code and names else "", str(message)]))


class RclpyPort:
    """One robot's topics, actions and scanner (`stopgo.bridge.ros2.ros_port.RosPort`)."""

    def __init__(self, node: Any, settings: RosSettings, telemetry: RosTelemetry, clock: Clock) -> None:
        self.node = node
        self.settings = settings
        self.telemetry = telemetry
        self.clock = clock
        self._ours: set[bytes] = set()
        self._sent: SentGoal | None = None
        self.before_goal: Callable[[], None] = lambda: None
        """Called before a goal is sent."""
        self._active: dict[str, dict[bytes, int]] = {}
        self._zero_until_ns = 0
        self._lock = threading.Lock()
        names = settings.drive
        self._follow = self._action_client("FollowPath", names.follow_path)
        self._spin = self._action_client("Spin", names.spin) if names.spin else None
        self._driving = (names.follow_path, *([names.spin] if names.spin else []), *names.cancel)
        cancel = load("action_msgs.srv").CancelGoal
        self._cancel = {
            name: node.create_client(cancel, f"{name}/_action/cancel_goal") for name in self._driving
        }
        self._listen()
        self._open_velocity()
        self._open_scanner()

    def _action_client(self, kind: str, name: str) -> Any:
        return load("rclpy.action").ActionClient(self.node, getattr(load("nav2_msgs.action"), kind), name)

    # What the robot publishes

    def _listen(self) -> None:
        qos, topics = load("rclpy.qos"), self.settings.topics
        newest = qos.QoSProfile(depth=50, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
        kept = qos.QoSProfile(depth=50, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
        nav, tf, geometry = load("nav_msgs.msg"), load("tf2_msgs.msg"), load("geometry_msgs.msg")
        listen = self.node.create_subscription
        listen(nav.Odometry, topics.odometry, self._take_odometry, newest)
        listen(tf.TFMessage, "/tf", lambda message: self._take_tf(message, static=False), newest)
        listen(tf.TFMessage, "/tf_static", lambda message: self._take_tf(message, static=True), kept)
        if topics.battery:
            listen(load("sensor_msgs.msg").BatteryState, topics.battery, self._take_battery, newest)
        if topics.localisation:
            kind = geometry.PoseWithCovarianceStamped
            listen(kind, topics.localisation, self._take_covariance, newest)
        if topics.emergency_stop:
            listen(load("std_msgs.msg").Bool, topics.emergency_stop, self._take_emergency_stop, newest)
        status = load("action_msgs.msg").GoalStatusArray
        for name in self._driving:
            taken = self._status_taker(name)
            listen(status, f"{name}/_action/status", taken, kept)

    def _take_odometry(self, message: Any) -> None:
        stamp_ns = _ns(message.header.stamp)
        behind_s = (self.node.get_clock().now().nanoseconds - stamp_ns) / 1e9
        speed, turn = message.twist.twist.linear, message.twist.twist.angular.z
        velocity = math.hypot(speed.x, speed.y)
        self.telemetry.take_odometry(velocity, turn, stamp_ns=stamp_ns, behind_s=behind_s)

    def _take_tf(self, message: Any, *, static: bool) -> None:
        for one in message.transforms:
            at, turn = one.transform.translation, one.transform.rotation
            transform = Transform(x=at.x, y=at.y, heading=yaw_of(turn.x, turn.y, turn.z, turn.w))
            stamp_ns = _ns(one.header.stamp)
            parent, child = one.header.frame_id, one.child_frame_id
            self.telemetry.take_transform(parent, child, transform, stamp_ns=stamp_ns, static=static)

    def _take_battery(self, message: Any) -> None:
        charge = message.percentage
        self.telemetry.charge = charge if 0.0 <= charge <= 1.0 else None

    def _take_covariance(self, message: Any) -> None:
        covariance = message.pose.covariance
        self.telemetry.sigma_m = math.sqrt(max(0.0, covariance[0], covariance[7]))

    def _take_emergency_stop(self, message: Any) -> None:
        self.telemetry.emergency_stop = bool(message.data)
        if message.data:
            self.stand()

    def _status_taker(self, name: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            goals = {bytes(one.goal_info.goal_id.uuid): one.status for one in message.status_list}
            self._active[name] = {goal: status for goal, status in goals.items() if status in ACTIVE}

        return take

    # What drives it

    def is_ready(self, what: Literal["drive", "spin", "scan"]) -> bool:
        if what == "scan":
            scan = self._scan
            return bool(scan.server_is_ready() if self._is_action else scan.service_is_ready())
        client = self._follow if what == "drive" else self._spin
        return client is not None and bool(client.server_is_ready())

    def follow(self, path: Sequence[Pose]) -> SentGoal:
        drive, nav = self.settings.drive, load("nav_msgs.msg")
        goal = self._follow._action_type.Goal()
        goal.path = path_message(nav.Path(), path, self.settings.frames.map, self.node)
        goal.controller_id, goal.goal_checker_id = drive.controller_id, drive.goal_checker_id
        if hasattr(goal, "progress_checker_id"):
            goal.progress_checker_id = drive.progress_checker_id
        return self._send(self._follow, goal)

    def spin(self, angle: float) -> SentGoal:
        assert self._spin is not None
        goal = self._spin._action_type.Goal()
        goal.target_yaw = float(angle)
        goal.time_allowance.sec = 30
        return self._send(self._spin, goal)

    def _send(self, client: Any, goal: Any) -> SentGoal:
        sent, own_id = SentGoal(), os.urandom(16)
        self._sent = sent
        self.before_goal()
        self._ours.add(own_id)
        self._zero_until_ns = 0
        uuid = load("unique_identifier_msgs.msg").UUID(uuid=list(own_id))
        client.send_goal_async(goal, goal_uuid=uuid).add_done_callback(sent.accepted)
        return sent

    @property
    def drives(self) -> bool:
        """True while a goal of ours drives the robot, or may."""
        return self._sent is not None and self._sent.status in ("sent", "active")

    @property
    def guarded(self) -> dict[str, Any]:
        """Names with which a guard stops the robot, absolute ones."""
        node, topics = self.node, self.settings.topics
        return {
            "node": f"{node.get_name()}_guard",
            "cancel": [node.resolve_service_name(f"{name}/_action/cancel_goal") for name in self._driving],
            "cmd_vel": node.resolve_topic_name(topics.cmd_vel) if topics.cmd_vel else "",
            "velocity_type": "TwistStamped" if topics.stamped else "Twist",
        }

    def foreign_goals(self) -> tuple[str, ...]:
        return tuple(
            f"goal {goal.hex()[:8]} of {name}"
            for name, goals in list(self._active.items())
            for goal in goals
            if goal not in self._ours and self.node.count_publishers(f"{name}/_action/status")
        )

    def stand(self) -> None:
        self._zero_until_ns = self.clock.now_ns() + round(ZERO_S * 1e9)
        self._publish_zero()
        every = load("action_msgs.srv").CancelGoal.Request  # no id and no time: every goal
        for client in self._cancel.values():
            if client.service_is_ready():
                client.call_async(every())

    def _open_velocity(self) -> None:
        topics, geometry = self.settings.topics, load("geometry_msgs.msg")
        self._velocity: Any = None
        if not topics.cmd_vel:
            return
        self._zero = geometry.TwistStamped if topics.stamped else geometry.Twist
        self._velocity = self.node.create_publisher(self._zero, topics.cmd_vel, 10)
        self.node.create_subscription(self._zero, topics.cmd_vel, self._take_command, 10)
        self.node.create_timer(1.0 / ZERO_HZ, self._publish_while_due)

    def _take_command(self, message: Any) -> None:
        twist = message.twist if self.settings.topics.stamped else message
        self.telemetry.take_command(math.hypot(twist.linear.x, twist.linear.y), twist.angular.z)

    def _publish_while_due(self) -> None:
        if self.clock.now_ns() < self._zero_until_ns:
            self._publish_zero()

    def _publish_zero(self) -> None:
        if self._velocity is None:
            return
        zero = self._zero()
        if self.settings.topics.stamped:
            zero.header.stamp = self.node.get_clock().now().to_msg()
            zero.header.frame_id = self.settings.frames.base
        self._velocity.publish(zero)

    # The scanner

    def _open_scanner(self) -> None:
        scan = self.settings.scan
        self._is_action = scan.kind == "action"
        self._scan_type = checked_scan_type(scan)
        if self._is_action:
            self._scan = load("rclpy.action").ActionClient(self.node, self._scan_type, scan.name)
        else:
            self._scan = self.node.create_client(self._scan_type, scan.name)

    def trigger(self, request: RosFields) -> SentCall:
        call = SentCall()
        made = filled_message(self._scan_type.Goal if self._is_action else self._scan_type.Request, request)
        if self._is_action:
            self._scan.send_goal_async(made).add_done_callback(call.accepted)
        else:
            self._scan.call_async(made).add_done_callback(call.answered)
        return call

    def found_instead(self) -> str:
        """Return topics of the odometry's type, or the type that its topic has, in words."""
        wanted, kind = self.settings.topics.odometry, "nav_msgs/msg/Odometry"
        topics = dict(self.node.get_topic_names_and_types())
        own = self.node.resolve_topic_name(wanted)
        if own in topics and kind not in topics[own]:
            return f"{own} is of type {', '.join(topics[own])}, not {kind}"
        same = [name for name, kinds in topics.items() if kind in kinds and self.node.count_publishers(name)]
        return f"topics of type {kind}: {', '.join(sorted(same)) or 'none'}"


def path_message(message: Any, path: Sequence[Pose], frame: str, node: Any) -> Any:
    """Fill a nav_msgs/msg/Path with poses."""
    geometry = load("geometry_msgs.msg")
    message.header.frame_id, message.header.stamp = frame, node.get_clock().now().to_msg()
    for pose in path:
        made = geometry.PoseStamped(header=message.header)
        made.pose.position.x, made.pose.position.y = pose.x, pose.y
        made.pose.orientation.z = math.sin(pose.heading / 2)
        made.pose.orientation.w = math.cos(pose.heading / 2)
        message.poses.append(made)
    return message


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about the vertical axis of a quaternion, in radians."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _ns(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def with_parameters(node: Any, settings: RosSettings) -> RosSettings:
    """Declare the settings as parameters of the node, such as `limits.jump_m`, and return them."""
    wrong = load("rclpy.exceptions").InvalidParameterTypeException
    read_only = load("rcl_interfaces.msg").ParameterDescriptor(read_only=True)
    changes: dict[str, dict[str, Any]] = {}
    for table in ("frames", "topics", "drive", "limits"):
        values = msgspec.to_builtins(getattr(settings, table))
        for key, value in values.items():
            try:
                taken = node.declare_parameter(f"{table}.{key}", value, read_only).value
            except wrong as error:
                raise InputError(f"parameter {table}.{key}: {error}") from None
            changes.setdefault(table, {})[key] = list(taken) if isinstance(value, list | tuple) else taken
    return changed_settings(settings, changes)


def _spin(executor: Any, telemetry: RosTelemetry) -> None:
    """Run the node's callbacks; an error ends that, and the telemetry says so: the robot is then held."""
    try:
        executor.spin()
    except Exception as error:  # noqa: BLE001 (the thread ends here)
        telemetry.fault = f"{type(error).__name__}: {error}"


@contextmanager
def open_rclpy(settings: RosSettings, clock: Clock, *, ros_args: Sequence[str] = ()) -> Iterator[RclpyPort]:
    """Run a node for as long as the block lasts; `ros_args` are those after --ros-args."""
    rclpy = load("rclpy")
    context = rclpy.Context()
    none = load("rclpy.signals").SignalHandlerOptions.NO
    try:
        rclpy.init(args=["stopgo", *ros_args], context=context, signal_handler_options=none)
        node = rclpy.create_node(settings.node, context=context)
        settings = with_parameters(node, settings)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{' '.join(ros_args)}: ROS 2 does not take it ({error})") from None
    telemetry = RosTelemetry(clock, settings.frames, settings.limits)
    executor = load("rclpy.executors").SingleThreadedExecutor(context=context)
    executor.add_node(node)
    guard: GoalGuard | None = None
    try:
        port = RclpyPort(node, settings, telemetry, clock)
        guard = GoalGuard(port.guarded, lambda: port.drives, lambda why: setattr(telemetry, "unguarded", why))
        port.before_goal = guard.will_drive
        threading.Thread(target=_spin, args=(executor, telemetry), name="ros2", daemon=True).start()
        yield port
    finally:
        if guard is not None:
            guard.close()
        executor.shutdown(timeout_sec=2.0)
        context.try_shutdown()
