"""Reports of a camera, each with the vehicle's pose when it first came."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from stopgo.mission.mavlink.captures import STEPS_M, Capture, Picture
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.run.events import Arrived, Pose
from stopgo.mission.run.scans import ScanResult
from stopgo.mission.run.states import Run

CAPTURES_KEPT = 100
ScanFile = tuple[str, str]
"""Name and sha256 of a scan's file: they stay the same over restarts, as no counter of pictures does."""


@dataclass(frozen=True)
class CaptureReport:
    """A camera report, and the robot's pose when it first came."""

    capture: Capture
    pose: Pose | None
    """Pose as reported by the robot, unless the camera reports another position."""
    ns: int


class CaptureReports:
    """The last reports, each stored once."""

    def __init__(self) -> None:
        self._reports: deque[CaptureReport] = deque(maxlen=CAPTURES_KEPT)
        self._ignored: set[Picture] = set()
        self.counted: frozenset[ScanFile] = frozenset()
        """Files of scans that have counted for a stop: none counts twice, whatever its camera calls it."""

    def is_new(self, capture: Capture) -> bool:
        """Return True if it was not reported before."""
        names = (known.capture.name for known in self._reports)
        return capture.name not in self._ignored and capture.name not in names

    def ignore(self, capture: Capture) -> None:
        """Let a report count for no stop, however often it is repeated."""
        self._ignored.add(capture.name)

    def take(self, capture: Capture, pose: Pose | None, now_ns: int, *, at_stop: bool) -> None:
        """Store a new report, with the vehicle's own pose if it agrees with the camera's position."""
        if not self.is_new(capture):
            return
        there = at_stop if capture.pose is None else _agree(capture.pose, pose)
        self._reports.append(CaptureReport(capture, pose if there else None, now_ns))

    def of_stop(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> CaptureReport | None:
        """Return the newest report of the stop; one from near it counts only if it came after the arrival."""
        stops = listed.mission.stops
        if run.at >= len(stops):
            return None
        since_ns = 0 if arrived is None else arrived.robot_ns
        for report in reversed(self._reports):
            capture = report.capture
            new = capture.name[1] > after[1] and capture.name != after
            if (
                new
                and file_of(capture) not in self.counted
                and (
                    capture.may_be_of(stops[run.at])
                    or (report.ns > since_ns and capture.is_nearest(run.at, stops))
                )
            ):
                return report
        return None


def file_of(capture: Capture) -> ScanFile | None:
    """Return the file of a scan; `None` if it failed."""
    result = capture.result
    return (result.file, result.sha256) if isinstance(result, ScanResult) else None


def scan_pose(report: CaptureReport | None, arrived: Arrived | None) -> Pose | None:
    """Return the pose of the scan; a camera reports it in steps of a centimetre, and last."""
    before = None if arrived is None else arrived.pose
    if report is not None and report.pose is not None:
        return report.pose
    reported = None if report is None else report.capture.pose
    return before if reported is None or _agree(reported, before) else reported


def _agree(camera: Pose | None, robot: Pose | None) -> bool:
    """Return True if a camera's position is a pose, rounded to its steps."""
    if camera is None or robot is None:
        return False
    return math.dist((camera.x, camera.y), (robot.x, robot.y)) <= STEPS_M
