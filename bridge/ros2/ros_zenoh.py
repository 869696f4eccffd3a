"""Listening to a ROS 2 network over zenoh, without ROS: nothing is published or called.

The keys are those of rmw_zenoh, or of zenoh-bridge-ros2dds. Messages are decoded by the definitions of ROS 2
Jazzy. A topic whose definition has another hash is not read.
"""

from __future__ import annotations

import json
import math
import struct
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import zenoh

from stopgo.bridge.link.clock import Clock, WallClock
from stopgo.bridge.ros2.nav2_port import ODOMETRY, TF, charge_of, ns_of, take_transforms
from stopgo.bridge.ros2.ros_definitions import Undecodable, message_type
from stopgo.bridge.ros2.ros_graph import BRIDGED_TOKENS, TOKENS, RosEntity, entity_of, hash_text
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.zenoh_node import open_network
from stopgo.mission.errors import InputError

ATTACHMENT = struct.Struct("<qq")
"""Sequence number and source time in nanoseconds; a GID follows."""
REPLIES_S = 2.0
BRIDGED = "dds"
"""Word for the domain of a robot behind zenoh-bridge-ros2dds, whose keys have none."""
BRIDGES_CACHE = "@ros2_pub_cache"
"""Part of the key below which zenoh-bridge-ros2dds keeps messages for late subscribers."""


@dataclass
class HeardTopic:
    """Messages of one topic, counted."""

    entity: RosEntity
    count: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    missed: int = 0
    """Messages that were published and did not arrive, by their sequence numbers."""
    refused: str = ""
    """Why it is not read; empty if it is."""
    wrong: str = ""
    """The last message that could not be decoded, in words."""
    _sequence: int | None = field(default=None, repr=False)

    @property
    def rate(self) -> float:
        """Messages per second."""
        lasted = self.last_s - self.first_s
        return (self.count - 1) / lasted if self.count > 1 and lasted > 0 else 0.0

    def take(self, attachment: bytes, now_s: float) -> None:
        """Count a message that came just now; it is dated by its publisher, if that has dated it."""
        if len(attachment) >= ATTACHMENT.size:
            sequence, sent_ns = ATTACHMENT.unpack_from(attachment)
            now_s = sent_ns / 1e9
            if self._sequence is not None and sequence > self._sequence + 1:
                self.missed += sequence - self._sequence - 1
            self._sequence = sequence
        self.first_s = self.first_s if self.count else now_s
        self.count, self.last_s = self.count + 1, now_s


