"""Settings that the gateway gives an autopilot: its origin after a restart, and its timeout with consent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.tuning import OF_KIND, Tuning
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from tests.bridge.mavlink.driving.world import (
    SITE,
    Operator,
    Rover,
    gateway,
    is_driving,
    is_state,
    rover,
    scanned,
    site_mission,
    until,
)
from tests.faults.sizes import some
from tests.own_time import World, stepped_into

OWN = VehicleOrigin(lat=SITE.lat, lon=SITE.lon, alt=SITE.alt)
TIMEOUTS = {"ardupilot": "GUID_TIMEOUT", "px4": "COM_OF_LOSS_T"}


@pytest.fixture(autouse=True)
def world() -> Iterator[World]:
    with stepped_into() as stepped:
        yield stepped


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_an_origin_that_a_restart_took_is_given_again_by_a_gateway_that_may_not_arm(
    tmp_path: Path, world: World, profile: str
) -> None:
    faults = VehicleFaults((VehicleFault("restart", 12, 3.0),))
    with rover(tmp_path, profile, origin=None, faults=faults) as (vehicle, operator):
        assert operator.peer.set_origin(OWN) == OWN
        operator.arm()
        with gateway(tmp_path, vehicle.url, arm=False) as station:
            station.push(site_mission())
            station.command("start")
            held = until(station.reports(), is_state("HELD", "FINISHED"))
            assert held.state == "HELD"
            operator.hold()
            operator.arm()
            ordered(station, "retry", world)
            until(station.reports(), is_state("FINISHED", "HELD"))
            assert scanned(station) == ["s1", "s2"]


def ordered(station: Any, verb: str, world: World) -> None:
    """The origin is given some seconds after the restart; mode and arming show in the next heartbeat."""
    for _ in range(10):
        try:
            station.command(verb)
        except NegativeResult as refused:
            assert "not_ready" in str(refused)
            world.sleep(1.0)
        else:
            return
    raise AssertionError("no origin was given")


def test_an_origin_that_gateway_and_autopilot_lost_together_is_given_with_consent(
    tmp_path: Path, world: World
) -> None:
    with rover(tmp_path, "ardupilot", origin=None) as (vehicle, operator):
        assert operator.peer.set_origin(OWN) == OWN
        with gateway(tmp_path, vehicle.url) as station:
            station.push(site_mission())
            station.command("start")
            until(station.reports(), is_driving(0.5))
        switched_off_and_on(vehicle)
        operator.hold()
        with (
            gateway(tmp_path, vehicle.url) as station,
            pytest.raises(NegativeResult, match=r"no origin.*--set-origin"),
        ):
            station.command("resume")
        with gateway(tmp_path, vehicle.url, set_origin=True) as station:
            ordered(station, "resume", world)
            until(station.reports(), is_state("FINISHED", "HELD"))
            assert scanned(station) == ["s1", "s2"]


def switched_off_and_on(vehicle: Rover) -> None:
    vehicle.off()
    vehicle.on(replace(vehicle.setup, origin=None))


def timeout_of(operator: Operator) -> float:
    name = TIMEOUTS[operator.autopilot.name]
    return read_parameters(operator.peer, [name])[name]


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_the_autopilots_own_timeout_is_set_with_consent_and_read_back(
    tmp_path: Path, profile: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with rover(tmp_path, profile) as (vehicle, operator):
        before_s = timeout_of(operator)
        with gateway(tmp_path, vehicle.url):
            assert timeout_of(operator) == before_s > 0.5
        assert f"--set-timeout sets {TIMEOUTS[profile]} to 0.5 s" in capsys.readouterr().err
        with gateway(tmp_path, vehicle.url, set_timeout=True):
            assert timeout_of(operator) == 0.5
        assert f"was {before_s:g} s and is 0.5 s now" in capsys.readouterr().err


def test_a_timeout_that_cannot_be_set_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a firmware without the parameter, such as Rover 4.5 to 4.7, and by one that keeps its value."""
    with monkeypatch.context() as older:
        older.delitem(OF_KIND["ardupilot"], "GUID_TIMEOUT")  # type: ignore[arg-type]
        with (
            rover(tmp_path / "older", "ardupilot") as (vehicle, _),
            pytest.raises(InputError, match=r"does not report GUID_TIMEOUT.*start without --set-timeout"),
            gateway(tmp_path / "older", vehicle.url, set_timeout=True),
        ):
            pass
    monkeypatch.setattr(Tuning, "set", lambda *_: False)
    with (
        rover(tmp_path, "px4") as (vehicle, _),
        pytest.raises(InputError, match=r"was sent COM_OF_LOSS_T 0.5 and reports 1"),
        gateway(tmp_path, vehicle.url, set_timeout=True),
    ):
        pass
