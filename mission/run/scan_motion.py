"""Motion of a robot during a scan: the robot must stay where it was when the scan began.

A localisation is never quite steady. So a scan is spoilt by a position beyond the stop's tolerance from
the first one, by a turn, or by a speed that is reported several times in succession.
"""

from __future__ import annotations

import math

from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import HEADING_RAD
from stopgo.mission.run.tolerance import is_outside

MOVES_M_S = 0.1
"""Speed that no estimator reports for long while the vehicle is stationary."""
REPORTS = 3
"""Number of successive reports of such a speed: a single one may be noise."""


class ScanMotion:
    """Takes poses and speeds from the begin of a scan; `why` says how the robot moved, empty if it stood."""

    def __init__(self, tolerance_m: float) -> None:
        self._tolerance_m = tolerance_m
        self._first: Pose | None = None
        self._fast = 0
        self.why = ""

    def take(self, pose: Pose, speed: float) -> None:
        """Take the next report; the first one is the scan's pose."""
        self._first = first = self._first or pose
        self._fast = self._fast + 1 if speed > MOVES_M_S else 0
        self.why = self.why or self._moved(first, pose, speed)

    def _moved(self, first: Pose, pose: Pose, speed: float) -> str:
        moved_m = math.dist((first.x, first.y), (pose.x, pose.y))
        if is_outside(moved_m, self._tolerance_m):
            return f"the vehicle moved {moved_m:.2f} m during the scan"
        turned = abs(math.remainder(pose.heading - first.heading, math.tau))
        if turned > HEADING_RAD:
            return f"the vehicle turned {math.degrees(turned):.0f}° during the scan"
        if self._fast >= REPORTS:
            return f"the vehicle moved at {speed:.2f} m/s during the scan"
        return ""
