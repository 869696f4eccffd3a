"""A manager of lifecycle nodes, by real rclpy: requests transitions of /stopgo one after the other.

`life_cycle.py TRANSITION...` prints the state before and after them. Among them, `drive` waits until the
robot drives.
"""

from __future__ import annotations

import sys
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry

MOVING_M_S = 0.2


def main(transitions: list[str]) -> None:
    """Request the transitions, and print the first and the last state."""
    rclpy.init()
    node = rclpy.create_node("lifecycle_manager")

    def call(kind: Any, name: str, request: Any) -> Any:
        client = node.create_client(kind, f"stopgo/{name}")
        client.wait_for_service()
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future)
        return future.result()

    speeds = [0.0]
    node.create_subscription(Odometry, "odom", lambda told: speeds.append(told.twist.twist.linear.x), 10)
    states = [call(GetState, "get_state", GetState.Request()).current_state.label]
    print("ready", flush=True)
    for name in transitions:
        while name == "drive" and speeds[-1] < MOVING_M_S:
            rclpy.spin_once(node, timeout_sec=0.1)
        if name == "drive":
            continue
        wanted = Transition(id=getattr(Transition, f"TRANSITION_{name.upper()}"))
        assert call(ChangeState, "change_state", ChangeState.Request(transition=wanted)).success, name
    states.append(call(GetState, "get_state", GetState.Request()).current_state.label)
    print(*states)


if __name__ == "__main__":
    main(sys.argv[1:])
