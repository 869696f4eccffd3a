"""The simulated scanner on the vehicle: it needs time and a standstill, and names a file that never exists.

A scanner on a MAVLink vehicle confirms a scan thus (read by the gateway): CAMERA_IMAGE_CAPTURED with the
running number of the scan (from 0), capture_result 1, and a file_url `NAME.e57?size=N&points=N&sha256=HEX`.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

from stopgo.bridge.mavlink.simulated.vehicle_faults import Mishaps
from stopgo.bridge.robot.simulator import BYTES_PER_POINT, POINTS_PER_S
from stopgo.mission.run.events import Pose

DEFAULT_S = 3.0
LONGEST_S = 3600.0
MOVED_M, TURNED_RAD = 0.01, 0.02
"""A scanner that moves more than this while it scans has failed."""


@dataclass(frozen=True)
class RunningScan:
    """A scan in progress."""

    number: int
    """Number in the trigger; 0 if none."""
    index: int
    """Number of scans that the vehicle began before."""
    began_ns: int
    ends_ns: int
    began_at: Pose


@dataclass(frozen=True)
class ScanEnd:
    """End of a scan."""

    index: int
    number: int
    file_url: str
    """Empty if the scan failed."""
    why: str = ""
    """Reason of a failure."""


class VehicleScanner:
    """One scan at a time."""

    def __init__(self, mishaps: Mishaps) -> None:
        self._mishaps = mishaps
        self._begun = 0
        self.scan: RunningScan | None = None

    def begin(self, number: int, seconds: float, *, index: int, pose: Pose, now_ns: int) -> bool:
        """Begin a scan of this duration; false if one is in progress."""
        if self.scan is not None:
            return False
        self._begun += 1
        lasts = seconds if math.isfinite(seconds) and 0 < seconds <= LONGEST_S else DEFAULT_S
        self.scan = RunningScan(number, index, now_ns, now_ns + round(lasts * 1e9), pose)
        return True

    def end(self, pose: Pose) -> ScanEnd:
        """End the scan that is due."""
        scan = self.scan
        assert scan is not None
        self.scan = None
        why = ""
        if self._mishaps.due("scanner", self._begun):
            why = "the scanner reported an error"
        elif _moved(scan.began_at, pose):
            why = "the vehicle moved during the scan"
        return ScanEnd(scan.index, scan.number, "" if why else file_url(scan), why)

    def stop(self) -> None:
        """Break the scan off."""
        self.scan = None


def file_url(scan: RunningScan) -> str:
    """At most 205 characters, which is what CAMERA_IMAGE_CAPTURED holds."""
    name = f"scan-{scan.index + 1:04}-{scan.number}"
    points = max(1, round(POINTS_PER_S * (scan.ends_ns - scan.began_ns) / 1e9))
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f"{name}.e57?size={points * BYTES_PER_POINT}&points={points}&sha256={digest}"


def _moved(before: Pose, after: Pose) -> bool:
    turned = abs(math.remainder(after.heading - before.heading, math.tau))
    return math.hypot(after.x - before.x, after.y - before.y) > MOVED_M or turned > TURNED_RAD
