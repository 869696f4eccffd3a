"""A robot's topics over rmw_zenoh's keys, read in this process from a robot that is played here."""

from __future__ import annotations

import json
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
import pytest
import typer
import zenoh
from rosbags.typesys import Stores, get_typestore

from stopgo.bridge.commands import ros_checks, watch_commands
from stopgo.bridge.commands.ros_checks import graph_checks, ros_status_text, state_of
from stopgo.bridge.commands.ros_watch import followed
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_zenoh import HeardTopic, RosListener, read_domain, ros_listener
from stopgo.command_line import main as stopgo
from stopgo.mission.errors import InputError
from tests.bridge.proxy import Proxy
from tests.bridge.ros2.zenoh_nav2 import session_at
from tests.ports import free_port

TYPES = get_typestore(Stores.ROS2_JAZZY)
ODOMETRY, STRING = "nav_msgs::msg::dds_::Odometry_", "std_msgs::msg::dds_::String_"


@pytest.fixture(scope="module")
def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture(scope="module")
def sessions(endpoint: str) -> Iterator[tuple[Any, Any]]:
    """A robot's session, and a station's."""

    def opened(mode: str, key: str) -> Any:
        config = zenoh.Config()
        for name, value in {"mode": mode, key: [endpoint], "scouting/multicast/enabled": False}.items():
            config.insert_json5(name, json.dumps(value))
        return zenoh.open(config)

    with opened("router", "listen/endpoints") as robot, opened("client", "connect/endpoints") as station:
        yield robot, station


def announced(robot: Any, hash_: str, domain: int) -> Any:
    tail = f"%r1%odom/{ODOMETRY}/{hash_}/::,10:,:,:,,"
    return robot.liveliness().declare_token(f"@ros2_lv/{domain}/abc/0/4/MP/%/%r1/base/{tail}")


