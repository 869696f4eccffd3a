"""The ROS side of a run: the plan, the driven path, markers of stops, the state, diagnostics and commands.

RViz, Foxglove and behaviour trees use them. Only `pause` and `abort` are taken from anybody in the ROS
network; other commands need `commands = true` in ros2.toml, because no key signs them.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from typing import Any, get_args

import msgspec

from stopgo.bridge.robot.map_frame import turned
from stopgo.bridge.robot.runner import Runner, state_report
from stopgo.bridge.ros2.rclpy_port import RclpyPort, path_message
from stopgo.bridge.ros2.ros_types import load
from stopgo.mission.document import Mission, Point
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.run.run_commands import FREE_VERBS, RunCommand, Verb
from stopgo.mission.run.states import Run

PERIOD_S = 0.2
STEP_M = 0.05
LONGEST = 20_000
"""Most poses of the driven path that are published; the recording has all."""
VALID_S = 5.0
COMMANDER = "ros2"
COLOURS = {
    "done": (0.1, 0.6, 0.2), "current": (1.0, 0.6, 0.0), "skipped": (0.5, 0.5, 0.5), "": (0.2, 0.4, 0.9),
}  # fmt: skip
"""Red, green and blue of a stop's marker."""
OK, WARN = 0, 1
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""


