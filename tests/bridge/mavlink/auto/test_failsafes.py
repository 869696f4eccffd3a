"""A failsafe of the autopilot that holds the vehicle in AUTO is reported with its cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.document import Scan
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.run.events import Paused
from tests.bridge.mavlink.auto.site import KINDS, Site, real_tour, until, watched

pytestmark = pytest.mark.usefixtures("own_time")

CAUSES = ("battery", "remote control lost", "ground station lost", "geofence", "crash", "position estimate")


@pytest.mark.parametrize("profile", ["ardupilot", "px4"])
@pytest.mark.parametrize("cause", [0, 3])
def test_a_failsafe_that_holds_the_vehicle_is_named_with_its_text(
    tmp_path: Path, profile: str, cause: int
) -> None:
    mission = real_tour(scan=Scan(profile="default", duration_s=20.0, timeout_s=60.0))
    site = Site(tmp_path, profile, mission=mission, faults=[f"failsafe@6={cause}"])
    text = autopilot_named(KINDS[profile]).failsafe_texts[cause]
    with site.up():
        assert site.order("start").outcome == "ok"
        with watched(site):
            until(site, lambda events, run: any(isinstance(event, Paused) for event in events))
            assert site.order("resume").outcome == "ok"
    paused = next(event for event in site.events if isinstance(event, Paused))
    assert paused.reason == f'mode HOLD, by the autopilot\'s failsafe ({CAUSES[cause]}: "{text}")'
    assert site.run.done == ("S1", "S2", "S3")


def test_a_change_of_mode_without_a_failsafe_is_the_operators(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), site.reached() as station:
        station.command("start")
        with watched(site):
            with site.reached() as other:
                other.command("pause")
            until(site, lambda events, run: run.state == "PAUSED")
            assert "failsafe" not in site.run.reason
            station.command("resume")
