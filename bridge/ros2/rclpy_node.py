"""A node of ROS 2 by rclpy; no other module loads ROS. As a program, the guard of a robot.

The node's callbacks run in a thread of its own. They store what came, and wait for nothing.
"""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.ros2.goal_guard import GoalGuard, guard
from stopgo.bridge.ros2.nav2_port import Nav2Port
from stopgo.bridge.ros2.ros_port import GoalEvents, RosQuality
from stopgo.bridge.ros2.ros_settings import RosSettings, changed_settings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.ros_types import MessageKind, RosFields
from stopgo.mission.errors import InputError, MissingExtra


def load(module: str) -> Any:
    """Load a module of ROS; raises `MissingExtra` if ROS's Python packages are not there."""
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtra(
            f"--controller ros2: no Python module {module} ({error});"
            " run `source /opt/ros/jazzy/setup.bash` first, and start stopgo with ROS's Python"
        ) from None


def loaded_type(name: str) -> Any:
    """Return the class of a type such as nav_msgs/msg/Path."""
    package, kind, type_ = name.split("/")
    return getattr(load(f"{package}.{kind}"), type_)


def _configured_type(name: str) -> Any:
    """Return the class of a type that a user has named."""
    package, kind, type_ = name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), type_)
    except (ImportError, AttributeError) as error:
        raise InputError(f"scan.type = {name!r}: there is no such type here ({error})") from None


class ClassKind:
    """A message class that rosidl has generated (`MessageKind`)."""

    def __init__(self, cls: Any) -> None:
        self.name: str = cls.__name__
        self.fields: Mapping[str, str] = cls.get_fields_and_field_types()
        self._class = cls
        self._inner: dict[str, ClassKind] = {}

    def inner(self, field: str) -> ClassKind:
        if field not in self._inner:
            match = re.search(r"([a-z][a-z0-9_]*)/(\w+)", self.fields[field])
            assert match is not None, f"{self.name}.{field} is no message"
            value = getattr(self._class(), field)
            cls = loaded_type(f"{match[1]}/msg/{match[2]}") if isinstance(value, list) else type(value)
            self._inner[field] = ClassKind(cls)
        return self._inner[field]

    def message(self, fields: RosFields) -> Any:
        made = self._class()
        for field, value in fields.items():
            setattr(made, field, self._as_value(field, value))
        return made

    def _as_value(self, field: str, value: Any) -> Any:
        if isinstance(value, Mapping):
            return self.inner(field).message(value)
        if isinstance(value, list) and "/" in self.fields[field]:
            kind = self.inner(field)
            return [kind.message(one) for one in value]
        return bytes([value]) if self.fields[field] == "octet" else value


class RclpyPublisher:
    def __init__(self, publisher: Any, cls: Any) -> None:
        self._publisher = publisher
        self._kind = ClassKind(cls)

    def publish(self, fields: RosFields) -> None:
        self._publisher.publish(self._kind.message(fields))

    def is_heard(self) -> bool:
        return bool(self._publisher.get_subscription_count())


class RclpyClient:
    """A client of a service (`RosClient`)."""

    def __init__(self, node: Any, kind: str, service: str) -> None:
        cls = loaded_type(kind)
        self._client = node.create_client(cls, service)
        self._request = ClassKind(cls.Request)
        self._words = f"no service {service} ({kind})"

    def missing(self) -> str:
        return "" if self._client.service_is_ready() else self._words

    def call(self, fields: RosFields, answered: Callable[[Any], None] = lambda response: None) -> None:
        future = self._client.call_async(self._request.message(fields))
        future.add_done_callback(lambda done: answered(None if done.exception() else done.result()))