class RosListener:
    """One robot in a ROS 2 network: its topics below a namespace, and the graph of the whole domain."""

    def __init__(
        self,
        session: Any,
        domain: int | None,
        namespace: str,
        settings: RosSettings,
        clock: Clock | None = None,
    ) -> None:
        self._session = session
        self._domain = domain
        self._clock = clock or WallClock()
        self._lock = threading.Lock()
        self._subscribed: dict[str, Any] = {}
        self.entities: tuple[RosEntity, ...] = ()
        self.telemetry = RosTelemetry(self._clock, settings.frames, settings.limits)
        self.state: dict[str, Any] | None = None
        """The newest state that stopgo's node has published; `None` while there is no such node."""
        base = f"/{namespace.strip('/')}".rstrip("/")
        self._own_tf = {f"{base}/tf": "/tf", f"{base}/tf_static": "/tf_static"}
        self._state_topic = f"{base}/{settings.node}/state"
        self.wanted = {
            f"{base}/{settings.topics.odometry}": (ODOMETRY, self._take_odometry),
            "/tf": (TF, partial(take_transforms, self.telemetry, static=False)),
            "/tf_static": (TF, partial(take_transforms, self.telemetry, static=True)),
            f"{base}/{settings.topics.battery}": ("sensor_msgs/msg/BatteryState", self._take_battery),
            self._state_topic: ("std_msgs/msg/String", self._take_state),
        }
        self.topics: dict[str, HeardTopic] = {}

    @property
    def is_linked(self) -> bool:
        """True while a zenoh router answers."""
        return bool(list(self._session.info.routers_zid()))

    def look(self) -> None:
        """Read the graph, subscribe to what is new of the robot, and drop topics whose publisher has gone."""
        tokens_of = BRIDGED_TOKENS if self._domain is None else f"{TOKENS}/{self._domain}"
        replies = self._session.liveliness().get(f"{tokens_of}/**", timeout=REPLIES_S)
        tokens = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        found = (entity_of(token) for token in sorted(tokens))
        self.entities = tuple(one for one in found if one is not None)
        for name in [name for name, topic in self.topics.items() if topic.entity not in self.entities]:
            self._drop(name)
        for one in self.entities:
            name = self._name_of(one)
            if one.kind == "publisher" and name in self.wanted and name not in self.topics:
                self.topics[name] = self._heard(name, one)

    def _name_of(self, one: RosEntity) -> str:
        """Return a topic's name for the robot: a bridge puts its namespace before tf as well."""
        return self._own_tf.get(one.name, one.name) if one.domain is None else one.name

    def _drop(self, name: str) -> None:
        """Forget a topic, so that its next publisher is checked and its kept message is queried."""
        del self.topics[name]
        if name in self._subscribed:
            self._subscribed.pop(name).undeclare()
        if name == self._state_topic:
            self.state = None

    def _heard(self, name: str, one: RosEntity) -> HeardTopic:
        topic, (kind, take) = HeardTopic(one), self.wanted[name]
        own = message_type(kind).hash
        if one.type != kind:
            topic.refused = f"it is of type {one.type}, not {kind}"
        elif one.hash != own and (one.hash or one.domain is not None):
            topic.refused = hash_text(kind, f"{one.hash} there", f"{own} here")
        else:
            self._subscribed[name] = self._subscribe(topic, kind, take)
        return topic

    def _subscribe(self, topic: HeardTopic, kind: str, take: Any) -> Any:
        def heard(sample: Any) -> None:
            attachment = b"" if sample.attachment is None else bytes(sample.attachment)
            with self._lock:
                topic.take(attachment, self._clock.now_ns() / 1e9)
                try:
                    take(message_type(kind).decode(bytes(sample.payload)))
                except Undecodable as error:
                    topic.wrong = f"a message cannot be decoded ({error})"

        key = topic.entity.key
        if topic.entity.kept:
            past = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
            made = zenoh.ext.declare_advanced_subscriber(self._session, key, heard, history=past)
            if topic.entity.domain is None:
                self._take_cached(key, heard, topic)
        else:
            made = self._session.declare_subscriber(key, heard)
        return made

    def _take_cached(self, key: str, heard: Any, topic: HeardTopic) -> None:
        """Take what a bridge has kept of a topic, unless something newer has come."""
        kept, own_key = f"@/*/{BRIDGES_CACHE}/{key}", zenoh.ReplyKeyExpr.ANY
        for reply in self._session.get(kept, timeout=REPLIES_S, accept_replies=own_key):
            if reply.ok is not None and not topic.count:
                heard(reply.ok)

    def _take_odometry(self, message: Any) -> None:
        speed, stamp_ns = message.twist.twist.linear, ns_of(message.header.stamp)
        behind_s = (time.time_ns() - stamp_ns) / 1e9
        turn = float(message.twist.twist.angular.z)
        self.telemetry.take_odometry(math.hypot(speed.x, speed.y), turn, stamp_ns=stamp_ns, behind_s=behind_s)

    def _take_battery(self, message: Any) -> None:
        self.telemetry.charge = charge_of(message)

    def _take_state(self, message: Any) -> None:
        told = json.loads(message.data)
        self.state = told if isinstance(told, dict) else None


def read_domain(text: str) -> tuple[int | None, str]:
    """Read DOMAIN or DOMAIN/NAMESPACE, such as 0/r1; the domain is `None` for `dds`."""
    domain, _, namespace = text.partition("/")
    if domain == BRIDGED:
        return None, namespace
    if not domain.isdecimal() or int(domain) > 232:
        raise InputError(
            f"--ros2 {text}: write the domain's number, 0 to 232, or DOMAIN/NAMESPACE, as 0/r1;"
            f" behind zenoh-bridge-ros2dds, {BRIDGED}/r1"
        )
    return int(domain), namespace


@contextmanager
def ros_listener(
    endpoints: Sequence[str], domain: int | None, namespace: str, settings: RosSettings
) -> Iterator[RosListener]:
    """Listen at a zenoh router, as a client, for as long as the block lasts.

    Raises
    ------
    RobotUnreachable
        If there is no router.
    """
    with open_network(endpoints) as session:
        yield RosListener(session, domain, namespace, settings)
