"""The gateway with a vehicle that drives realistically: in time, on its path, and on after a fault."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaultKind, VehicleFaults
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import NegativeResult
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.run.events import Arrived, Held, Pose, PoseReport
from stopgo.mission.run.route_position import foot
from tests.bridge.mavlink.driving.world import (
    SITE,
    cornered_mission,
    events_of,
    gateway,
    is_driving,
    is_state,
    retried,
    rover,
    scanned,
    site_mission,
    until,
)
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import some
from tests.own_time import World, stepped_into

STIFF = {"SIM_STICTION": 0.03, "SIM_LAG": 0.6, "SIM_TURN_LAG": 0.3, "SIM_POS_DRIFT": 0.01}
"""Wheels that stick and follow late, and a place that wanders by a centimetre."""


@pytest.fixture(autouse=True)
def world() -> Iterator[World]:
    with stepped_into() as stepped:
        yield stepped


@pytest.mark.parametrize(
    ("profile", "changed"),
    some([(profile, changed) for changed in ({}, STIFF) for profile in ("ardupilot", "px4")], every=4),
    ids=str,
)
def test_stops_of_5_cm_are_reached_in_twice_the_planned_time_and_on_the_legs(
    tmp_path: Path, world: World, profile: str, changed: dict[str, float]
) -> None:
    mission = cornered_mission()
    with rover(tmp_path, profile, changed=changed) as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(mission)
        began_ns = world.monotonic_ns()
        station.command("start")
        poses = [report.pose for report in station.reports() if isinstance(report, PoseReport)]
        took_s = (world.monotonic_ns() - began_ns) / 1e9
        events = events_of(station)
    arrived = [event for event in events if isinstance(event, Arrived)]
    assert [event.stop for event in arrived] == ["s1", "s2", "s3", "s4", "s5"]
    assert max(event.deviation_m for event in arrived) <= 0.05
    assert took_s <= 2 * schedule(mission).total_s
    legs = [pair for stop in mission.stops for pair in pairwise(stop.approach)]
    assert max(min(_beside(pair, pose) for pair in legs) for pose in poses) < 0.1


@pytest.mark.parametrize(
    ("profile", "parameter"), some([("ardupilot", "GUID_TIMEOUT"), ("px4", "COM_OF_LOSS_T")], every=2)
)
def test_one_that_gives_up_sooner_is_driven_faster_to_its_stops(
    tmp_path: Path, world: World, profile: str, parameter: str
) -> None:
    took_ns = []
    for gives_up_s in (0.5, 5.0):
        folder = tmp_path / f"{gives_up_s}"
        with (
            rover(folder, profile, changed={parameter: gives_up_s}) as (vehicle, _),
            gateway(folder, vehicle.url) as station,
        ):
            station.push(site_mission())
            began_ns = world.monotonic_ns()
            station.command("start")
            until(station.reports(), is_state("FINISHED"))
            took_ns.append(world.monotonic_ns() - began_ns)
    assert took_ns[0] < 0.8 * took_ns[1]


def _beside(leg: Any, pose: Pose) -> float:
    return math.dist((pose.x, pose.y), foot(*leg, (pose.x, pose.y)))


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
@pytest.mark.parametrize(("kind", "lasts_s"), some([("gap", 0.8), ("gap", 8.0), ("restart", 4.0)], every=2))
def test_a_short_silence_and_a_restart_are_taken_up_by_itself(
    tmp_path: Path, profile: str, kind: VehicleFaultKind, lasts_s: float
) -> None:
    faults = VehicleFaults((VehicleFault(kind, 9, lasts_s),))
    with rover(tmp_path, profile, faults=faults) as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        until(station.reports(), is_state("FINISHED", "HELD"))
        assert [event for event in events_of(station) if isinstance(event, Held)] == []
        assert scanned(station) == ["s1", "s2"]


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_one_that_refuses_to_arm_until_its_sensors_agree_is_asked_again(tmp_path: Path, profile: str) -> None:
    """As ArduPilot did for 18 s after each start."""
    faults = VehicleFaults((VehicleFault("restart", 30, 4.0),))
    settles = {"SIM_ARM_AFTER": 18.0}
    with (
        rover(tmp_path, profile, faults=faults, changed=settles) as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        until(station.reports(), is_state("FINISHED", "HELD"))
        assert [event for event in events_of(station) if isinstance(event, Held)] == []
        assert scanned(station) == ["s1", "s2"]


def test_one_that_refuses_to_arm_for_good_is_held_for_what_it_says(tmp_path: Path) -> None:
    with (
        rover(tmp_path, "ardupilot", changed={"SIM_ARM_AFTER": 9000.0}) as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        until(station.reports(), is_state("HELD"))
        (held,) = [event for event in events_of(station) if isinstance(event, Held)]
    assert 'answered arming with FAILED (it said "Arm: Accels inconsistent")' in held.reason


@pytest.mark.parametrize("by_hand", [False, True])
def test_a_hold_during_a_silence_is_the_autopilots_own_or_somebodys(
    tmp_path: Path, world: World, by_hand: bool
) -> None:
    """PX4 holds when it hears nobody, and drives on; a hold by somebody it reports as well."""
    with (
        rover(tmp_path, "px4") as (vehicle, operator),
        Lossy(vehicle.url.number, Roughness(), seed=1) as line,
        gateway(tmp_path, line.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        line.roughness = Roughness(loss=1.0)
        world.sleep(4.0)
        assert operator.mode() == "HOLD"
        if by_hand:
            operator.hold()
        world.sleep(0.5)  # the line loses what was told before that, too
        line.roughness = Roughness()
        state = until(reports, is_state("FINISHED", "HELD"))
        held = [event.reason for event in events_of(station) if isinstance(event, Held)]
        assert state.state == ("HELD" if by_hand else "FINISHED")
        assert all("somebody (not known who) switched the autopilot to HOLD" in reason for reason in held)
        assert operator.mode() == "HOLD"


def test_a_jump_of_its_place_is_driven_back_from(tmp_path: Path) -> None:
    faults = VehicleFaults((VehicleFault("jump", 6, 0.25),))
    with rover(tmp_path, "ardupilot", faults=faults) as (vehicle, _), gateway(tmp_path, vehicle.url) as s:
        s.push(site_mission())
        s.command("start")
        until(s.reports(), is_state("FINISHED", "HELD"))
        assert scanned(s) == ["s1", "s2"]
        assert all(event.deviation_m <= 0.05 for event in events_of(s) if isinstance(event, Arrived))


def test_a_vehicle_that_was_carried_while_it_restarted_is_not_driven_on(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        vehicle.off()
        vehicle.on(replace(vehicle.setup, at=Pose(x=3.0, y=3.0, heading=0.0)))
        held = until(reports, lambda report: isinstance(report, Held))
        assert "the autopilot was restarted and reports a position" in held.reason
        assert "check where it is" in held.reason


def test_a_vehicle_whose_origin_is_moved_on_a_leg_is_held_until_it_is_back(tmp_path: Path) -> None:
    """PX4 takes another origin at any time. Its metres then count from there, and so do its stops."""
    moved = VehicleOrigin(lat=SITE.lat + 5e-6, lon=SITE.lon, alt=SITE.alt)
    with rover(tmp_path, "px4") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        operator.peer.set_origin(moved)
        held = until(reports, lambda report: isinstance(report, Held))
        assert "0.56 m from the mission's" in held.reason
        assert not scanned(station)
        with pytest.raises(NegativeResult, match=r"0\.56 m from the mission's"):
            station.command("retry")
        operator.peer.set_origin(VehicleOrigin(lat=SITE.lat, lon=SITE.lon, alt=SITE.alt))
        while not retried(station):
            pass
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ["s1", "s2"]


def test_without_leave_to_arm_a_restart_is_held_for_who_arms_it(tmp_path: Path) -> None:
    with (
        rover(tmp_path, "ardupilot") as (vehicle, operator),
        gateway(tmp_path, vehicle.url, arm=False) as station,
    ):
        operator.arm()
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        vehicle.off()
        vehicle.on()
        held = until(reports, lambda report: isinstance(report, Held))
        assert "restarted and is disarmed; arm it, or start stopgo robot with --arm" in held.reason


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_failsafe_that_holds_the_vehicle_is_named_and_not_taken_for_somebody(
    tmp_path: Path, profile: str
) -> None:
    faults = VehicleFaults((VehicleFault("failsafe", 6, 3.0),))
    with rover(tmp_path, profile, faults=faults) as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission(stops=5))
        station.command("start")
        until(station.reports(), is_state("HELD"))
        held = events_of(station)[-1]
    assert isinstance(held, Held)
    assert "the autopilot's failsafe (geofence: " in held.reason
    assert "somebody" not in held.reason
