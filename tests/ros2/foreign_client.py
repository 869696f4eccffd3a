"""Another client of Nav2, which takes the robot away in mid-leg: one goal to a place of its own."""

from __future__ import annotations

from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import FollowPath
from nav_msgs.msg import Odometry, Path
from rclpy.action import ActionClient
from rclpy.node import Node

MOVING_M_S = 0.3


def main() -> None:
    """Print `ready`, wait until the robot drives, then send the goal; end when it is over."""
    rclpy.init()
    node = Node("somebody_else")
    client = ActionClient(node, FollowPath, "follow_path")
    assert client.wait_for_server(20.0)
    speeds: list[float] = []
    node.create_subscription(Odometry, "odom", lambda told: speeds.append(told.twist.twist.linear.x), 10)
    print("ready", flush=True)
    while not speeds or speeds[-1] < MOVING_M_S:
        rclpy.spin_once(node, timeout_sec=0.5)
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.orientation.w = 3.0, 1.0
    handle = done(node, client.send_goal_async(FollowPath.Goal(path=Path(poses=[pose]))))
    assert handle.accepted
    print("status", done(node, handle.get_result_async()).status)


def done(node: Any, future: Any) -> Any:
    """Return a future's result."""
    rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
    return future.result()


if __name__ == "__main__":
    main()
