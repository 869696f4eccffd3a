"""A node of ROS 2 over zenoh, with the keys, tokens and attachments of rmw_zenoh; no ROS is needed.

zenoh's threads only put what came into the queue of the node's own thread, which decodes it and calls back. A
request without a reply says nothing about what the server has done with it.
"""

from __future__ import annotations

import hashlib
import heapq
import itertools
import json
import queue
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import zenoh

from stopgo.bridge.link.zenoh_link import COMMON, RETRY
from stopgo.bridge.ros2.ros_definitions import (
    CdrType,
    ServiceType,
    Undecodable,
    action_types,
    message_type,
    service_types,
)
from stopgo.bridge.ros2.ros_graph import RosEntity, hash_text
from stopgo.bridge.ros2.ros_port import GoalEvents, RosQuality
from stopgo.bridge.ros2.ros_types import MessageKind, RosFields
from stopgo.bridge.ros2.zenoh_graph import LiveGraph, NodeTokens
from stopgo.mission.errors import RobotUnreachable

ATTACHMENT = struct.Struct("<qqB16s")
"""Sequence number, source time in nanoseconds, and the GID with its length."""
GID_BYTES = 16
ANSWER_S = 10.0
RESULT_S = 86_400.0
"""Longest wait for the reply of a service, and for the result of an action."""
AGAIN_S, TIMES = 0.5, 240
"""Interval and number of further requests for a result whose reply was lost."""
HEARTBEAT_S = 1.0


class NodeThread:
    """Runs callbacks one after the other, in its own thread."""

    def __init__(self, report: Callable[[str], None]) -> None:
        """`report` takes the error of a callback, which ends the thread."""
        self._report = report
        self._arrived: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._thread = threading.Thread(target=self._run, name="ros2 over zenoh", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def soon(self, happens: Callable[[], None]) -> None:
        self._arrived.put(happens)

    def later(self, seconds: float, happens: Callable[[], None]) -> None:
        due = (time.monotonic() + seconds, next(self._numbers), happens)
        self._arrived.put(lambda: heapq.heappush(self._due, due))

    def every(self, seconds: float, happens: Callable[[], None]) -> None:
        def again() -> None:
            self.later(seconds, again)
            happens()

        self.later(seconds, again)

    def close(self) -> None:
        self._arrived.put(None)
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            while (happens := self._next()) is not None:
                happens()
        except Exception as error:  # noqa: BLE001 (the thread ends here)
            self._report(f"{type(error).__name__}: {error}")

    def _next(self) -> Callable[[], None] | None:
        while True:
            left_s = self._due[0][0] - time.monotonic() if self._due else None
            if left_s is not None and left_s <= 0:
                return heapq.heappop(self._due)[2]
            try:
                return self._arrived.get(timeout=left_s)
            except queue.Empty:
                continue


class Attachments:
    """Attachments of one publisher, or of one client."""

    def __init__(self, token: str) -> None:
        self.token = token
        self._gid = hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()
        self._numbers = itertools.count(1)

    def next(self) -> bytes:
        return ATTACHMENT.pack(next(self._numbers), time.time_ns(), GID_BYTES, self._gid)


def answering(attachment: bytes) -> bytes:
    """Return the attachment of a reply: the request's, with the time of the reply."""
    number, _, length, gid = ATTACHMENT.unpack_from(attachment)
    return ATTACHMENT.pack(number, time.time_ns(), length, gid)


class ZenohPublisher:
    def __init__(self, node: ZenohNode, kind: CdrType, topic: str, quality: RosQuality, depth: int) -> None:
        self._kind = kind
        self._graph, self._topic = node.graph, topic
        key = key_of(node.domain, topic, kind.name, kind.hash)
        if quality == "kept":
            misses = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT_S)
            self._publisher = zenoh.ext.declare_advanced_publisher(
                node.session, key, cache=zenoh.ext.CacheConfig(depth), sample_miss_detection=misses,
                publisher_detection=True,
            )  # fmt: skip
        else:
            self._publisher = node.session.declare_publisher(key)
        token = node.tokens.declare("publisher", topic, kind.name, kind.hash, quality, depth)
        self._attachments = Attachments(token)

    def publish(self, fields: RosFields) -> None:
        self._publisher.put(self._kind.encode(fields), attachment=self._attachments.next())

    def is_heard(self) -> bool:
        return bool(self._graph.of("subscriber", self._topic))


