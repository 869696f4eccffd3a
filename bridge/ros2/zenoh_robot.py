"""A robot with Nav2 whose network is rmw_zenoh's, driven without ROS. As a program, the guard of the robot.

The guard is another process on this computer, or one at the robot (`stopgo guard`).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.link import endpoints_in
from stopgo.bridge.ros2.drive_lease import DriveLease, LeaseGuard
from stopgo.bridge.ros2.goal_guard import SIGN_S, GoalGuard, guard
from stopgo.bridge.ros2.nav2_port import Nav2Port
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.bridge.ros2.zenoh_node import NodeThread, ZenohNode, open_network


@contextmanager
def open_zenoh(settings: RosSettings, clock: Clock) -> Iterator[Nav2Port]:
    """Run a node for as long as the block lasts."""
    telemetry = RosTelemetry(clock, settings.frames, settings.limits)
    network = settings.zenoh
    thread = NodeThread(telemetry.say_fault)
    with ExitStack() as stack:
        session = stack.enter_context(open_network(endpoints_in(network.router)))
        stack.callback(thread.close)
        node = ZenohNode(
            session, network.domain, network.namespace, settings.node, thread=thread,
            use_sim_time=network.use_sim_time, definitions=settings.scan.definitions,
        )  # fmt: skip
        port = Nav2Port(node, settings, telemetry, clock)
        if network.guard == "robot":
            lease = DriveLease(node, port.guarded, lambda: port.drives, telemetry.say_unguarded)
            port.before_goal = lease.will_drive
        else:
            where = {"router": network.router, "domain": network.domain, "namespace": network.namespace}
            process = GoalGuard(
                {**port.guarded, **where}, lambda: port.drives, telemetry.say_unguarded, __name__
            )
            stack.callback(process.close)
            port.before_goal = process.will_drive
        thread.start()
        yield port


@contextmanager
def guards_node(endpoint: str, domain: int, namespace: str, name: str) -> Iterator[ZenohNode]:
    """Run the node of a guard for as long as the block lasts."""
    thread = NodeThread(lambda why: None)
    with open_network(endpoints_in(endpoint)) as session, ExitStack() as stack:
        stack.callback(thread.close)
        node = ZenohNode(session, domain, namespace, f"{name}_guard", thread=thread)
        thread.start()
        yield node


def guard_at_robot(endpoint: str, domain: int, namespace: str, name: str, say: Callable[[str], None]) -> None:
    """Guard a robot against the loss of the program that drives it, until SIGTERM; `name` is its node."""
    with guards_node(endpoint, domain, namespace, name) as node:
        own = node.resolved(name)
        guard_ = LeaseGuard(node, own, say)
        say(f"ready guard of {own} at {endpoint}")
        while True:
            guard_.look()
            time.sleep(SIGN_S)


def _guard_beside(wanted: dict[str, Any]) -> None:
    """Guard a robot until the program that has started this one ends."""
    name = str(wanted["node"]).removesuffix("_guard")
    with guards_node(wanted["router"], wanted["domain"], wanted["namespace"], name) as node:
        guard(node, wanted, sys.stdin.fileno())


if __name__ == "__main__":
    _guard_beside(json.loads(sys.argv[1]))