class RclpyActionClient:
    """A client of an action (`RosActionClient`)."""

    def __init__(self, node: Any, kind: str, action: str) -> None:
        cls = loaded_type(kind)
        self._client = load("rclpy.action").ActionClient(node, cls, action)
        self.goal: MessageKind = ClassKind(cls.Goal)
        self.result: MessageKind = ClassKind(cls.Result)
        self._words = f"no action server {action} ({kind})"

    def missing(self) -> str:
        return "" if self._client.server_is_ready() else self._words

    def send(self, goal_id: bytes, fields: RosFields, events: GoalEvents) -> None:
        def answered(future: Any) -> None:
            handle = future.result()
            is_accepted = handle is not None and handle.accepted
            events.accepted(is_accepted)
            if is_accepted:
                handle.get_result_async().add_done_callback(ended)

        def ended(future: Any) -> None:
            events.ended(future.result().status, future.result().result)

        uuid = load("unique_identifier_msgs.msg").UUID(uuid=list(goal_id))
        future = self._client.send_goal_async(self.goal.message(fields), goal_uuid=uuid)
        future.add_done_callback(answered)


class RclpyNode:
    """A node of ROS 2 (`stopgo.bridge.ros2.ros_port.RosNode`)."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self.name: str = node.get_name()
        self.namespace: str = node.get_namespace()

    def now_ns(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def resolved(self, name: str) -> str:
        return str(self._node.resolve_topic_name(name))

    def every(self, seconds: float, happens: Callable[[], None]) -> None:
        self._node.create_timer(seconds, happens)

    def subscribe(
        self, kind: str, topic: str, take: Callable[[Any], None], quality: RosQuality, depth: int = 50
    ) -> None:
        self._node.create_subscription(loaded_type(kind), topic, take, _profile(quality, depth))

    def publisher(
        self, kind: str, topic: str, quality: RosQuality = "reliable", depth: int = 10
    ) -> RclpyPublisher:
        cls = loaded_type(kind)
        return RclpyPublisher(self._node.create_publisher(cls, topic, _profile(quality, depth)), cls)

    def client(self, kind: str, service: str) -> RclpyClient:
        return RclpyClient(self._node, kind, service)

    def action_client(self, kind: str, action: str) -> RclpyActionClient:
        return RclpyActionClient(self._node, kind, action)

    def serve(self, kind: str, service: str, answer: Callable[[], RosFields]) -> None:
        cls = loaded_type(kind)
        response = ClassKind(cls.Response)
        self._node.create_service(cls, service, lambda request, empty: response.message(answer()))

    def is_published(self, topic: str) -> bool:
        return bool(self._node.count_publishers(topic))

    def publishers(self, topic: str) -> frozenset[str]:
        found = self._node.get_publishers_info_by_topic(self.resolved(topic))
        return frozenset(bytes(one.endpoint_gid).hex() for one in found)

    def service_kinds(self, kind: str) -> tuple[ClassKind, ClassKind]:
        cls = _configured_type(kind)
        return ClassKind(cls.Request), ClassKind(cls.Response)

    def action_kinds(self, kind: str) -> tuple[ClassKind, ClassKind]:
        cls = _configured_type(kind)
        return ClassKind(cls.Goal), ClassKind(cls.Result)

    def found_instead(self, kind: str, topic: str) -> str:
        topics, own = dict(self._node.get_topic_names_and_types()), self.resolved(topic)
        if own in topics and kind not in topics[own]:
            return f"{own} is of type {', '.join(topics[own])}, not {kind}"
        same = [name for name, kinds in topics.items() if kind in kinds and self.is_published(name)]
        return f"topics of type {kind}: {', '.join(sorted(same)) or 'none'}"


def _profile(quality: RosQuality, depth: int) -> Any:
    qos = load("rclpy.qos")
    if quality == "kept":
        return qos.QoSProfile(depth=depth, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
    if quality == "best effort":
        return qos.QoSProfile(depth=depth, reliability=qos.ReliabilityPolicy.BEST_EFFORT)
    return qos.QoSProfile(depth=depth)


def with_parameters(node: Any, settings: RosSettings) -> RosSettings:
    """Declare the settings as parameters of the node, such as `limits.jump_m`, and return them."""
    wrong = load("rclpy.exceptions").InvalidParameterTypeException
    read_only = load("rcl_interfaces.msg").ParameterDescriptor(read_only=True)

    def declared(name: str, value: Any) -> Any:
        try:
            taken = node.declare_parameter(name, value, read_only).value
        except wrong as error:
            raise InputError(f"parameter {name}: {error}") from None
        return list(taken) if isinstance(value, list | tuple) else taken

    changes: dict[str, Any] = {"autostart_node": declared("autostart_node", settings.autostart_node)}
    for table in ("frames", "topics", "drive", "limits"):
        values = msgspec.to_builtins(getattr(settings, table))
        changes[table] = {key: declared(f"{table}.{key}", value) for key, value in values.items()}
    return changed_settings(settings, changes)


UNCONFIGURED = "the lifecycle node is unconfigured; configure and activate it"
INACTIVE = "the lifecycle node is inactive; activate it"
FINALIZED = "the lifecycle node is shut down; start the program again"


def _managed_node(name: str, context: Any) -> Any:
    """Make a lifecycle node, which says at each transition why the robot must not drive."""
    lifecycle = load("rclpy.lifecycle")

    class ManagedNode(lifecycle.LifecycleNode):
        """A lifecycle node; `said` takes why it may drive nothing, empty once it is active."""

        said: Callable[[str], None] = staticmethod(lambda why: None)

        def _says(self, why: str) -> Any:
            self.said(why)
            return lifecycle.TransitionCallbackReturn.SUCCESS

        def on_configure(self, state: Any) -> Any:
            return self._says(INACTIVE)

        def on_activate(self, state: Any) -> Any:
            return self._says("")

        def on_deactivate(self, state: Any) -> Any:
            return self._says(INACTIVE)

        def on_cleanup(self, state: Any) -> Any:
            return self._says(UNCONFIGURED)

        def on_shutdown(self, state: Any) -> Any:
            return self._says(FINALIZED)

    return ManagedNode(name, context=context)


def _begin_life_cycle(node: Any, port: Nav2Port) -> None:
    """Let the robot drive only while its node is active; a node that leaves that state stops it at once."""

    def said(why: str) -> None:
        port.telemetry.say_inactive(why)
        if why:
            port.stand()

    node.said = said
    port.telemetry.say_inactive(UNCONFIGURED)
    if port.settings.autostart_node:
        node.trigger_configure()
        node.trigger_activate()


def _spin(executor: Any, telemetry: RosTelemetry) -> None:
    """Run the node's callbacks; an error ends that, and the telemetry says so: the robot is then held."""
    try:
        executor.spin()
    except Exception as error:  # noqa: BLE001 (the thread ends here)
        telemetry.fault = f"{type(error).__name__}: {error}"


