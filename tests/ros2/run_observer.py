"""The topics of a run as RViz shows them, and two commands: prints one JSON object."""

from __future__ import annotations

import json
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ROUNDS = 200


def main() -> None:
    """Listen until every topic has brought something, then call two services."""
    rclpy.init()
    node, seen = Node("observer"), dict[str, Any]()
    for kind, name in ((String, "state"), (Path, "plan"), (MarkerArray, "stops")):
        node.create_subscription(
            kind, f"/stopgo/{name}", lambda told, name=name: seen.update({name: told}), KEPT
        )
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda told: seen.update(diagnostics=told), 10)
    rounds = 0
    while len(seen) < 4 and rounds < ROUNDS:
        rclpy.spin_once(node, timeout_sec=0.1)
        rounds += 1
    print(
        json.dumps(
            {
                "state": json.loads(seen["state"].data),
                "plan": [(pose.pose.position.x, pose.pose.position.y) for pose in seen["plan"].poses],
                "frame": seen["plan"].header.frame_id,
                "stops": [marker.text for marker in seen["stops"].markers if marker.text],
                "diagnostics": seen["diagnostics"].status[0].message,
                "resume": _call(node, "resume"),
                "pause": _call(node, "pause"),
            }
        )
    )


def _call(node: Node, name: str) -> str:
    client = node.create_client(Trigger, f"/stopgo/{name}")
    assert client.wait_for_service(20.0)
    future = client.call_async(Trigger.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=20.0)
    return str(future.result().message)


if __name__ == "__main__":
    main()
