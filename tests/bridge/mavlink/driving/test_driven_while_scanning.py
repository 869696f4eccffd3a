"""Another station drives the vehicle while it scans: the scan does not count and is made again."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated import vehicle_scanner
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Failed, Held, Scanned, StateReport
from stopgo.mission.run.tolerance import deviation
from tests.bridge.mavlink.driving.world import (
    Operator,
    bearing_of_corridor,
    events_of,
    gateway,
    is_state,
    rover,
    scanned,
    site_mission,
    until,
)

pytestmark = pytest.mark.usefixtures("own_time")

AWAY_M = 0.6
SCAN = Scan(profile="default", duration_s=8.0, timeout_s=30.0)


@pytest.fixture(autouse=True)
def unwatchful(monkeypatch: pytest.MonkeyPatch) -> None:
    """A scanner that does not notice that it is moved."""
    monkeypatch.setattr(vehicle_scanner, "MOVED_M", math.inf)
    monkeypatch.setattr(vehicle_scanner, "TURNED_RAD", math.inf)


def scans(report: object) -> bool:
    return isinstance(report, StateReport) and (report.stop, report.stop_state) == ("s1", "SCANNING")


def push_on(operator: Operator) -> None:
    """A set point ahead, as another station in the guided mode sends it."""
    north, east = operator.place()
    ahead = tuple(AWAY_M * part for part in bearing_of_corridor())
    point = (north + ahead[0], east + ahead[1])
    for _ in range(3):
        operator.peer.send(position_setpoint(operator.peer.who, point, down=0.0, now_ms=0))


def test_a_stop_scanned_while_another_station_drives_is_driven_to_and_scanned_again(tmp_path: Path) -> None:
    mission = site_mission(scan=SCAN, retries=1)
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(mission)
        station.command("start")
        reports = station.reports()
        until(reports, scans)
        push_on(operator)
        until(reports, is_state("FINISHED", "HELD"))
        events = events_of(station)
        assert scanned(station) == ["s1", "s2"]
    poses = {event.stop: event.pose for event in events if isinstance(event, Scanned)}
    assert all(deviation(poses[stop.id], stop) <= stop.tolerance_m for stop in mission.stops)


def test_without_tries_left_the_run_is_held_at_standstill_with_the_reason(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(scan=SCAN, retries=0, on_failure="ask"))
        station.command("start")
        reports = station.reports()
        until(reports, scans)
        push_on(operator)
        until(reports, is_state("FINISHED", "HELD"))
        events, mode = events_of(station), operator.mode()
    assert not [event for event in events if isinstance(event, Scanned)]
    (failed,) = [event for event in events if isinstance(event, Failed)]
    assert failed.stop == "s1" and "moved" in failed.reason and "during the scan" in failed.reason
    assert isinstance(events[-1], Held) and failed.reason in events[-1].reason
    assert mode == "HOLD"
