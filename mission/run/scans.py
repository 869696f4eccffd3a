"""What a scanner tells of a scan, and when that confirms it."""

from __future__ import annotations

import math
import re

import msgspec

from stopgo.mission.document import ScannerSpec
from stopgo.mission.run.events import Pose

HEADING_RAD = math.radians(5.0)
"""How far a stop's heading may be missed by a scanner that does not see all round."""
_SHA256 = re.compile(r"[0-9a-fA-F]{64}")


class ScanResult(msgspec.Struct, frozen=True, kw_only=True):
    """What the scanner says it has written."""

    file: str
    """Id of the file, never used twice by a scanner."""
    size: int
    sha256: str
    points: int
    pose: Pose | None = None
    """Where the robot stood when the scan ended, if whoever tells of it knows."""


class ScanFailed(msgspec.Struct, frozen=True, kw_only=True):
    reason: str


def missing_in(scan: ScanResult) -> tuple[str, ...]:
    """What a scan's result lacks to be one; a scan is confirmed only by a result that lacks nothing."""
    pieces = {
        "a file name": bool(scan.file),
        "size": scan.size > 0,
        "points": scan.points > 0,
        "sha256": bool(_SHA256.fullmatch(scan.sha256)),
    }
    return tuple(name for name, told in pieces.items() if not told)


def needs_heading(scanner: ScannerSpec) -> bool:
    """Whether it matters how a robot is turned while it scans."""
    return scanner.fov_deg < 360


def turned_away(scanner: ScannerSpec, wanted: float, heading: float) -> float:
    """Radians by which a heading is missed for a scan; 0 if that does not matter to the scanner."""
    missing = abs(math.remainder(heading - wanted, math.tau))
    return missing if needs_heading(scanner) and missing > HEADING_RAD else 0.0