def odometry(speed: float) -> bytes:
    kind = TYPES.types
    place, turn, zero = (kind[f"geometry_msgs/msg/{name}"] for name in ("Point", "Quaternion", "Vector3"))
    header = kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](1, 0), "odom")
    pose = kind["geometry_msgs/msg/Pose"](place(0.0, 0.0, 0.0), turn(0.0, 0.0, 0.0, 1.0))
    twist = kind["geometry_msgs/msg/Twist"](zero(speed, 0.0, 0.0), zero(0.0, 0.0, 0.0))
    made = kind["nav_msgs/msg/Odometry"](
        header, "base_link", kind["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        kind["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
    )  # fmt: skip
    return bytes(TYPES.serialize_cdr(made, "nav_msgs/msg/Odometry"))


def test_a_robots_odometry_is_decoded_and_lost_messages_are_counted(sessions: tuple[Any, Any]) -> None:
    robot, station = sessions
    own = TYPES.hash_rihs01("nav_msgs/msg/Odometry")
    token = announced(robot, own, 7)
    listener = RosListener(station, 7, "r1", RosSettings())
    heard = threading.Event()
    take = listener.telemetry.take_odometry

    def taken(*given: Any, **named: Any) -> None:
        take(*given, **named)
        if listener.telemetry.speed() == 0.5:
            heard.set()

    listener.telemetry.take_odometry = taken  # type: ignore[method-assign]
    while "/r1/odom" not in listener.topics:
        listener.look()
    number = 0
    while not heard.is_set():  # until the subscription has reached the robot
        number += 2
        attachment = struct.pack("<qqB", number, number * 10**8, 16) + bytes(16)
        robot.put(f"7/r1/odom/{ODOMETRY}/{own}", odometry(0.5), attachment=attachment)
        heard.wait(0.02)
    topic = listener.topics["/r1/odom"]
    assert not topic.refused and not topic.wrong
    assert listener.telemetry.clock_offset_s is not None
    token.undeclare()


def test_a_type_of_another_version_is_refused_naming_both(sessions: tuple[Any, Any]) -> None:
    robot, station = sessions
    token = announced(robot, "RIHS01_00ff", 8)
    listener = RosListener(station, 8, "r1", RosSettings())
    while "/r1/odom" not in listener.topics:
        listener.look()
    own = TYPES.hash_rihs01("nav_msgs/msg/Odometry")
    said = f"two versions of nav_msgs/msg/Odometry: RIHS01_00ff there and {own} here"
    assert listener.topics["/r1/odom"].refused == said
    (check,) = (check for check in graph_checks(listener) if check.name == "/r1/odom")
    assert not check.ok and said in check.result
    token.undeclare()


def test_sequence_numbers_show_what_was_missed_and_source_times_the_rate(sessions: tuple[Any, Any]) -> None:
    topic = HeardTopic(entity=None)  # type: ignore[arg-type]
    for number, seconds in ((1, 0.0), (2, 0.1), (5, 0.4)):
        topic.take(struct.pack("<qq", number, round(seconds * 1e9)), now_s=0.0)
    assert (topic.count, topic.missed, round(topic.rate, 3)) == (3, 2, 5.0)


@pytest.mark.parametrize("text", ["", "r1", "-1", "233", "0x1"])
def test_a_domain_is_a_number(text: str) -> None:
    with pytest.raises(InputError, match="0 to 232"):
        read_domain(text)
    assert read_domain("7/fleet/r1") == (7, "fleet/r1")
    assert read_domain("dds/r1") == (None, "r1")


def state_message(**state: Any) -> bytes:
    made = TYPES.types["std_msgs/msg/String"](data=json.dumps(state))
    return bytes(TYPES.serialize_cdr(made, "std_msgs/msg/String"))


def state_announced(robot: Any, hash_: str, domain: int, session: str = "abc") -> Any:
    tail = f"%r1%stopgo%state/{STRING}/{hash_}/1:1:,1:,:,:,,"
    return robot.liveliness().declare_token(f"@ros2_lv/{domain}/{session}/0/5/MP/%/%r1/stopgo/{tail}")


@contextmanager
def stating(robot: Any, domain: int) -> Iterator[Any]:
    """A publisher of the robot's state, which late listeners get as well."""
    hash_ = TYPES.hash_rihs01("std_msgs/msg/String")
    token = state_announced(robot, hash_, domain)
    cache = zenoh.ext.CacheConfig(max_samples=1)
    publisher = zenoh.ext.declare_advanced_publisher(
        robot, f"{domain}/r1/stopgo/state/{STRING}/{hash_}", cache=cache
    )
    yield publisher
    publisher.undeclare()
    token.undeclare()


def test_each_change_of_a_run_is_shown_until_it_is_over(sessions: tuple[Any, Any]) -> None:
    robot, station = sessions
    states = [
        {"state": "READY"},
        {"state": "RUNNING", "stop": "s01", "stop_state": "DRIVING"},
        {"state": "RUNNING", "stop": "s01", "stop_state": "DRIVING", "battery": 0.5},
        {"state": "RUNNING", "stop": "s02", "stop_state": "SCANNING", "done_count": 1},
        {"state": "FINISHED", "done_count": 2},
    ]
    with stating(robot, 9) as publisher:
        listener = RosListener(station, 9, "r1", RosSettings())
        while not listener.topics:
            listener.look()
        shown: list[dict[str, Any]] = []
        sent: list[dict[str, Any] | None] = [None]

        def robot_goes_on(_: float) -> None:
            """The next state, once the last one was heard."""
            if listener.state == sent[-1] and len(sent) <= len(states):
                sent.append({"stop": None, "stop_state": None, **states[len(sent) - 1]})
                publisher.put(state_message(**sent[-1]))

        assert followed(listener, "9/r1", shown.append, wait=robot_goes_on) == "FINISHED"
    said = [(one["state"], one["stop"], one["done_count"]) for one in shown]
    assert said == [
        (None, None, None), ("READY", None, None), ("RUNNING", "s01", None), ("RUNNING", "s02", 1),
        ("FINISHED", None, 2),
    ]  # fmt: skip


def test_the_state_of_a_node_that_has_ended_is_not_shown(sessions: tuple[Any, Any]) -> None:
    robot, station = sessions
    listener = RosListener(station, 10, "r1", RosSettings())
    with stating(robot, 10) as publisher:
        publisher.put(state_message(state="RUNNING"))
        while listener.state is None:
            listener.look()
    while listener.state is not None:
        listener.look()
    assert state_of(listener, "10/r1")["state"] is None


def test_the_state_of_a_publisher_that_was_restarted_between_two_looks_is_not_shown(
    sessions: tuple[Any, Any],
) -> None:
    robot, station = sessions
    listener = RosListener(station, 15, "r1", RosSettings())
    with stating(robot, 15) as publisher:
        publisher.put(state_message(state="RUNNING"))
        while listener.state is None:
            listener.look()
    hash_ = TYPES.hash_rihs01("std_msgs/msg/String")
    restarted = state_announced(robot, hash_, 15, session="def")
    looks = station.liveliness()
    while [str(one.ok.key_expr).split("/")[2] for one in looks.get("@ros2_lv/15/**")] != ["def"]:
        pass
    listener.look()
    assert "/r1/stopgo/state" in listener.topics
    assert listener.state is None
    restarted.undeclare()


def test_a_cut_link_is_shown_as_such() -> None:
    with ExitStack() as stack:
        port = free_port()
        stack.enter_context(session_at("router", f"tcp/127.0.0.1:{port}"))
        line = stack.enter_context(Proxy(port))
        listener = stack.enter_context(ros_listener([line.endpoint], 16, "r1", RosSettings()))
        assert state_of(listener, "16/r1")["linked"]
        line.swallow(True)
        while state_of(listener, "16/r1")["linked"]:
            time.sleep(0.05)
        words = ros_status_text(state_of(listener, "16/r1"))
        assert words == "16/r1: no link to the zenoh router; last pose and state are not current"
        line.swallow(False)
        while not state_of(listener, "16/r1")["linked"]:
            time.sleep(0.05)
        assert "no state published by stopgo" in ros_status_text(state_of(listener, "16/r1"))


def test_the_state_is_not_shown_once_its_topic_is_refused(sessions: tuple[Any, Any]) -> None:
    robot, station = sessions
    listener = RosListener(station, 14, "r1", RosSettings())
    with stating(robot, 14) as publisher:
        publisher.put(state_message(state="RUNNING"))
        while listener.state is None:
            listener.look()
        wrong = state_announced(robot, "RIHS01_00ff", 14)
    while not listener.topics["/r1/stopgo/state"].refused:
        listener.look()
    assert listener.state is None
    wrong.undeclare()


def test_a_publisher_that_comes_back_is_checked_and_asked_for_its_state_again(
    sessions: tuple[Any, Any],
) -> None:
    robot, station = sessions
    wrong = state_announced(robot, "RIHS01_00ff", 13)
    listener = RosListener(station, 13, "r1", RosSettings())
    while not listener.topics:
        listener.look()
    assert "RIHS01_00ff there" in listener.topics["/r1/stopgo/state"].refused
    wrong.undeclare()
    for state in ("RUNNING", "PAUSED"):
        with stating(robot, 13) as publisher:
            publisher.put(state_message(state=state))
            while listener.state is None or listener.state["state"] != state:
                listener.look()
        while listener.topics:
            listener.look()


def test_a_refused_topic_is_named_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    empty = dict.fromkeys(("stop", "stop_state", "battery", "pose"))
    found = {
        "linked": True,
        "robot": "0/r1",
        "refused": ["/r1/odom: two versions"],
        "silent": "no tf",
        **empty,
    }

    def watched(_text: str, _endpoint: str, show: Any) -> str:
        for state in ("RUNNING", "FINISHED"):
            show({**found, "state": state})
        return "FINISHED"

    monkeypatch.setattr(watch_commands, "watch_ros", watched)
    with pytest.raises(typer.Exit):
        watch_commands.watch_topics("0/r1", "", as_json=False)
    assert capsys.readouterr().err.splitlines()[:-1] == ["/r1/odom: two versions"]


def test_the_command_ends_as_undecided_when_the_run_is_over(
    endpoint: str,
    sessions: tuple[Any, Any],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(ros_checks, "LISTENS_S", 0.2)
    with stating(sessions[0], 11) as publisher:
        publisher.put(state_message(state="FINISHED", done_count=2))
        assert stopgo(["watch", "--ros2", "11/r1", "--connect", endpoint]) == 3
    said = capsys.readouterr()
    assert said.out.splitlines()[-1].startswith("11/r1: FINISHED")
    assert said.err == "the robot reports FINISHED; its topics do not prove its scans: review its recording\n"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--rrd", "field.rrd"], "--rrd has no meaning with --ros2; leave it out"),
        ([], "--ros2 12/r1: nothing of this robot is published; stopgo doctor --ros2 12/r1 lists what is"),
    ],
)
def test_what_cannot_be_watched_is_one_line(
    more: list[str], said: str, endpoint: str, sessions: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(ros_checks, "LISTENS_S", 0.2)
    assert stopgo(["watch", "--ros2", "12/r1", "--connect", endpoint, *more]) == 2
    assert capsys.readouterr().err == f"stopgo: {said}\n"


def test_a_robot_behind_a_dds_bridge_is_read_with_what_the_bridge_has_kept(sessions: tuple[Any, Any]) -> None:
    """The bridge is played as its source describes it: plain keys, and a queryable for late listeners."""
    robot, station = sessions
    lively = robot.liveliness()
    kept = state_message(state="PAUSED", done_count=3)
    cache = robot.declare_queryable(
        "@/12ab/@ros2_pub_cache/r1/stopgo/state", lambda query: query.reply("r1/stopgo/state", kept)
    )
    tokens = [
        lively.declare_token("@/12ab/@ros2_lv/MP/r1§odom/nav_msgs§msg§Odometry/:1:0:0,10"),
        lively.declare_token("@/12ab/@ros2_lv/MP/r1§tf/tf2_msgs§msg§TFMessage/:1:0:0,10"),
        lively.declare_token("@/12ab/@ros2_lv/MP/r1§stopgo§state/std_msgs§msg§String/:1:1:0,1"),
    ]
    listener = RosListener(station, *read_domain("dds/r1"), RosSettings())
    while not {"/r1/odom", "/tf", "/r1/stopgo/state"} <= listener.topics.keys():
        listener.look()
    assert listener.topics["/tf"].entity.key == "r1/tf"
    heard = threading.Event()
    listener.telemetry.take_odometry = lambda *_, **named: heard.set()  # type: ignore[method-assign]
    while not heard.wait(0.02):
        robot.put("r1/odom", odometry(0.5))
    assert state_of(listener, "dds/r1")["state"] == "PAUSED"
    for made in (cache, *tokens):
        made.undeclare()
