"""A lease on a robot's drive over zenoh: who commands the robot shows its life to a guard at the robot.

A guard near the command cannot help if the link to the robot is cut. One at the robot can: it stops the
robot when it hears no sign for `LEASE_S` from a program that drives it. That program drives only while such
a guard answers.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Literal

import msgspec

from stopgo.bridge.ros2.goal_guard import DRIVES, SIGN_S, STANDS, GoalStop, Signs
from stopgo.bridge.ros2.zenoh_node import ZenohNode
from stopgo.mission.document.decoding import converted, decoded

LEASE_S = 1.0
"""Time without a sign of life after which a driving program counts as gone; as long for a guard's answers."""
NO_GUARD = "no guard at the robot answers; start `stopgo guard` there"


class DriveSign(msgspec.Struct, frozen=True, kw_only=True):
    """A sign of life: whether the program drives, and what stops the robot."""

    drives: bool
    cancel: tuple[str, ...]
    cmd_vel: str
    velocity_type: Literal["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"]


def lease_key(domain: int, node: str, what: Literal["sign", "heard"]) -> str:
    """Return the key of signs, or of answers to them, for a node such as /r1/stopgo."""
    return f"stopgo_guard/{domain}/{node.strip('/')}/{what}"


class DriveLease:
    """The side of the program that drives: signs of life, and whether a guard answers them."""

    def __init__(
        self,
        node: ZenohNode,
        wanted: dict[str, Any],
        drives: Callable[[], bool],
        report: Callable[[str], None],
    ) -> None:
        """`wanted` names what stops the robot; `report` takes why no guard counts, or an empty text."""
        self._signs = {
            moves: msgspec.json.encode(converted({"drives": moves, **wanted}, DriveSign))
            for moves in (False, True)
        }
        self._drives = drives
        self._report = report
        own = node.resolved("~")
        self._heard_s = -LEASE_S
        self._publisher = node.session.declare_publisher(lease_key(node.domain, own, "sign"))
        self._subscriber = node.session.declare_subscriber(lease_key(node.domain, own, "heard"), self._hear)
        self._report(NO_GUARD)
        node.every(SIGN_S, self._sign)

    def _hear(self, sample: Any) -> None:
        self._heard_s = time.monotonic()

    def _sign(self) -> None:
        self._publisher.put(self._signs[self._drives()])
        self._report(NO_GUARD if time.monotonic() - self._heard_s > LEASE_S else "")

    def will_drive(self) -> None:
        """Say that a goal follows."""
        self._publisher.put(self._signs[True])


class LeaseGuard:
    """The side at the robot: answers signs of life, and stops the robot when they cease during a drive."""

    def __init__(self, node: ZenohNode, of_node: str, report: Callable[[str], None]) -> None:
        """`of_node` is the node that is guarded, such as /r1/stopgo; `report` takes what happened."""
        self._node = node
        self._report = report
        self._lock = threading.Lock()
        self._signs = Signs(time.monotonic(), LEASE_S)
        self._newest: DriveSign | None = None
        self._stop: GoalStop | None = None
        self._answers = node.session.declare_publisher(lease_key(node.domain, of_node, "heard"))
        self._subscriber = node.session.declare_subscriber(
            lease_key(node.domain, of_node, "sign"), self._hear
        )

    def _hear(self, sample: Any) -> None:
        try:
            sign = decoded(bytes(sample.payload), DriveSign)
        except msgspec.MsgspecError:
            return
        with self._lock:
            self._signs.take(DRIVES if sign.drives else STANDS, time.monotonic())
            self._newest = sign
        self._answers.put(b"")

    def look(self) -> None:
        """Stop the robot if its program is not heard; call it about every `SIGN_S`."""
        with self._lock:
            sign, must_stop = self._newest, self._signs.must_stop(time.monotonic())
        if sign is None:
            return
        wanted = msgspec.to_builtins(msgspec.structs.replace(sign, drives=False))
        if self._stop is None or self._stop.wanted != wanted:
            self._stop = GoalStop(self._node, wanted)
        if must_stop:
            self._report(f"no sign of the program that drives for {LEASE_S:g} s: the robot is stopped")
            self._stop.stop()
