"""Scan results of a scanner, and the test that confirms them."""

from __future__ import annotations

import math
import re

import msgspec

from stopgo.mission.document import ScannerSpec
from stopgo.mission.run.events import Pose

HEADING_RAD = math.radians(5.0)
"""Greatest heading error at a stop for a scanner that does not see all round."""
_SHA256 = re.compile(r"[0-9a-fA-F]{64}")


class ScanResult(msgspec.Struct, frozen=True, kw_only=True):
    """The scanner's report of a written scan."""

    file: str
    """Id of the file; a scanner never uses one twice."""
    size: int
    sha256: str
    points: int
    pose: Pose | None = None
    """Pose of the robot when the scan ended, if the reporter knows it."""


class ScanFailed(msgspec.Struct, frozen=True, kw_only=True):
    reason: str


def missing_fields(scan: ScanResult) -> tuple[str, ...]:
    """Return the fields that a scan result lacks; a scan is confirmed only if nothing is missing."""
    fields = {
        "a file name": bool(scan.file),
        "size": scan.size > 0,
        "points": scan.points > 0,
        "sha256": bool(_SHA256.fullmatch(scan.sha256)),
    }
    return tuple(name for name, present in fields.items() if not present)


def needs_heading(scanner: ScannerSpec) -> bool:
    """True if the robot's heading matters for a scan."""
    return scanner.fov_deg < 360


def heading_error(scanner: ScannerSpec, wanted: float, heading: float) -> float:
    """Heading error in radians at a scan; 0 if it does not matter to the scanner."""
    missing = abs(math.remainder(heading - wanted, math.tau))
    return missing if needs_heading(scanner) and missing > HEADING_RAD else 0.0