@contextmanager
def open_rclpy(settings: RosSettings, clock: Clock, *, ros_args: Sequence[str] = ()) -> Iterator[Nav2Port]:
    """Run a node for as long as the block lasts; `ros_args` are those after --ros-args."""
    rclpy = load("rclpy")
    context = rclpy.Context()
    none = load("rclpy.signals").SignalHandlerOptions.NO
    try:
        rclpy.init(args=["stopgo", *ros_args], context=context, signal_handler_options=none)
        node = _managed_node(settings.node, context)
        settings = with_parameters(node, settings)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{' '.join(ros_args)}: ROS 2 does not take it ({error})") from None
    telemetry = RosTelemetry(clock, settings.frames, settings.limits)
    executor = load("rclpy.executors").SingleThreadedExecutor(context=context)
    executor.add_node(node)
    process: GoalGuard | None = None
    try:
        port = Nav2Port(RclpyNode(node), settings, telemetry, clock)
        process = GoalGuard(port.guarded, lambda: port.drives, telemetry.say_unguarded, __name__)
        port.before_goal = process.will_drive
        _begin_life_cycle(node, port)
        threading.Thread(target=_spin, args=(executor, telemetry), name="ros2", daemon=True).start()
        yield port
    finally:
        if process is not None:
            process.close()
        executor.shutdown(timeout_sec=2.0)
        context.try_shutdown()


if __name__ == "__main__":
    wanted = json.loads(sys.argv[1])
    load("rclpy").init(args=[])
    guard(RclpyNode(load("rclpy").create_node(wanted["node"])), wanted, sys.stdin.fileno())
