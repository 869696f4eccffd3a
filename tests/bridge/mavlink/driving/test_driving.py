"""The controller with an autopilot for a base: what it drives, what it refuses, and who may interfere."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.mavlink.simulated.chassis import Chassis
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import read_signing_key
from stopgo.mission.document import Scan, with_digest
from stopgo.mission.errors import InputError, NegativeResult, RobotUnreachable
from stopgo.mission.mavlink.telemetry import STILL_M_S
from stopgo.mission.run.events import Arrived, Finished, Held, Paused, PoseReport, Scanned, Settled
from tests.bridge.mavlink.driving.world import (
    SITE,
    bearing_of_corridor,
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
from tests.ports import free_port

pytestmark = pytest.mark.usefixtures("own_time")

ALL = ["s1", "s2"]
WAYS = [("ardupilot", "camera"), ("ardupilot", "script"), ("px4", "camera")]


@pytest.mark.parametrize(("profile", "trigger"), WAYS)
def test_an_autopilot_drives_a_mission_to_its_end(tmp_path: Path, profile: str, trigger: Any) -> None:
    mission = site_mission()
    with (
        rover(tmp_path, profile) as (vehicle, operator),
        gateway(tmp_path, vehicle.url, trigger=trigger) as s,
    ):
        s.push(mission)
        s.command("start")
        reports = list(s.reports())
        stands = operator.place()
    events = [report for report in reports if isinstance(report, Arrived | Scanned | Finished)]
    assert [event.stop for event in events if isinstance(event, Scanned)] == ALL
    assert isinstance(events[-1], Finished)
    assert all(event.deviation_m < 0.05 for event in events if isinstance(event, Arrived))
    files = [event.file for event in events if isinstance(event, Scanned)]
    assert len(set(files)) == 2
    # Four metres along the corridor, which bears 120°.
    assert stands == pytest.approx([4 * part for part in bearing_of_corridor()], abs=0.05)
    driven = [report.pose for report in reports if isinstance(report, PoseReport)]
    assert max(abs(pose.y) for pose in driven) < 0.05
    assert all(abs(math.remainder(pose.heading, math.tau)) < math.radians(10) for pose in driven)


def test_a_script_trigger_that_the_autopilot_does_not_take_is_refused_at_the_start(tmp_path: Path) -> None:
    with (
        rover(tmp_path, "px4") as (vehicle, _),
        pytest.raises(InputError, match=r"--trigger script: .* DO_SEND_SCRIPT_MESSAGE.*use --trigger camera"),
        gateway(tmp_path, vehicle.url, trigger="script"),
    ):
        pass


def test_an_ardupilot_rover_turns_to_the_headings_that_a_narrow_scanner_needs(tmp_path: Path) -> None:
    mission = site_mission(heading=math.pi / 2)
    narrow = msgspec.structs.replace(mission, scanner=msgspec.structs.replace(mission.scanner, fov_deg=90.0))
    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        station.push(with_digest(narrow))
        station.command("start")
        until(station.reports(), is_state("FINISHED"))
        arrived = [event for event in events_of(station) if isinstance(event, Arrived)]
    assert [event.stop for event in arrived] == ALL
    assert all(abs(event.pose.heading - math.pi / 2) < math.radians(1.5) for event in arrived)


def test_a_mission_without_georeference_is_refused(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        with pytest.raises(
            NegativeResult, match="infeasible: the mission has no georeference; plan it with --or"
        ):
            station.push(site_mission(site=None))
        assert station.status().mission_id is None


def test_a_mission_from_another_origin_is_refused(tmp_path: Path) -> None:
    elsewhere = msgspec.structs.replace(SITE, lat=SITE.lat + 5e-6)
    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        with pytest.raises(NegativeResult, match=r"origin \(47\.4.*\) is 0\.56 m from the mission's"):
            station.push(site_mission(site=elsewhere))
        with pytest.raises(NegativeResult, match="more than a kilometre"):
            station.push(site_mission(site=msgspec.structs.replace(SITE, lat=-SITE.lat)))


def test_a_scanner_that_needs_headings_is_not_driven_by_what_cannot_turn(tmp_path: Path) -> None:
    mission = site_mission()
    narrow = msgspec.structs.replace(mission, scanner=msgspec.structs.replace(mission.scanner, fov_deg=90.0))
    with (
        rover(tmp_path, "px4") as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
        pytest.raises(NegativeResult, match="sees 90°"),
    ):
        station.push(with_digest(narrow))


def test_nothing_starts_without_origin_arming_or_a_free_hand(tmp_path: Path) -> None:
    with (
        rover(tmp_path, "ardupilot", origin=None) as (vehicle, operator),
        gateway(tmp_path, vehicle.url, arm=False) as station,
    ):
        station.push(site_mission())
        with pytest.raises(NegativeResult, match="not_ready: the autopilot has no origin"):
            station.command("start")
        vehicle.off()
        vehicle.on()
    with (
        rover(tmp_path, "ardupilot") as (vehicle, operator),
        gateway(tmp_path, vehicle.url, arm=False) as station,
    ):
        with pytest.raises(NegativeResult, match=r"not_ready: the autopilot is disarmed; .*--arm"):
            station.command("start")
        operator.manual()
        refusals = (_refusal(station) for _ in station.reports())
        assert any("not_ready: the autopilot is in MANUAL: somebody else" in why for why in refusals)
        assert station.status().state == "READY"


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_pause_stops_the_vehicle_and_resume_drives_on(tmp_path: Path, profile: str) -> None:
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        station.command("pause")
        until(reports, lambda report: isinstance(report, PoseReport) and report.speed < STILL_M_S)
        until(reports, lambda report: isinstance(report, PoseReport) and operator.mode() == "HOLD")
        station.command("resume")
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_an_operators_hold_is_never_changed_back_before_a_retry(tmp_path: Path, profile: str) -> None:
    with rover(tmp_path, profile) as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        operator.hold()
        held = until(reports, lambda report: isinstance(report, Held))
        assert "somebody (not known who) switched the autopilot to HOLD" in held.reason
        assert (operator.mode(), station.status().state) == ("HOLD", "HELD")
        station.command("retry")
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


def test_who_drives_by_hand_keeps_the_vehicle_until_it_is_handed_over(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        operator.manual()
        held = until(reports, lambda report: isinstance(report, Held))
        assert "somebody (not known who) switched the autopilot to MANUAL" in held.reason
        with pytest.raises(
            NegativeResult, match="somebody else drives it; to hand it over, switch it to HOLD"
        ):
            station.command("retry")
        assert operator.mode() == "MANUAL"
        operator.hold()
        until(reports, lambda report: retried(station))
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


def _refusal(station: Any) -> str:
    """Reason why the robot does not start."""
    with pytest.raises(NegativeResult) as refused:
        station.command("start")
    return str(refused.value)


def test_a_hold_during_a_scan_is_told_at_once_and_the_next_leg_waits(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, lambda report: getattr(report, "stop_state", "") == "SCANNING")
        operator.hold()
        paused = until(reports, lambda report: isinstance(report, Paused))
        assert paused.reason == "somebody (not known who) switched the autopilot to HOLD"
        assert scanned(station) == []
        until(reports, lambda report: isinstance(report, Scanned))
        assert station.status().state == "PAUSED"
        station.command("resume")
        until(reports, lambda report: isinstance(report, Finished))
        assert scanned(station) == ["s1", "s2"]


def test_a_disarmed_vehicle_ends_the_leg(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(0.5))
        operator.disarm()
        held = until(reports, lambda report: isinstance(report, Held))
        assert "the autopilot was disarmed" in held.reason


def test_a_blocked_leg_is_held_and_driven_once_the_path_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    north, east = bearing_of_corridor()
    free = Chassis.move

    def to_the_wall(chassis: Chassis, *details: Any) -> None:
        """Three metres along the corridor is a wall."""
        chassis.wall = ((3.0 * east, 3.0 * north), (3.0 * east - north, 3.0 * north + east))
        free(chassis, *details)

    def taken_away(chassis: Chassis, *details: Any) -> None:
        chassis.wall = None
        free(chassis, *details)

    with rover(tmp_path, "ardupilot") as (vehicle, _), gateway(tmp_path, vehicle.url) as station:
        monkeypatch.setattr(Chassis, "move", to_the_wall)
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        held = until(reports, lambda report: isinstance(report, Held))
        assert held.reason.startswith("the path to s2 is blocked at (")
        # It presses against the wall: by its estimate, which wanders, it stands there or moves about.
        assert re.search(r"(stopped|getting nearer than) (0\.9|1\.0)\d m", held.reason)
        monkeypatch.setattr(Chassis, "move", taken_away)
        station.command("retry")
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


def test_a_scan_that_fails_is_taken_again(tmp_path: Path) -> None:
    faults = VehicleFaults(
        (VehicleFault("scanner", 1), VehicleFault("scanner", 3), VehicleFault("scanner", 4))
    )
    with (
        rover(tmp_path, "ardupilot", faults=faults) as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        held = until(reports, lambda report: isinstance(report, Held))
        assert held.reason == "s2: scan: the vehicle reports that the scan failed"
        assert scanned(station) == ["s1"]
        station.command("retry")
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


def test_a_line_that_is_cut_holds_the_leg_and_stops_the_vehicle_once_it_is_back(tmp_path: Path) -> None:
    with (
        rover(tmp_path, "ardupilot") as (vehicle, operator),
        Lossy(vehicle.url.number, Roughness(), seed=1) as line,
        gateway(tmp_path, line.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(2.1))
        line.roughness = Roughness(loss=1.0)
        held = until(reports, lambda report: isinstance(report, Held))
        assert "no data from the autopilot for" in held.reason
        with pytest.raises(NegativeResult, match="not_ready: no data from the autopilot"):
            station.command("retry")
        assert operator.mode() == "GUIDED"
        line.roughness = Roughness()
        until(reports, lambda report: isinstance(report, PoseReport) and operator.mode() == "HOLD")
        until(reports, lambda report: retried(station))
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


def test_a_vehicle_that_dies_on_a_leg_comes_back_and_is_driven_on(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(2.5))
        vehicle.off()
        held = until(reports, lambda report: isinstance(report, Held))
        assert "no data from the autopilot for" in held.reason
        vehicle.on()
        operator.hold()
        until(reports, lambda report: retried(station))
        until(reports, is_state("FINISHED"))
        assert scanned(station) == ALL


@pytest.mark.parametrize("seed", [1])
def test_a_bad_line_costs_time_and_nothing_else(tmp_path: Path, seed: int) -> None:
    rough = Roughness(delay_s=0.02, loss=0.15, doubled=0.05, overtaken=0.1)
    with (
        rover(tmp_path, "ardupilot") as (vehicle, _),
        Lossy(vehicle.url.number, rough, seed=seed) as line,
        gateway(tmp_path, line.url) as station,
    ):
        station.push(site_mission())
        station.command("start")
        until(station.reports(), is_state("FINISHED"))
        assert scanned(station) == ALL
        assert not [event for event in events_of(station) if isinstance(event, Held)]


def test_a_vehicle_that_wants_signatures_gets_them_and_no_other_gateway_does(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("a passphrase\n")
    with rover(tmp_path, "ardupilot", signing_key=read_signing_key(key)) as (vehicle, _):
        with gateway(tmp_path, vehicle.url) as station:
            station.push(site_mission())
            station.command("start")
            held = until(station.reports(), lambda report: isinstance(report, Held))
            assert "did not answer arming (it signs its messages" in held.reason
        with gateway(tmp_path, vehicle.url, signing_key=key) as station:
            station.command("resume")
            until(station.reports(), is_state("FINISHED"))
            assert scanned(station) == ALL


def test_home_is_driven_back_along_the_legs(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, operator), gateway(tmp_path, vehicle.url) as station:
        station.push(site_mission())
        station.command("start")
        reports = station.reports()
        until(reports, is_driving(2.5))
        station.command("home")
        until(reports, is_state("ABORTED"))
        assert operator.place() == pytest.approx((0.0, 0.0), abs=0.05)


def test_a_robot_does_not_get_ready_without_an_autopilot(tmp_path: Path) -> None:
    nobody = Url("udpout", "127.0.0.1", free_port())
    with (
        pytest.raises(RobotUnreachable, match=r"no vehicle 1 within 0\.5 s"),
        gateway(tmp_path, nobody, patience_s=0.5),
    ):
        pass


def test_a_vehicle_that_is_not_known_to_be_drivable_is_refused(tmp_path: Path) -> None:
    with rover(tmp_path, "ardupilot") as (vehicle, _):
        vehicle.off()
    with pytest.raises(InputError, match="kind 'generic' cannot be driven"):
        _strict(tmp_path)


@pytest.mark.parametrize(
    ("profile", "changed"), [("ardupilot", {"SERVO1_FUNCTION": 26.0}), ("px4", {"CA_AIRFRAME": 5.0})]
)
def test_one_that_steers_like_a_car_is_refused_for_it_cannot_turn_at_corners(
    tmp_path: Path, profile: str, changed: dict[str, float]
) -> None:
    with (
        rover(tmp_path, profile, changed=changed) as (vehicle, _),
        pytest.raises(InputError, match=r"steers like a car .* cannot turn on the spot"),
        gateway(tmp_path, vehicle.url),
    ):
        pass


def _strict(tmp_path: Path) -> None:
    from tests.bridge.mavlink.driving.world import Rover

    made = Rover(tmp_path / "strict", "strict")
    try:
        with gateway(tmp_path, made.url):
            pass
    finally:
        made.off()


def test_a_scan_during_which_the_estimate_jumps_does_not_count_and_is_made_again(tmp_path: Path) -> None:
    """A jump of the estimate cannot be distinguished from a motion of the vehicle."""
    scan = Scan(profile="default", duration_s=40.0, timeout_s=60.0)
    faults = VehicleFaults((VehicleFault("jump", 35, 0.12),))
    with (
        rover(tmp_path, "ardupilot", faults=faults) as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission(stops=1, scan=scan, retries=1))
        station.command("start")
        until(station.reports(), is_state("FINISHED", "HELD"))
        state, events = station.status(), events_of(station)
    assert (state.done, state.outside) == (("s1",), ())
    assert len([event for event in events if isinstance(event, Settled)]) == 2
