"""A scan in AUTO during which the position leaves the tolerance does not count."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated import vehicle_scanner
from stopgo.bridge.mavlink.simulated.estimator import Estimator
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Failed, Scanned
from tests.bridge.mavlink.auto.site import Site, real_tour, watched

pytestmark = pytest.mark.usefixtures("own_time")


def test_a_scan_during_which_the_vehicle_moves_beyond_the_tolerance_is_not_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def jump(estimator: Estimator, metres: float) -> None:
        estimator._jumped[0] += metres

    monkeypatch.setattr(Estimator, "jump", jump)
    monkeypatch.setattr(vehicle_scanner, "MOVED_M", math.inf)
    mission = real_tour(
        scan=Scan(profile="default", duration_s=30.0, timeout_s=60.0), tolerance_m=0.3, on_failure="skip"
    )
    site = Site(tmp_path, "ardupilot", mission=mission, faults=["jump@5=0.45"])
    with site.up():
        assert site.order("start").outcome == "ok"
        with watched(site):
            pass
    failed = next(event for event in site.events if isinstance(event, Failed))
    assert failed.stop == "S1" and "moved 0.4" in failed.reason and "during the scan" in failed.reason
    assert "S1" not in [event.stop for event in site.events if isinstance(event, Scanned)]
