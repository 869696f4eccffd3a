"""Whoever takes a gateway's vehicle, or steers it besides, is named as far as the line shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Arrived, Failed, Held
from tests.bridge.mavlink.driving.world import (
    Operator,
    events_of,
    gateway,
    is_driving,
    is_state,
    rover,
    site_mission,
    until,
)
from tests.bridge.mavlink.shared_line import all_hear_all
from tests.faults.sizes import some
from tests.own_time import stepped_into

STATION = "system 254, component 190"
"""The operator's, as `reached` opens it."""


@pytest.fixture(autouse=True)
def world() -> Iterator[None]:
    with stepped_into():
        yield


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line on which all hear all, as a radio."""
    all_hear_all(monkeypatch)


def sends_set_points(operator: Operator) -> None:
    peer = operator.peer
    peer.send(position_setpoint(peer.who, (0.0, 0.0), down=0.0, now_ms=0))


def overrides(operator: Operator) -> None:
    peer = operator.peer
    peer.send(dialect.MAVLink_rc_channels_override_message(1, 1, 1900, *[65_535] * 7))


def moves_a_joystick(operator: Operator) -> None:
    operator.peer.send(dialect.MAVLink_manual_control_message(1, 400, 0, 500, 0, 0))


Does = Callable[[Operator], None]


def held_after(station: Any, operator: Operator, does: Does) -> str:
    station.push(site_mission())
    station.command("start")
    until(station.reports(), is_driving(0.4))
    does(operator)
    until(station.reports(), is_state("HELD", "FINISHED"))
    (held,) = [event for event in events_of(station) if isinstance(event, Held)]
    return str(held.reason)


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
@pytest.mark.parametrize(
    "does", [Operator.manual, Operator.disarm, sends_set_points, overrides, moves_a_joystick]
)
def test_a_station_that_takes_or_steers_the_vehicle_is_named(
    tmp_path: Path, shared: None, profile: str, does: Does
) -> None:
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        assert STATION in held_after(station, operator, does)


@pytest.mark.parametrize("does", [Operator.manual, Operator.disarm])
def test_a_station_on_another_line_is_not_known(tmp_path: Path, does: Does) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        assert "somebody (not known who)" in held_after(station, operator, does)


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_remote_control_is_named_by_its_channels(tmp_path: Path, profile: str) -> None:
    faults = VehicleFaults((VehicleFault("switch", 8, 0.0),))
    with rover(tmp_path, profile, faults=faults) as (vehicle, operator):
        operator.hold()
        with gateway(tmp_path, vehicle.url) as station:
            reason = held_after(station, operator, lambda _: None)
    assert "the remote control (its channel 8: 1500 → 1100 µs)" in reason


def test_set_points_of_another_station_during_a_scan_fail_it_before_the_vehicle_moves(
    tmp_path: Path, shared: None
) -> None:
    scan = Scan(profile="default", duration_s=6.0, timeout_s=30.0)
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(scan=scan, on_failure="ask", retries=0))
        station.command("start")
        until(station.reports(), lambda report: isinstance(report, Arrived))
        until(station.reports(), lambda report: getattr(report, "stop_state", "") == "SCANNING")
        sends_set_points(operator)
        until(station.reports(), is_state("HELD", "FINISHED"))
        (failed,) = [event for event in events_of(station) if isinstance(event, Failed)]
    assert f"{STATION} sends the vehicle set points during the scan" in failed.reason
