"""What a scanner tells of a scan, and when that confirms it."""

from __future__ import annotations

import re

import msgspec

_SHA256 = re.compile(r"[0-9a-fA-F]{64}")


class ScanResult(msgspec.Struct, frozen=True, kw_only=True):
    """What the scanner says it has written."""

    file: str
    """Id of the file, never used twice by a scanner."""
    size: int
    sha256: str
    points: int


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
