"""A robot's newest poses, numbered, for stations that come late or were disconnected."""

from __future__ import annotations

from collections import deque

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Reply
from stopgo.bridge.robot.pages import POSES_KEPT, poses_page
from stopgo.bridge.robot.runner import Position
from stopgo.mission.run.events import PoseReport
from stopgo.mission.run.states import Run


class PublishedPoses:
    """Numbers each pose of a boot; one thread adds, any thread asks."""

    def __init__(self, robot: str, boot_id: str) -> None:
        self._robot = robot
        self._boot_id = boot_id
        self._reports: deque[PoseReport] = deque(maxlen=POSES_KEPT)
        self._seq = 0

    def add(self, position: Position, run: Run, boot_id: str) -> PoseReport:
        """Add a position under the next number, and return its report."""
        if boot_id != self._boot_id:  # each boot counts its poses again from 1
            self._boot_id, self._seq = boot_id, 0
            self._reports.clear()
        self._seq += 1
        report = PoseReport(
            robot=self._robot, boot_id=boot_id, seq=self._seq, robot_ns=position.ns, run_id=run.run_id,
            mission_time_s=(position.ns - run.started_ns) / 1e9 if run.run_id else None,
            pose=position.pose, speed=position.speed,
        )  # fmt: skip
        self._reports.append(report)
        return report

    def page(self, request: Request) -> Reply:
        """Return the poses that a request asks for."""
        # A copy: meanwhile the robot adds others.
        return poses_page(self._reports.copy(), self._boot_id, request)