class ZenohClient:
    """A client of a service (`RosClient`), in the version that its server has."""

    def __init__(self, node: ZenohNode, versions: Sequence[ServiceType], service: str) -> None:
        self._node = node
        self._versions = {one.hash: one for one in versions}
        self._service = service
        self._announced: tuple[str, Attachments] | None = None
        if len(self._versions) == 1:
            self._announce()

    def _announce(self) -> Attachments:
        """Declare the token of this client, in the version of its server; return its attachments."""
        found = self.hash
        if self._announced is None or self._announced[0] != found:
            if self._announced is not None:
                self._node.tokens.withdraw(self._announced[1].token)
            token = self._node.tokens.declare("client", self._service, self._any.name, found)
            self._announced = (found, Attachments(token))
        return self._announced[1]

    def missing(self) -> str:
        servers = self._node.graph.of("server", self._service)
        known = self._versions
        if not servers:
            return f"no service {self._service} ({self._any.name})"
        wrong = next((one for one in servers if one.hash not in known or one.type != self._any.name), None)
        return "" if wrong is None else f"{self._service}: {self._discord(wrong)}"

    def _discord(self, server: RosEntity) -> str:
        if server.type != self._any.name:
            return f"it is of type {server.type}, not {self._any.name}"
        here = " or ".join(one.words for one in self._versions.values())
        return hash_text(server.type, f"{server.hash} there", f"{here} here")

    @property
    def _any(self) -> ServiceType:
        return next(iter(self._versions.values()))

    @property
    def hash(self) -> str:
        """Hash of the version that the server has; of any if there is none."""
        servers = self._node.graph.of("server", self._service)
        return next((one.hash for one in servers if one.hash in self._versions), self._any.hash)

    def call(
        self,
        fields: RosFields,
        answered: Callable[[Any], None] = lambda response: None,
        timeout_s: float = ANSWER_S,
    ) -> None:
        kind, soon = self._versions[self.hash], self._node.thread.soon
        replies: list[Any] = []

        def over() -> None:
            """Take the reply, or its absence, in zenoh's thread."""
            soon(lambda: answered(_decoded(kind.response, replies)))

        key = key_of(self._node.domain, self._service, kind.name, kind.hash)
        self._node.session.get(
            key, zenoh.handlers.Callback(replies.append, over), target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE, timeout=timeout_s,
            payload=kind.request.encode(fields), attachment=self._announce().next(),
        )  # fmt: skip


def _decoded(kind: CdrType, replies: Sequence[Any]) -> Any:
    """Return the first reply that is a response; `None` if there is none."""
    for reply in replies:
        if reply.ok is not None:
            try:
                return kind.decode(bytes(reply.ok.payload))
            except Undecodable:
                continue
    return None


class ZenohActionClient:
    """A client of an action (`RosActionClient`)."""

    def __init__(self, node: ZenohNode, kind: str, action: str, folder: str) -> None:
        versions = action_types(kind, folder)
        self._node = node
        self._words = f"no action server {action} ({kind})"
        self._versions = {one.send_goal.hash: one for one in versions}
        below = f"{action}/_action"
        self._send_goal = ZenohClient(node, [one.send_goal for one in versions], f"{below}/send_goal")
        results = {one.get_result.hash: one.get_result for one in versions}
        self._get_result = ZenohClient(node, list(results.values()), f"{below}/get_result")

    def missing(self) -> str:
        why = self._send_goal.missing() or self._get_result.missing()
        return self._words if why.startswith("no service") else why

    @property
    def goal(self) -> MessageKind:
        return self._versions[self._send_goal.hash].goal

    @property
    def result(self) -> MessageKind:
        return self._versions[self._send_goal.hash].result

    def send(self, goal_id: bytes, fields: RosFields, events: GoalEvents) -> None:
        uuid = {"uuid": list(goal_id)}

        def answered(response: Any) -> None:
            if response is not None:
                events.accepted(bool(response.accepted))
                if response.accepted:
                    self._ask_result(uuid, events, TIMES)

        self._send_goal.call({"goal_id": uuid, "goal": fields}, answered)

    def _ask_result(self, uuid: RosFields, events: GoalEvents, times: int) -> None:
        """Ask for the result, which the server holds until the goal is over; again if the reply is lost."""

        def answered(response: Any) -> None:
            if response is not None:
                events.ended(int(response.status), response.result)
            elif times:
                self._node.thread.later(AGAIN_S, lambda: self._ask_result(uuid, events, times - 1))

        self._get_result.call({"goal_id": uuid}, answered, RESULT_S)


