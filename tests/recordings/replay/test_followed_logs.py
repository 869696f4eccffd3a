"""A telemetry log of a vehicle that drove our mission by itself is followed as the vehicle would be live."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.mavlink.simulated.complete_vehicle import complete_vehicle
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFaults, read_vehicle_fault
from stopgo.mission.document import Mission
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Pose, Scanned, Unconfirmed
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replay_text import as_text
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from tests.mission.mavlink.following.worlds import told, tour
from tests.recordings.logs.writing import write_telemetry_log

ORIGIN = SiteOrigin(lat=47.3977, lon=8.5456, alt=488.0, heading_deg=0.0)
ROVER, STATION = 1, 255
AUTO_MODE, HOLD_MODE = 10, 4


BEFORE_S, AFTER_S, STEP_S = 3.0, 60.0, 0.05
"""Before the order to go, from then on, and between two looks of the vehicle at its clock."""


def mission(**details: Any) -> Mission:
    """For a vehicle that drives as a real one, and so takes its time to stand still."""
    return msgspec.structs.replace(tour(**{"settle_s": 3.0, **details}), georeference=ORIGIN)


def rover_setting(folder: Path, faults: tuple[str, ...]) -> VehicleSetup:
    start = Pose(x=0.0, y=0.0, heading=0.0)
    found = VehicleFaults(tuple(map(read_vehicle_fault, faults)))
    return VehicleSetup(PROFILES["ardupilot"], folder, ORIGIN, start, found, seed=1)


def logged(
    path: Path, plan: Mission, *, faults: tuple[str, ...] = (), orders: dict[float, Any] | None = None
) -> Path:
    """A log of an ArduPilot Rover that is given a mission and drives it; `orders` by seconds from AUTO."""
    clock, rows = SimulatedClock(), list[tuple[int, int, Any]]()
    sent = translate(plan, "ardupilot", trigger="auto")
    vehicle = complete_vehicle(
        rover_setting(path.parent / "vehicle", faults),
        clock=clock,
        wall=clock,
        send=lambda message: rows.append((clock.now_ns(), ROVER, message)),
    )

    def say(message: Any) -> None:
        rows.append((clock.now_ns(), STATION, message))
        packed = dialect.MAVLink(None, srcSystem=STATION, srcComponent=190)
        vehicle.receive(packed.decode(bytearray(message.pack(packed))))

    def drive(seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            clock.wait(STEP_S)
            vehicle.advance()

    drive(BEFORE_S)
    items = upload_of(sent)
    say(dialect.MAVLink_mission_count_message(1, 1, len(items)))
    for number, item in enumerate(items):
        numbers = (*item.params, item.x, item.y, item.z)
        say(dialect.MAVLink_mission_item_int_message(1, 1, number, item.frame, item.command, 0, 1, *numbers))
    say(command(Command.COMPONENT_ARM_DISARM, 1))
    say(in_mode(AUTO_MODE))
    past = 0.0
    for at, order in sorted((orders or {}).items()):
        drive(at - past)
        say(order)
        past = at
    drive(AFTER_S - past)
    return write_telemetry_log(path, rows)


def command(number: int, *params: float) -> Any:
    given = (*params, *(0.0,) * (7 - len(params)))
    return dialect.MAVLink_command_long_message(1, 1, number, 0, *given)


def in_mode(number: int) -> Any:
    return command(Command.DO_SET_MODE, 1, number)


def replayed(path: Path, plan: Mission) -> Replay:
    return replay(read_log(path), plan, Placing())


def test_a_log_of_auto_tells_its_scans_by_the_camera(tmp_path: Path) -> None:
    """Where only halts were seen nobody would know of them."""
    plan = mission()
    laid = replayed(logged(tmp_path / "auto.tlog", plan), plan)
    words = [f"{word} S{number}" for number in (1, 2, 3) for word in ("Arrived", "Settled", "Scanned")]
    assert told(laid.run.events) == ["Started", *words, "Finished"]
    assert not laid.inferred
    assert {event.file[-4:] for event in laid.run.events if isinstance(event, Scanned)} == {".e57"}


def test_stops_scanned_outside_their_tolerance_are_told_and_not_driven_as_planned(tmp_path: Path) -> None:
    """The vehicle drives as a real one: beside its stops, which it calls reached."""
    narrow, wide = mission(), mission(tolerance_m=0.4)
    path = logged(tmp_path / "auto.tlog", narrow)
    laid = replayed(path, narrow)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3
    assert [item.stop for item in laid.comparison.outside] == ["S1", "S2", "S3"]
    assert drive_verdict(laid).exit_code == 1
    for item in laid.comparison.stops:
        assert 0.08 < (item.deviation_m or 0.0) < 0.4
        away = f"{item.stop}: position error {1000 * (item.deviation_m or 0.0):.0f} mm (tolerance 50 mm)."
        assert away in drive_verdict(laid).text and away in as_text(laid)
    assert drive_verdict(replayed(path, wide)).exit_code == 0


def test_a_scan_that_failed_is_told_and_the_way_goes_on(tmp_path: Path) -> None:
    plan = mission()
    laid = replayed(logged(tmp_path / "auto.tlog", plan, faults=("scanner@2",)), plan)
    assert "Failed S2" in told(laid.run.events)
    assert "Scanned S3" in told(laid.run.events)


def test_a_vehicle_that_was_stopped_and_sent_on_is_followed_through_it(tmp_path: Path) -> None:
    plan = mission()
    orders = {1.0: in_mode(HOLD_MODE), 20.0: in_mode(AUTO_MODE)}
    laid = replayed(logged(tmp_path / "auto.tlog", plan, orders=orders), plan)
    words = told(laid.run.events)
    assert [word for word in words if word in ("Paused", "Resumed", "Finished")] == [
        "Paused", "Resumed", "Finished"
    ]  # fmt: skip
    assert [word for word in words if word.startswith("Scanned")] == [
        "Scanned S1",
        "Scanned S2",
        "Scanned S3",
    ]


def test_a_stop_that_the_station_jumped_over_is_no_scan(tmp_path: Path) -> None:
    """And one to which the vehicle is sent back is."""
    plan = mission()
    sent = translate(plan, "ardupilot", trigger="auto")
    third = next(place for place, one in enumerate(sent.placed) if (one.role, one.stop) == ("stop", "S3")) + 1
    orders = {0.5: dialect.MAVLink_mission_set_current_message(1, 1, third)}
    laid = replayed(logged(tmp_path / "auto.tlog", plan, orders=orders), plan)
    assert [event.stop for event in laid.run.events if isinstance(event, Scanned)] == ["S3"]
    missed = [str(event.stop) for event in laid.run.events if isinstance(event, Unconfirmed)]
    assert missed == ["S1", "S2"]


def test_a_log_with_another_mission_is_not_followed_as_ours(tmp_path: Path) -> None:
    plan = mission()
    path = logged(tmp_path / "auto.tlog", plan)
    moved = msgspec.structs.replace(plan.stops[1], x=plan.stops[1].x + 0.3)
    other = msgspec.structs.replace(plan, stops=(plan.stops[0], moved, plan.stops[2]))
    laid = replayed(path, other)
    assert laid.inferred
    assert any("(stop S2) lies 0.3" in line for line in laid.uploads)