class RunTopics:
    """Publishes one robot's run from the node's thread, and takes commands."""

    def __init__(self, port: RclpyPort, runner: Runner, to_map: Callable[[], Transform]) -> None:
        self._port = port
        self._node = port.node
        self._runner = runner
        self._to_map = to_map
        self._numbers = itertools.count()
        self._shown: tuple[object, ...] = ()
        self._planned: Mission | None = None
        self._driven: list[Pose] = []
        self._of_run: str | None = None
        self._round = 0
        qos = load("rclpy.qos")
        kept = qos.QoSProfile(depth=1, durability=qos.DurabilityPolicy.TRANSIENT_LOCAL)
        make, nav = self._node.create_publisher, load("nav_msgs.msg")
        self._state = make(load("std_msgs.msg").String, "~/state", kept)
        self._plan = make(nav.Path, "~/plan", kept)
        self._path = make(nav.Path, "~/path", kept)
        self._stops = make(load("visualization_msgs.msg").MarkerArray, "~/stops", kept)
        self._diagnostics = make(load("diagnostic_msgs.msg").DiagnosticArray, "/diagnostics", 10)
        for verb in get_args(Verb):
            self._serve(verb)
        self._node.create_timer(PERIOD_S, self.tick)

    def tick(self) -> None:
        """Publish what has changed; diagnostics once a second."""
        run, mission = self._runner.snapshot()
        if mission is not self._planned:
            self._planned = mission
            self._publish_plan(mission)
        self._follow(run)
        shown = (run.state, run.stop_state, run.at, run.done, run.skipped, mission and mission.digest)
        if shown != self._shown:
            self._shown = shown
            self._publish_state()
            self._publish_stops(run, mission)
        self._round += 1
        if self._round % round(1.0 / PERIOD_S) == 0:
            self._publish_diagnostics(run)
            self._publish_path()

    def _publish_state(self) -> None:
        report = state_report(
            self._runner, robot=self._node.get_namespace().strip("/") or self._node.get_name(),
            seq=next(self._numbers), ns=self._port.clock.now_ns(), newest=0,
        )  # fmt: skip
        self._state.publish(load("std_msgs.msg").String(data=msgspec.json.encode(report).decode()))

    def _publish_plan(self, mission: Mission | None) -> None:
        legs = () if mission is None else legs_of(mission)
        points = [self._to_map().point(point) for leg in legs for point in leg]
        self._plan.publish(self._path_of(_headed(points)))

    def _follow(self, run: Run) -> None:
        """Add the robot's pose to the driven path; a new run begins a new one."""
        if run.run_id != self._of_run:
            self._of_run, self._driven = run.run_id, []
        pose = self._port.telemetry.pose()
        last = self._driven[-1] if self._driven else None
        moved = last is None or math.dist((last.x, last.y), (pose.x, pose.y)) >= STEP_M
        if run.run_id is not None and moved and len(self._driven) < LONGEST:
            self._driven.append(pose)

    def _publish_path(self) -> None:
        if self._driven and self._path.get_subscription_count():
            self._path.publish(self._path_of(self._driven))

    def _path_of(self, poses: list[Pose]) -> Any:
        frame = self._port.settings.frames.map
        return path_message(load("nav_msgs.msg").Path(), poses, frame, self._node)

    def _publish_stops(self, run: Run, mission: Mission | None) -> None:
        kinds = load("visualization_msgs.msg")
        markers = kinds.MarkerArray(markers=[kinds.Marker(action=kinds.Marker.DELETEALL)])
        for number, stop in enumerate(() if mission is None else mission.stops):
            outcome = "done" if stop.id in run.done else "skipped" if stop.id in run.skipped else ""
            current = number == run.at and run.state in ("RUNNING", "PAUSED", "HELD")
            at = turned(Pose(x=stop.x, y=stop.y, heading=stop.heading), self._to_map())
            colour = COLOURS["current" if current and not outcome else outcome]
            markers.markers += [
                self._marker(2 * number, at, colour, kinds.Marker.ARROW, ""),
                self._marker(2 * number + 1, at, colour, kinds.Marker.TEXT_VIEW_FACING, stop.id),
            ]
        self._stops.publish(markers)

    def _marker(self, number: int, at: Pose, colour: tuple[float, float, float], kind: int, text: str) -> Any:
        made = load("visualization_msgs.msg").Marker(id=number, type=kind, text=text, ns="stops")
        made.header.frame_id = self._port.settings.frames.map
        made.pose.position.x, made.pose.position.y = at.x, at.y
        made.pose.orientation.z, made.pose.orientation.w = math.sin(at.heading / 2), math.cos(at.heading / 2)
        made.scale.x, made.scale.y, made.scale.z = 0.4, 0.08, 0.25 if text else 0.08
        made.color.r, made.color.g, made.color.b = colour
        made.color.a = 1.0
        return made

    def _publish_diagnostics(self, run: Run) -> None:
        told, kinds = self._port.telemetry, load("diagnostic_msgs.msg")
        wrong = told.silence() or told.unusable()
        offset = told.clock_offset_s
        values = {
            "state": run.state, "reason": run.reason,
            "clock_offset_s": "" if offset is None else f"{offset:.3f}",
            "sigma_m": "" if told.sigma_m is None else f"{told.sigma_m:.3f}",
        }  # fmt: skip
        status = kinds.DiagnosticStatus(
            level=bytes([WARN if wrong or run.state == "HELD" else OK]), name=f"{self._node.get_name()}: run",
            message=wrong or run.state, hardware_id=self._node.get_fully_qualified_name(),
            values=[kinds.KeyValue(key=key, value=value) for key, value in values.items()],
        )  # fmt: skip
        made = kinds.DiagnosticArray(status=[status])
        made.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(made)

    # Commands

    def _serve(self, verb: Verb) -> None:
        def called(request: Any, response: Any) -> Any:
            response.success, response.message = self._command(verb)
            return response

        self._node.create_service(load("std_srvs.srv").Trigger, f"~/{verb}", called)

    def _command(self, verb: Verb) -> tuple[bool, str]:
        if verb not in FREE_VERBS and not self._port.settings.commands:
            return False, f"{verb} is not taken from ROS; set commands = true in ros2.toml"
        number = f"ros2-{self._runner.boot_id}-{next(self._numbers)}-{time.time_ns()}"
        command = RunCommand(
            cmd_id=number, verb=verb, commander=COMMANDER, issued_ns=time.time_ns(), valid_for_s=VALID_S
        )
        answer = self._runner.execute(command)
        return answer.outcome == "ok", answer.message or answer.state


def _headed(points: list[Point]) -> list[Pose]:
    """Return points as poses, each headed for the next one."""
    poses: list[Pose] = []
    for here, there in itertools.pairwise([*points, *points[-1:]]):
        heading = math.atan2(there[1] - here[1], there[0] - here[0]) if here != there else None
        before = poses[-1].heading if poses else 0.0
        poses.append(Pose(x=here[0], y=here[1], heading=before if heading is None else heading))
    return poses
