"""A robot without physics and the servers of Nav2 that drive it, by real rclpy and the real types.

They behave as Nav2's controller server does: one goal at a time; a new one ends the old one as aborted; a
cancelled one ends with zero velocity; a goal succeeds within the checker's tolerance, not exactly at its end;
without progress it is aborted. NavigateToPose sends goals of its own to FollowPath, as bt_navigator does, on
a way that leaves the straight one. The base drives what `cmd_vel` says, and stands 0.5 s after the last
command.

Run it with ROS's Python: `stand_in_nav2.py FOLDER SPEED` writes its scans to FOLDER, and prints `ready`.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
import threading
import time
from pathlib import Path
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist
from nav2_msgs.action import FollowPath, NavigateToPose, Spin
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import BatteryState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

HZ = 50.0
TURN_RATE = 2.5
XY_TOLERANCE, YAW_TOLERANCE = 0.02, 0.02
VELOCITY_TIMEOUT_S = 0.5
ALLOWANCE_S = 10.0
"""Time without progress after which a goal is aborted."""
SCAN_S = 0.3
DETOUR_M = 0.8
"""Distance from the straight way that a way of its own has."""


class Robot(Node):
    """Integrates velocities, and publishes odometry, tf and its battery."""

    def __init__(self) -> None:
        super().__init__("robot")
        self.x = self.y = self.heading = 0.0
        self._velocity = (0.0, 0.0)
        self._commanded_s = 0.0
        self.create_subscription(Twist, "cmd_vel", self._command, 10)
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._tf = self.create_publisher(TFMessage, "/tf", 10)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._static = self.create_publisher(TFMessage, "/tf_static", kept)
        self._battery = self.create_publisher(BatteryState, "battery_state", 10)
        self._static.publish(TFMessage(transforms=[self._transform("map", "odom", 0.0, 0.0, 0.0)]))
        self.create_timer(1.0 / HZ, self._tick)

    def _command(self, message: Twist) -> None:
        self._velocity = (message.linear.x, message.angular.z)
        self._commanded_s = time.monotonic()

    def _tick(self) -> None:
        if time.monotonic() - self._commanded_s > VELOCITY_TIMEOUT_S:
            self._velocity = (0.0, 0.0)
        speed, turn = self._velocity
        self.heading = math.remainder(self.heading + turn / HZ, math.tau)
        self.x += speed * math.cos(self.heading) / HZ
        self.y += speed * math.sin(self.heading) / HZ
        told = Odometry()
        told.header.stamp, told.header.frame_id = self.get_clock().now().to_msg(), "odom"
        told.twist.twist.linear.x, told.twist.twist.angular.z = speed, turn
        self._odometry.publish(told)
        self._tf.publish(
            TFMessage(transforms=[self._transform("odom", "base_link", self.x, self.y, self.heading)])
        )
        self._battery.publish(BatteryState(percentage=0.8))

    def _transform(self, parent: str, child: str, x: float, y: float, heading: float) -> TransformStamped:
        made = TransformStamped(child_frame_id=child)
        made.header.frame_id, made.header.stamp = parent, self.get_clock().now().to_msg()
        made.transform.translation.x, made.transform.translation.y = x, y
        made.transform.rotation.z, made.transform.rotation.w = math.sin(heading / 2), math.cos(heading / 2)
        return made


class Servers(Node):
    """FollowPath and Spin of Nav2, and a scanner's service."""

    def __init__(self, robot: Robot, folder: Path, speed: float) -> None:
        super().__init__("nav2")
        self._robot = robot
        self._folder = folder
        self._speed = speed
        self._current: Any = None
        self._lock = threading.Lock()
        self._velocity = self.create_publisher(Twist, "cmd_vel", 10)
        group = ReentrantCallbackGroup()
        self._controller = ActionClient(self, FollowPath, "follow_path", callback_group=group)
        kinds = ((FollowPath, "follow_path"), (Spin, "spin"), (NavigateToPose, "navigate_to_pose"))
        for kind, name in kinds:
            ActionServer(
                self, kind, name, getattr(self, f"_{name}"), callback_group=group,
                cancel_callback=lambda goal: CancelResponse.ACCEPT,
            )  # fmt: skip
        self.create_service(Trigger, "scan", self._scan, callback_group=group)

    def _follow_path(self, handle: Any) -> Any:
        poses = handle.request.path.poses
        end, turn = poses[-1].pose.position, poses[-1].pose.orientation
        return self._drive(handle, FollowPath.Result, (end.x, end.y), 2 * math.atan2(turn.z, turn.w))

    def _spin(self, handle: Any) -> Any:
        robot = self._robot
        return self._drive(handle, Spin.Result, (robot.x, robot.y), robot.heading + handle.request.target_yaw)

    def _navigate_to_pose(self, handle: Any) -> Any:
        end, robot = handle.request.pose, self._robot
        middle = PoseStamped(header=end.header)
        middle.pose.position.x = 0.5 * (robot.x + end.pose.position.x)
        middle.pose.position.y = 0.5 * (robot.y + end.pose.position.y) + DETOUR_M
        middle.pose.orientation = end.pose.orientation
        for pose in (middle, end):
            status = self._followed(handle, pose)
            if status != GoalStatus.STATUS_SUCCEEDED:
                (handle.canceled if handle.is_cancel_requested else handle.abort)()
                return NavigateToPose.Result(error_code=9000, error_msg="no way")
        handle.succeed()
        return NavigateToPose.Result()

    def _followed(self, handle: Any, end: Any) -> int:
        """Drive by a goal of our own; the status in which it has ended."""
        goal = FollowPath.Goal()
        goal.path.header, goal.path.poses = end.header, [end]
        sent = self._controller.send_goal_async(goal)
        while not sent.done():
            time.sleep(1.0 / HZ)
        ended, cancelled = sent.result().get_result_async(), False
        while not ended.done():
            if handle.is_cancel_requested and not cancelled:
                sent.result().cancel_goal_async()
                cancelled = True
            time.sleep(1.0 / HZ)
        return int(ended.result().status)

    def _drive(self, handle: Any, result: Any, end: tuple[float, float], heading: float) -> Any:
        with self._lock:
            self._current = handle
        least, progress_s = math.inf, time.monotonic()
        while True:
            if handle.is_cancel_requested:
                self._command(0.0, 0.0)
                handle.canceled()
                return result()
            if self._current is not handle:
                handle.abort()
                return result(error_msg="preempted")
            left = self._step(end, heading)
            if left is None:
                self._command(0.0, 0.0)
                handle.succeed()
                return result()
            if left < least - 0.02:
                least, progress_s = left, time.monotonic()
            if time.monotonic() - progress_s > ALLOWANCE_S:
                self._command(0.0, 0.0)
                handle.abort()
                return result(error_code=result.UNKNOWN + 5, error_msg="Failed to make progress")
            time.sleep(1.0 / HZ)

    def _step(self, end: tuple[float, float], heading: float) -> float | None:
        """Command the next velocity; the distance that is left, `None` at the end."""
        robot = self._robot
        left = math.dist((robot.x, robot.y), end)
        if left > XY_TOLERANCE:
            off = math.remainder(math.atan2(end[1] - robot.y, end[0] - robot.x) - robot.heading, math.tau)
            self._command(min(self._speed, 4 * left) if abs(off) < 0.1 else 0.0, 4 * off)
            return left + abs(off)
        off = math.remainder(heading - robot.heading, math.tau)
        if abs(off) <= YAW_TOLERANCE:
            return None
        self._command(0.0, 4 * off)
        return abs(off)

    def _command(self, speed: float, turn: float) -> None:
        made = Twist()
        made.linear.x, made.angular.z = speed, max(-TURN_RATE, min(TURN_RATE, turn))
        self._velocity.publish(made)

    def _scan(self, request: Any, response: Any) -> Any:
        before = (self._robot.x, self._robot.y, self._robot.heading)
        time.sleep(SCAN_S)
        moved = before != (self._robot.x, self._robot.y, self._robot.heading)
        file = self._folder / f"{len(list(self._folder.glob('*.xyz'))) + 1}.xyz"
        data = f"{before[0]} {before[1]} 0 {moved}\n".encode()
        file.write_bytes(data)
        told = {
            "file": file.name, "size": len(data), "points": 1, "sha256": hashlib.sha256(data).hexdigest(),
        }  # fmt: skip
        response.success, response.message = True, json.dumps(told)
        return response


def main(folder: Path, speed: float) -> None:
    """Serve until the process is ended."""
    rclpy.init()
    robot = Robot()
    servers = Servers(robot, folder, speed)
    executor = MultiThreadedExecutor(num_threads=6)
    executor.add_node(robot)
    executor.add_node(servers)
    print("ready", flush=True)
    executor.spin()


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]))
