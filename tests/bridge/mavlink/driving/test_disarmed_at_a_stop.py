"""A vehicle that somebody disarms at a stop is not armed again before somebody commands to go on."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.document import Scan
from stopgo.mission.run.events import Held, Paused, StateReport
from tests.bridge.mavlink.driving.world import (
    events_of,
    gateway,
    is_state,
    rover,
    scanned,
    site_mission,
    until,
)
from tests.faults.sizes import some

pytestmark = pytest.mark.usefixtures("own_time")

LONG = Scan(profile="default", duration_s=6.0, timeout_s=30.0)
BY = "the autopilot was disarmed by"


def does(stage: str, stop: str = "s1") -> object:
    return lambda report: (
        isinstance(report, StateReport) and (report.stop, report.stop_state) == (stop, stage)
    )


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
@pytest.mark.parametrize(
    ("stage", "state", "event", "verb"),
    [("SETTLING", "HELD", Held, "retry"), ("SCANNING", "PAUSED", Paused, "resume")],
)
def test_the_run_waits_for_a_command(
    profile: str, stage: str, state: str, event: type, verb: str, tmp_path: Path
) -> None:
    """It was armed for the next leg, and drove to it."""
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(settle_s=3.0, scan=LONG))
        station.command("start")
        reports = station.reports()
        until(reports, does(stage))
        operator.disarm()
        until(reports, is_state(state, "FINISHED"))
        waits = events_of(station)[-1]
        assert isinstance(waits, event) and BY in waits.reason
        assert not operator.peer.armed
        station.command(verb)
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ["s1", "s2"]


def test_one_disarmed_after_the_last_look_is_not_armed_for_the_next_leg(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two stages nobody watches, and a heartbeat comes each second."""
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        monkeypatch.setattr("stopgo.bridge.mavlink.driving.takeover_watch.TakeoverWatch.disarmed", look)
        station.push(site_mission(scan=LONG))
        station.command("start")
        reports = station.reports()
        until(reports, does("SCANNING"))
        operator.disarm()
        until(reports, is_state("HELD", "FINISHED"))
        held = events_of(station)[-1]
        assert isinstance(held, Held) and "the path to s2 is blocked" in held.reason and BY in held.reason
        station.command("retry")
        until(reports, is_state("FINISHED"))


def look(watch: object) -> str:
    """Look at the vehicle, and say nothing."""
    return ""


def test_one_disarmed_after_a_pause_is_armed_by_resume(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(settle_s=3.0))
        station.command("start")
        reports = station.reports()
        until(reports, does("SETTLING"))
        station.command("pause")
        operator.disarm()
        station.command("resume")
        until(reports, is_state("FINISHED", "HELD"))
        assert not [event for event in events_of(station) if isinstance(event, Held)]
        assert scanned(station) == ["s1", "s2"]
