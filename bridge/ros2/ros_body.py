"""A robot with ROS 2 as the base and scanner that a robot's controller drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.map_frame import OnMap
from stopgo.bridge.robot.robot_hardware import Body
from stopgo.bridge.robot.runner import Runner
from stopgo.bridge.ros2.goal_drive import LOOK_S
from stopgo.bridge.ros2.ros_base import RosBase
from stopgo.bridge.ros2.ros_port import RosPort
from stopgo.bridge.ros2.ros_scanner import RosScanner
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.document import Mission
from stopgo.mission.errors import RobotUnreachable
from stopgo.mission.frames.transform import Transform

OpenPort = Callable[[RosSettings, Clock], AbstractContextManager[RosPort]]
"""Opens the ROS side of a robot."""


@dataclass(frozen=True)
class RosBody:
    """A robot that Nav2 drives, on the same computer or in the same ROS network."""

    settings: RosSettings
    open_port: OpenPort
    show_run: Callable[[Any, Runner, Callable[[], Transform]], object] = lambda *given: None
    """Shows the run in ROS: given the port, the run and the transform to the map."""
    to_map: Transform | None = None
    """Transform from the site to the map; if not given, each mission's own."""
    patience_s: float = 30.0
    """Longest wait for the robot's position."""

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        with self.open_port(self.settings, clock) as port:
            settings, telemetry = port.settings, port.telemetry
            self._await_pose(port, telemetry, clock)
            scanner = RosScanner(port, telemetry, clock=clock, settings=settings.scan)
            base = RosBase(port, telemetry, clock=clock, settings=settings, scanner=scanner)
            on_map = OnMap(base, self.to_map)

            def take(mission: Mission) -> None:
                on_map.take(mission)
                base.take(mission, on_map.to_map)

            def attach(runner: Runner) -> None:
                self.show_run(port, runner, lambda: on_map.to_map)

            yield Body(on_map, scanner, take, attach)

    def _await_pose(self, port: RosPort, telemetry: RosTelemetry, clock: Clock) -> None:
        end_ns = clock.now_ns() + round(self.patience_s * 1e9)
        while why := telemetry.silence():
            if clock.now_ns() > end_ns:
                found = f"; {port.found_instead()}" if "odometry" in why else ""
                raise RobotUnreachable(f"ROS 2: {why} after {self.patience_s:g} s{found}")
            clock.wait(LOOK_S)
