"""Laser scanners by name: the nominal figures of common ones, as far as a plan needs them.

One resolution each: a scanner with several resolutions has several names. A step is the spacing at 10 m, or a
full turn divided by its points. No figure is from a maker's dated data sheet: `found_in` names the other
publications. Compare the rest with the data sheet.
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
    found_in: str
    """Publications other than a data sheet, with their figures."""
    range: float
    """Metres."""
    near: float
    """Metres below which nothing is measured."""
    angular_step: float
    """Degrees between neighbouring points."""
    blind_cone: float
    """Degrees of the cone below the scanner in which nothing is measured, from side to side."""
    scan_time: float | None = None
    """Seconds without pictures, where known."""

    def values(self) -> dict[str, Any]:
        """The figures by the names of a plan's parameters."""
        figures = {
            key: getattr(self, key) for key in ("range", "near", "angular_step", "blind_cone", "scan_time")
        }
        return {key: value for key, value in figures.items() if value is not None}


def _at_10_m(spacing_mm: float) -> float:
    """Degrees between points that are so far apart at 10 m."""
    return round(math.degrees(spacing_mm / 10_000), 6)


def _in_a_turn(points: int) -> float:
    """Degrees between so many points all round."""
    return round(360 / points, 6)


def _rtc360(mode: str, spacing_mm: float, scan_time: float) -> ScannerFacts:
    return ScannerFacts(
        name=f"Leica RTC360, {mode} resolution",
        found_in="surveyors' equipment lists: range 0.5 to 130 m; scans of one: down to 61.6° below level",
        range=130.0,
        near=0.5,
        blind_cone=60.0,
        angular_step=_at_10_m(spacing_mm),
        scan_time=scan_time,
    )


def _blk360(mode: str, spacing_mm: float) -> ScannerFacts:
    return ScannerFacts(
        name=f"Leica BLK360 (2nd generation), {mode} resolution",
        found_in="surveyors' equipment lists: range 45 m, 6 mm and 12 mm of its resolutions",
        range=45.0,
        near=0.5,
        blind_cone=90.0,
        angular_step=_at_10_m(spacing_mm),
    )


def _focus(mode: str, divided_by: int) -> ScannerFacts:
    return ScannerFacts(
        name=f"FARO Focus S 70, {mode} of full resolution",
        found_in="surveyors' equipment lists: 6.1 mm at 10 m for a quarter, range from 0.6 m",
        range=70.0,
        near=0.6,
        blind_cone=60.0,
        angular_step=_in_a_turn(40_960 // divided_by),
    )


def _imager(mode: str, points: int) -> ScannerFacts:
    return ScannerFacts(
        name=f"Z+F IMAGER 5016, {mode} resolution",
        found_in="Zhang et al., Hilti-Oxford Dataset, RA-L 2023: range 360 m, field of view 320°",
        range=360.0,
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
