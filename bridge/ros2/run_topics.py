"""The ROS side of a run: the plan, the driven path, markers of stops, the state, diagnostics and commands.

RViz, Foxglove and behaviour trees use them. Only `pause` and `abort` are taken from anybody in the ROS
network; other commands need `commands = true` in ros2.toml, because no key signs them.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any, get_args

import msgspec

from stopgo.bridge.robot.map_frame import turned
from stopgo.bridge.robot.runner import Runner, state_report
from stopgo.bridge.ros2.nav2_port import Nav2Port, header_fields, path_fields, pose_fields
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
ARROW, TEXT, DELETE_ALL = 0, 9, 3
"""Types and action of visualization_msgs/msg/Marker."""


class RunTopics:
    """Publishes one robot's run from the node's thread, and takes commands."""

    def __init__(self, port: Nav2Port, runner: Runner, to_map: Callable[[], Transform]) -> None:
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
        make, path = self._node.publisher, "nav_msgs/msg/Path"
        self._state = make("std_msgs/msg/String", "~/state", "kept", depth=1)
        self._plan = make(path, "~/plan", "kept", depth=1)
        self._path = make(path, "~/path", "kept", depth=1)
        self._stops = make("visualization_msgs/msg/MarkerArray", "~/stops", "kept", depth=1)
        self._diagnostics = make("diagnostic_msgs/msg/DiagnosticArray", "/diagnostics")
        for verb in get_args(Verb):
            self._node.serve("std_srvs/srv/Trigger", f"~/{verb}", partial(self._command, verb))
        self._node.every(PERIOD_S, self.tick)

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
            self._runner, robot=self._node.namespace.strip("/") or self._node.name,
            seq=next(self._numbers), ns=self._port.clock.now_ns(), newest=0,
        )  # fmt: skip
        self._state.publish({"data": msgspec.json.encode(report).decode()})

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
        if self._driven and self._path.is_heard():
            self._path.publish(self._path_of(self._driven))

    def _path_of(self, poses: list[Pose]) -> dict[str, Any]:
        return path_fields(poses, self._port.settings.frames.map, self._node.now_ns())

    def _publish_stops(self, run: Run, mission: Mission | None) -> None:
        markers: list[dict[str, Any]] = [{"action": DELETE_ALL}]
        for number, stop in enumerate(() if mission is None else mission.stops):
            outcome = "done" if stop.id in run.done else "skipped" if stop.id in run.skipped else ""
            current = number == run.at and run.state in ("RUNNING", "PAUSED", "HELD")
            at = turned(Pose(x=stop.x, y=stop.y, heading=stop.heading), self._to_map())
            colour = COLOURS["current" if current and not outcome else outcome]
            markers += [
                self._marker(2 * number, at, colour, ""), self._marker(2 * number + 1, at, colour, stop.id)
            ]  # fmt: skip
        self._stops.publish({"markers": markers})

    def _marker(self, number: int, at: Pose, colour: tuple[float, float, float], text: str) -> dict[str, Any]:
        red, green, blue = colour
        return {
            "header": header_fields(self._port.settings.frames.map, 0),
            "ns": "stops", "id": number, "type": TEXT if text else ARROW, "text": text,
            "pose": pose_fields(at),
            "scale": {"x": 0.4, "y": 0.08, "z": 0.25 if text else 0.08},
            "color": {"r": red, "g": green, "b": blue, "a": 1.0},
        }  # fmt: skip

    def _publish_diagnostics(self, run: Run) -> None:
        told, node = self._port.telemetry, self._node
        wrong = told.silence() or told.unusable()
        offset = told.clock_offset_s
        values = {
            "state": run.state, "reason": run.reason,
            "clock_offset_s": "" if offset is None else f"{offset:.3f}",
            "sigma_m": "" if told.sigma_m is None else f"{told.sigma_m:.3f}",
        }  # fmt: skip
        status = {
            "level": WARN if wrong or run.state == "HELD" else OK, "name": f"{node.name}: run",
            "message": wrong or run.state, "hardware_id": f"{node.namespace.rstrip('/')}/{node.name}",
            "values": [{"key": key, "value": value} for key, value in values.items()],
        }  # fmt: skip
        self._diagnostics.publish({"header": header_fields("", node.now_ns()), "status": [status]})

    # Commands

    def _command(self, verb: Verb) -> dict[str, Any]:
        """Execute a command; return the fields of a std_srvs/srv/Trigger's response."""
        if verb not in FREE_VERBS and not self._port.settings.commands:
            why = f"{verb} is not taken from ROS; set commands = true in ros2.toml"
            return {"success": False, "message": why}
        number = f"ros2-{self._runner.boot_id}-{next(self._numbers)}-{time.time_ns()}"
        command = RunCommand(
            cmd_id=number, verb=verb, commander=COMMANDER, issued_ns=time.time_ns(), valid_for_s=VALID_S
        )
        answer = self._runner.execute(command)
        return {"success": answer.outcome == "ok", "message": answer.message or answer.state}


def _headed(points: list[Point]) -> list[Pose]:
    """Return points as poses, each headed for the next one."""
    poses: list[Pose] = []
    for here, there in itertools.pairwise([*points, *points[-1:]]):
        heading = math.atan2(there[1] - here[1], there[0] - here[0]) if here != there else None
        before = poses[-1].heading if poses else 0.0
        poses.append(Pose(x=here[0], y=here[1], heading=before if heading is None else heading))
    return poses
