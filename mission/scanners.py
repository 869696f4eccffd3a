"""Laser scanners by name: what their makers' data sheets say that a plan needs.

Facts and figures only, of one way of scanning each: a scanner with several resolutions has several names.
Steps are the sheet's spacing at 10 m, or a full turn over the sheet's points in it. What a sheet does not
tell is not filled in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

ScannerName = Literal[
    "rtc360-high",
    "rtc360-medium",
    "rtc360-low",
    "blk360-high",
    "blk360-medium",
    "focus-quarter",
    "focus-eighth",
    "imager5016-high",
    "imager5016-middle",
]


@dataclass(frozen=True, kw_only=True)
class ScannerFacts:
    """One scanner with one of its resolutions."""

    name: str
    source: str
    """The maker's sheet that the figures are from."""
    range: float
    """Metres."""
    near: float
    """Metres below which nothing is measured."""
    angular_step: float
    """Degrees between neighbouring points."""
    blind_cone: float
    """Degrees of the cone below the scanner in which nothing is measured, from side to side."""
    scan_time: float | None = None
    """Seconds without pictures, where the sheet tells."""

    def values(self) -> dict[str, Any]:
        """What they say, by the names of a plan's parameters."""
        told = {
            key: getattr(self, key) for key in ("range", "near", "angular_step", "blind_cone", "scan_time")
        }
        return {key: value for key, value in told.items() if value is not None}


def _at_10_m(spacing_mm: float) -> float:
    """Degrees between points that are so far apart at 10 m."""
    return round(math.degrees(spacing_mm / 10_000), 6)


def _in_a_turn(points: int) -> float:
    """Degrees between so many points all round."""
    return round(360 / points, 6)


def _rtc360(mode: str, spacing_mm: float, scan_time: float) -> ScannerFacts:
    return ScannerFacts(
        name=f"Leica RTC360, {mode} resolution",
        source="Leica Geosystems, RTC360 data sheet",
        range=130.0,
        near=0.5,
        blind_cone=60.0,
        angular_step=_at_10_m(spacing_mm),
        scan_time=scan_time,
    )


def _blk360(mode: str, spacing_mm: float) -> ScannerFacts:
    return ScannerFacts(
        name=f"Leica BLK360 (2nd generation), {mode} resolution",
        source="Leica Geosystems, BLK360 (2022) data sheet",
        range=45.0,
        near=0.5,
        blind_cone=90.0,
        angular_step=_at_10_m(spacing_mm),
    )


def _focus(mode: str, divided_by: int) -> ScannerFacts:
    return ScannerFacts(
        name=f"FARO Focus S 70, {mode} of full resolution",
        source="FARO, Focus Laser Scanner tech sheet",
        range=70.0,
        near=0.6,
        blind_cone=60.0,
        angular_step=_in_a_turn(40_960 // divided_by),
    )


def _imager(mode: str, points: int) -> ScannerFacts:
    return ScannerFacts(
        name=f"Z+F IMAGER 5016, {mode} resolution",
        source="Zoller + Fröhlich, IMAGER 5016 data sheet",
        range=365.0,
        near=0.3,
        blind_cone=40.0,
        angular_step=_in_a_turn(points),
    )


SCANNERS: dict[ScannerName, ScannerFacts] = {
    "rtc360-high": _rtc360("high", 3.0, 102.0),
    "rtc360-medium": _rtc360("medium", 6.0, 51.0),
    "rtc360-low": _rtc360("low", 12.0, 26.0),
    "blk360-high": _blk360("high", 6.0),
    "blk360-medium": _blk360("medium", 12.0),
    "focus-quarter": _focus("a quarter", 4),
    "focus-eighth": _focus("an eighth", 8),
    "imager5016-high": _imager("high", 10_000),
    "imager5016-middle": _imager("middle", 5_000),
}
"""By the names that `--scanner` takes."""
