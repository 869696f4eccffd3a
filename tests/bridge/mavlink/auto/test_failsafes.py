"""A failsafe of the autopilot that holds the vehicle in AUTO is reported with its cause."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from stopgo.mission.document import Scan
from stopgo.mission.errors import NegativeResult
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.run.events import Paused
from stopgo.mission.run.health_text import health_text
from tests.bridge.mavlink.auto.site import KINDS, Site, real_tour, until, watched
from tests.faults.sizes import some

pytestmark = pytest.mark.usefixtures("own_time")

CAUSES = ("battery", "remote control lost", "ground station lost", "geofence", "crash", "position estimate")
LASTS = {1: "remote control lost", 3: "geofence is breached", 5: "estimator has no position"}


LONG = real_tour(scan=Scan(profile="default", duration_s=20.0, timeout_s=60.0))


@pytest.mark.parametrize(
    ("profile", "cause"),
    some([(profile, cause) for profile in ("ardupilot", "px4") for cause in LASTS], every=5),
)
def test_a_failsafe_that_holds_the_vehicle_is_named_and_resume_waits_for_its_end(
    tmp_path: Path, profile: str, cause: int
) -> None:
    site = Site(tmp_path, profile, mission=LONG, faults=[f"failsafe@6={cause}"])
    text = autopilot_named(KINDS[profile]).failsafe_texts[cause]
    with site.up():
        assert site.order("start").outcome == "ok"
        with watched(site):
            until(site, lambda events, run: any(isinstance(event, Paused) for event in events))
            with pytest.raises(NegativeResult, match=f"not_ready: .*{LASTS[cause]}"):
                site.order("resume")
            time.sleep(25.0)
            assert site.order("resume").outcome == "ok"
    paused = next(event for event in site.events if isinstance(event, Paused))
    assert paused.reason == f'mode HOLD, by the autopilot\'s failsafe ({CAUSES[cause]}: "{text}")'
    assert site.run.done == ("S1", "S2", "S3")


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_batterys_failsafe_lasts_until_the_autopilot_is_restarted(tmp_path: Path, profile: str) -> None:
    site = Site(tmp_path, profile, mission=LONG, faults=["failsafe@6=0"])
    with site.up():
        site.order("start")
        with watched(site):
            until(site, lambda events, run: any(isinstance(event, Paused) for event in events))
            time.sleep(25.0)  # longer than any other
            with pytest.raises(NegativeResult, match=r"not_ready: .*restart the autopilot"):
                site.order("resume")
            with site.reached() as station:
                state = station.status()
            assert (state.battery_ok, state.position_ok, state.fence_ok) == (False, True, None)
            assert "its failsafe lasts" in health_text(state) and "geofence unknown" in health_text(state)
            site.order("abort")
    assert "(battery:" in next(event for event in site.events if isinstance(event, Paused)).reason


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
