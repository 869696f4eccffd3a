"""Two nodes over zenoh in one process: services, lost answers, late subscribers, names and time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from queue import Queue
from typing import Any

import pytest

from stopgo.bridge.ros2.drive_lease import LEASE_S, LeaseGuard, lease_key
from stopgo.bridge.ros2.ros_definitions import message_type, service_types
from stopgo.bridge.ros2.zenoh_node import NodeThread, ZenohNode, key_of
from tests.bridge.ros2.zenoh_nav2 import session_at
from tests.ports import free_port

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"
LAST_RESORT_S = 30.0

MakeNode = Callable[..., ZenohNode]


@pytest.fixture
def make_node() -> Iterator[MakeNode]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    faults: list[str] = []
    with ExitStack() as stack:
        stack.enter_context(session_at("router", endpoint))

        def make(name: str, **more: Any) -> ZenohNode:
            session = stack.enter_context(session_at("client", endpoint))
            thread = NodeThread(faults.append)
            stack.callback(thread.close)
            node = ZenohNode(session, 3, "r1", name, thread=thread, **more)
            thread.start()
            return node

        yield make
    assert faults == []


def until(reached: Callable[[], bool]) -> None:
    waited = threading.Event()
    for _ in range(round(LAST_RESORT_S / 0.02)):
        if reached():
            return
        waited.wait(0.02)
    raise AssertionError("not reached")


def test_a_service_is_found_and_answers(make_node: MakeNode) -> None:
    server, asking = make_node("server"), make_node("asking")
    client = asking.client(TRIGGER, "/r1/server/pause")
    assert client.missing() == "no service /r1/server/pause (std_srvs/srv/Trigger)"
    server.serve(TRIGGER, "~/pause", lambda: {"success": True, "message": "PAUSED"})
    until(lambda: not client.missing())
    answers: Queue[Any] = Queue()
    client.call({}, answers.put)
    answer = answers.get(timeout=LAST_RESORT_S)
    assert (answer.success, answer.message) == (True, "PAUSED")


def test_a_request_with_a_damaged_attachment_is_not_answered_and_ends_nothing(make_node: MakeNode) -> None:
    server, asking = make_node("server"), make_node("asking")
    client = asking.client(TRIGGER, "/r1/server/pause")
    server.serve(TRIGGER, "~/pause", lambda: {"success": True, "message": "PAUSED"})
    until(lambda: not client.missing())
    (found,) = service_types(TRIGGER)
    key = key_of(3, "/r1/server/pause", TRIGGER, found.hash)
    assert list(asking.session.get(key, payload=found.request.encode({}), attachment=b"short")) == []
    answers: Queue[Any] = Queue()
    client.call({}, answers.put)
    answer = answers.get(timeout=LAST_RESORT_S)
    assert answer is not None
    assert answer.message == "PAUSED"


def test_a_request_without_a_server_has_no_answer(make_node: MakeNode) -> None:
    answers: Queue[Any] = Queue()
    make_node("asking").client(TRIGGER, "scan").call({}, answers.put)
    assert answers.get(timeout=LAST_RESORT_S) is None


def test_a_late_subscriber_gets_what_is_kept(make_node: MakeNode) -> None:
    publisher = make_node("talker").publisher(STRING, "~/state", "kept", depth=1)
    publisher.publish({"data": "first"})
    publisher.publish({"data": "last"})
    heard: Queue[Any] = Queue()
    make_node("listener").subscribe(STRING, "/r1/talker/state", heard.put, "kept")
    assert heard.get(timeout=LAST_RESORT_S).data == "last"


def test_names_are_resolved_as_by_ros(make_node: MakeNode) -> None:
    node = make_node("stopgo")
    assert [node.resolved(name) for name in ("odom", "/tf", "~/state", "~")] == [
        "/r1/odom", "/tf", "/r1/stopgo/state", "/r1/stopgo",
    ]  # fmt: skip


def test_time_is_simulated_if_that_is_wanted(make_node: MakeNode) -> None:
    node = make_node("stopgo", use_sim_time=True)
    clock = make_node("simulator").publisher("rosgraph_msgs/msg/Clock", "/clock")
    assert node.now_ns() == 0

    def ticked() -> bool:
        clock.publish({"clock": {"sec": 5, "nanosec": 7}})
        return node.now_ns() == 5_000_000_007

    until(ticked)


def test_what_there_is_instead_of_a_topic_is_named(make_node: MakeNode) -> None:
    node, other = make_node("stopgo"), make_node("other")
    other.publisher("geometry_msgs/msg/Twist", "odom")
    other.tokens.declare("publisher", "/r1/speech", STRING, "RIHS01_00ff")
    other.publisher(STRING, "chatter")
    until(lambda: node.is_published("chatter"))
    assert node.found_instead(STRING, "odom") == (
        "/r1/odom is of type geometry_msgs/msg/Twist, not std_msgs/msg/String"
    )
    own = message_type(STRING).hash
    assert node.found_instead(STRING, "speech") == (
        f"/r1/speech: two versions of {STRING}: RIHS01_00ff there and {own} here"
    )
    assert node.found_instead(STRING, "voice") == f"topics of type {STRING}: /r1/chatter, /r1/speech"


def test_data_that_are_no_message_are_named(make_node: MakeNode) -> None:
    node, other = make_node("stopgo"), make_node("other")
    heard: Queue[Any] = Queue()
    node.subscribe(STRING, "chatter", heard.put, "reliable")
    key = key_of(3, "/r1/chatter", STRING, message_type(STRING).hash)

    def refused() -> bool:
        other.session.put(key, b"\x00\x01\x00\x00\xff\xff\xff\x7fabc")
        return "a message cannot be decoded" in node.found_instead(STRING, "chatter")

    until(refused)
    assert heard.empty()


def test_a_guard_ignores_what_is_no_sign_of_life(make_node: MakeNode) -> None:
    node, other = make_node("stopgo_guard"), make_node("other")
    said: list[str] = []
    guard = LeaseGuard(node, "/r1/stopgo", said.append)
    answered: Queue[Any] = Queue()
    held = other.session.declare_subscriber(lease_key(3, "/r1/stopgo", "heard"), answered.put)
    for data in (b"", b"{}", b'{"drives": true}', b"\xff"):
        other.session.put(lease_key(3, "/r1/stopgo", "sign"), data)
    threading.Event().wait(LEASE_S * 1.5)
    guard.look()
    assert said == [] and answered.empty()
    held.undeclare()