class ZenohNode:
    """A node of ROS 2 (`stopgo.bridge.ros2.ros_port.RosNode`)."""

    def __init__(
        self, session: Any, domain: int, namespace: str, name: str, *, thread: NodeThread,
        use_sim_time: bool = False, definitions: str = "",
    ) -> None:  # fmt: skip
        """`definitions` is a folder with packages of further types."""
        self.session = session
        self.domain = domain
        self.name = name
        self.namespace = f"/{namespace.strip('/')}"
        self.thread = thread
        self.graph = LiveGraph(session, domain)
        self.tokens = NodeTokens(session, domain, self.namespace, name)
        self._definitions = definitions
        self._held: list[Any] = []
        self._wrong: dict[str, str] = {}
        self._sim_ns: int | None = 0 if use_sim_time else None
        if use_sim_time:
            self.subscribe("rosgraph_msgs/msg/Clock", "/clock", self._take_clock, "best effort", depth=1)

    def _take_clock(self, message: Any) -> None:
        self._sim_ns = int(message.clock.sec) * 10**9 + int(message.clock.nanosec)

    def now_ns(self) -> int:
        return time.time_ns() if self._sim_ns is None else self._sim_ns

    def resolved(self, name: str) -> str:
        own = self.namespace.rstrip("/")
        if name.startswith("~"):
            return f"{own}/{self.name}{name[1:]}"
        return name if name.startswith("/") else f"{own}/{name}"

    def every(self, seconds: float, happens: Callable[[], None]) -> None:
        self.thread.every(seconds, happens)

    def subscribe(
        self, kind: str, topic: str, take: Callable[[Any], None], quality: RosQuality, depth: int = 50
    ) -> None:
        found, name = message_type(kind), self.resolved(topic)
        key = key_of(self.domain, name, kind, found.hash)

        def heard(sample: Any) -> None:
            data = bytes(sample.payload)
            self.thread.soon(lambda: self._take(found, name, data, take))

        if quality == "kept":
            past = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=depth)
            made = zenoh.ext.declare_advanced_subscriber(self.session, key, heard, history=past)
        else:
            made = self.session.declare_subscriber(key, heard)
        self._held.append(made)
        self.tokens.declare("subscriber", name, kind, found.hash, quality, depth)

    def _take(self, kind: CdrType, topic: str, data: bytes, take: Callable[[Any], None]) -> None:
        try:
            message = kind.decode(data)
        except Undecodable as error:
            self._wrong[topic] = f"{topic}: a message cannot be decoded ({error})"
            return
        take(message)

    def publisher(
        self, kind: str, topic: str, quality: RosQuality = "reliable", depth: int = 10
    ) -> ZenohPublisher:
        return ZenohPublisher(self, message_type(kind), self.resolved(topic), quality, depth)

    def client(self, kind: str, service: str) -> ZenohClient:
        return ZenohClient(self, service_types(kind, self._definitions), self.resolved(service))

    def action_client(self, kind: str, action: str) -> ZenohActionClient:
        return ZenohActionClient(self, kind, self.resolved(action), self._definitions)

    def serve(self, kind: str, service: str, answer: Callable[[], RosFields]) -> None:
        (found,), name = service_types(kind), self.resolved(service)
        key = key_of(self.domain, name, kind, found.hash)

        def reply(query: Any) -> None:
            with query:
                attachment = b"" if query.attachment is None else bytes(query.attachment)
                if len(attachment) >= ATTACHMENT.size:
                    query.reply(key, found.response.encode(answer()), attachment=answering(attachment))

        queryable = self.session.declare_queryable(
            key, lambda query: self.thread.soon(lambda: reply(query)), complete=True
        )
        self._held.append(queryable)
        self.tokens.declare("server", name, kind, found.hash)

    def is_published(self, topic: str) -> bool:
        return bool(self.graph.of("publisher", self.resolved(topic)))

    def publishers(self, topic: str) -> frozenset[str]:
        return frozenset(one.source for one in self.graph.of("publisher", self.resolved(topic)))

    def service_kinds(self, kind: str) -> tuple[MessageKind, MessageKind]:
        (found,) = service_types(kind, self._definitions)
        return found.request, found.response

    def action_kinds(self, kind: str) -> tuple[MessageKind, MessageKind]:
        found = action_types(kind, self._definitions)[0]
        return found.goal, found.result

    def found_instead(self, kind: str, topic: str) -> str:
        name, own = self.resolved(topic), message_type(kind).hash
        for one in self.graph.of("publisher", name):
            if one.type != kind:
                return f"{name} is of type {one.type}, not {kind}"
            if one.hash != own:
                return f"{name}: {hash_text(kind, f'{one.hash} there', f'{own} here')}"
        same = ", ".join(self.graph.names_of("publisher", kind)) or "none"
        return self._wrong.get(name) or f"topics of type {kind}: {same}"


def key_of(domain: int, name: str, kind: str, hash_: str) -> str:
    """Return the key expression of a topic or service."""
    return RosEntity(domain, "node", "", name, kind, hash_).key


@contextmanager
def open_network(endpoints: Sequence[str]) -> Iterator[Any]:
    """Open a session with a zenoh router, as a client, for as long as the block lasts.

    Raises
    ------
    RobotUnreachable
        If there is no router.
    """
    config = zenoh.Config()
    found = {**COMMON, "mode": "client", "connect/endpoints": list(endpoints), "connect/retry": RETRY}
    for key, value in found.items():
        config.insert_json5(key, json.dumps(value))
    try:
        session = zenoh.open(config)
    except zenoh.ZError:
        raise RobotUnreachable(f"{','.join(endpoints)}: no zenoh router answers there") from None
    with session:
        yield session
