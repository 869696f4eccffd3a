"""Conditions of a confirmed scan."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.document import ScannerSpec
from stopgo.mission.run.scans import heading_error

AROUND = ScannerSpec(profile="default", range=5.0)
AHEAD = ScannerSpec(profile="default", range=5.0, fov_deg=90.0)


@pytest.mark.parametrize(
    ("scanner", "heading_deg", "missing_deg"),
    [(AROUND, 90.0, 0.0), (AHEAD, 4.0, 0.0), (AHEAD, -6.0, 6.0), (AHEAD, 354.0, 6.0), (AHEAD, 356.0, 0.0)],
)
def test_a_heading_missed_by_more_than_five_degrees_matters_to_a_scanner_that_looks_ahead(
    scanner: ScannerSpec, heading_deg: float, missing_deg: float
) -> None:
    missing = heading_error(scanner, 0.0, math.radians(heading_deg))
    assert math.degrees(missing) == pytest.approx(missing_deg)
