"""Somebody takes the vehicle while it settles at a stop: the run is held at once, not after the scan."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.run.events import Held, Scanned, StateReport
from tests.bridge.mavlink.driving.world import (
    events_of,
    gateway,
    is_state,
    retried,
    rover,
    scanned,
    site_mission,
    until,
)

pytestmark = pytest.mark.usefixtures("own_time")

SETTLE_S = 3.0


def settles(report: object) -> bool:
    return isinstance(report, StateReport) and (report.stop, report.stop_state) == ("s1", "SETTLING")


@pytest.mark.parametrize(("profile", "way"), [("ardupilot", "hold"), ("px4", "manual")])
def test_a_run_is_held_and_goes_on_once_the_vehicle_is_handed_over(
    profile: str, way: str, tmp_path: Path
) -> None:
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(settle_s=SETTLE_S))
        station.command("start")
        reports = station.reports()
        until(reports, settles)
        getattr(operator, way)()
        until(reports, is_state("HELD", "FINISHED"))
        events, mode = events_of(station), operator.mode()
        operator.hold()
        until(reports, lambda report: retried(station))
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ["s1", "s2"]
    assert isinstance(events[-1], Held) and not [event for event in events if isinstance(event, Scanned)]
    assert events[-1].reason.startswith("while it settled at s1: ") and mode in events[-1].reason


def test_a_restart_is_none(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(settle_s=SETTLE_S))
        station.command("start")
        reports = station.reports()
        until(reports, settles)
        vehicle.off()
        vehicle.on()
        until(reports, is_state("HELD", "FINISHED"))
        held = [event for event in events_of(station) if isinstance(event, Held)]
        assert not [event for event in held if "settled" in event.reason]
