"""Checks of a robot's ROS 2 network over zenoh, and its state: nothing is published or called."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from stopgo.bridge.commands.checks import Check
from stopgo.bridge.link.link import endpoints_in
from stopgo.bridge.ros2.ros_graph import actions_of, discords
from stopgo.mission.console.table import counted

if TYPE_CHECKING:
    from stopgo.bridge.ros2.ros_zenoh import HeardTopic, RosListener

LISTENS_S = 2.0
"""Time that the topics are listened to: enough for a rate."""
LOOKS_S = 0.5


@contextmanager
def listened(text: str, endpoint: str) -> Iterator[RosListener]:
    """Listen for a while, and yield the listener."""
    from stopgo.bridge.ros2.ros_settings import RosSettings
    from stopgo.bridge.ros2.ros_zenoh import read_domain, ros_listener

    domain, namespace = read_domain(text)
    with ros_listener(endpoints_in(endpoint), domain, namespace, RosSettings()) as listener:
        end_s = time.monotonic() + LISTENS_S
        while True:
            listener.look()
            time.sleep(LOOKS_S)
            if time.monotonic() >= end_s:
                break
        yield listener


def ros_checks(text: str, endpoint: str) -> Iterator[Check]:
    """Check topics, frames, actions, QoS and clock of a robot; `text` is DOMAIN or DOMAIN/NAMESPACE."""
    with listened(text, endpoint) as listener:
        yield from graph_checks(listener)


def graph_checks(listener: RosListener) -> Iterator[Check]:
    """Check what a listener has heard."""
    entities = listener.entities
    nodes = sorted({one.node for one in entities})
    yield Check("ros2", bool(nodes), f"{counted(len(nodes), 'node')}: {', '.join(nodes) or 'none'}")
    if not nodes:
        return
    for name, (kind, _) in listener.wanted.items():
        yield _topic_check(name, kind, listener.topics.get(name))
    silent = listener.telemetry.silence() or listener.telemetry.conflict()
    yield Check("frames", not silent, silent or "tf leads from the map to the base")
    offset_s = listener.telemetry.clock_offset_s
    if offset_s is not None:
        wrong = listener.telemetry.unusable()
        yield Check("clock", not wrong, wrong or f"the robot's stamps are {offset_s:.3f} s old on arrival")
    actions = actions_of(entities)
    drives = any(kind == "nav2_msgs/action/FollowPath" for kind in actions.values())
    listed = ", ".join(f"{name} ({kind})" for name, kind in sorted(actions.items()))
    yield Check("actions", drives, listed or "none; start Nav2's controller server")
    for words in discords(entities):
        yield Check("qos", False, words)


def _topic_check(name: str, kind: str, topic: HeardTopic | None) -> Check:
    if topic is None:
        needed = name.endswith(("odom", "/tf"))
        return Check(name, not needed, f"nobody publishes it ({kind})")
    if topic.refused:
        return Check(name, False, f"{topic.entity.node}: {topic.refused}; not read")
    if topic.wrong:
        return Check(name, False, topic.wrong)
    lost = f", {topic.missed} missed" if topic.missed else ""
    said = f"{kind} of {topic.entity.node}, {topic.count} messages, {topic.rate:.1f} a second{lost}"
    return Check(name, topic.count > 0 or topic.entity.kept, said)


def ros_status(text: str, endpoint: str) -> dict[str, Any]:
    """Return the state, position and battery of a robot, as its topics have them; `None` if unknown."""
    with listened(text, endpoint) as listener:
        return state_of(listener, text)


def state_of(listener: RosListener, text: str) -> dict[str, Any]:
    """Return the same of what a listener has heard so far."""
    told = listener.telemetry
    silent, pose, state = told.silence(), told.pose(), listener.state or {}
    return {
        "robot": text,
        "linked": listener.is_linked,
        "refused": [f"{name}: {topic.refused}" for name, topic in listener.topics.items() if topic.refused],
        "silent": silent,
        "pose": None if silent else {"x": pose.x, "y": pose.y, "heading": pose.heading},
        "speed": None if silent else told.speed(),
        "battery": told.charge,
        **{key: state.get(key) for key in ("state", "run_id", "stop", "stop_state", "done_count")},
    }


def ros_status_text(found: dict[str, Any]) -> str:
    """Return a robot's state as one line."""
    if not found["linked"]:
        return f"{found['robot']}: no link to the zenoh router; last pose and state are not current"
    state = found["state"] or "no state published by stopgo"
    stop = f", {found['stop_state']} at {found['stop']}" if found["stop"] else ""
    battery = "" if found["battery"] is None else f", battery {found['battery']:.0%}"
    return f"{found['robot']}: {state}{stop}; {_place_text(found)}{battery}"


def _place_text(found: dict[str, Any]) -> str:
    pose = found["pose"]
    if pose is None:
        return str(found["silent"])
    degrees = math.degrees(pose["heading"])
    return f"at ({pose['x']:.2f}, {pose['y']:.2f}), {degrees:.0f}°, {found['speed']:.2f} m/s"
