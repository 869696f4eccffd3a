"""A goal whose sender is killed: prints `ready` when the robot drives to its second one, then how all ended.

Status 4 is succeeded, 5 canceled, 6 aborted.
"""

from __future__ import annotations

import rclpy
from action_msgs.msg import GoalStatusArray
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

ACTIVE = {1, 2, 3}
MOVING_M_S = 0.2


def main() -> None:
    """Watch the goals of FollowPath."""
    rclpy.init()
    node, speeds, seen = Node("looker"), [0.0], list[list[int]]([[]])
    kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(
        GoalStatusArray, "follow_path/_action/status",
        lambda told: seen.append([goal.status for goal in told.status_list]), kept,
    )  # fmt: skip
    node.create_subscription(Odometry, "odom", lambda told: speeds.append(told.twist.twist.linear.x), 10)
    while len(seen[-1]) < 2 or not ACTIVE & set(seen[-1]) or speeds[-1] < MOVING_M_S:
        rclpy.spin_once(node, timeout_sec=0.1)
    print("ready", flush=True)
    while ACTIVE & set(seen[-1]):
        rclpy.spin_once(node, timeout_sec=0.1)
    print(*sorted(seen[-1]), flush=True)


if __name__ == "__main__":
    main()
