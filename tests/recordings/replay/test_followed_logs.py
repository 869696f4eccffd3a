"""A telemetry log of a vehicle that drove our mission by itself is followed as the vehicle would be live."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.mission.document import Mission
from stopgo.mission.mavlink.read_back import upload_of
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Arrived, Scanned, Skipped
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.replay_text import as_text
from tests.mission.mavlink.following.worlds import told
from tests.recordings.logs.writing import write_telemetry_log
from tests.recordings.replay.auto_vehicle import (
    AUTO_MODE,
    HOLD_MODE,
    FromVehicle,
    Orders,
    heard,
    in_mode,
    item_of,
    logged,
    mission,
    read_back,
    replayed,
)


def test_a_log_of_auto_reports_its_scans_by_the_camera(tmp_path: Path) -> None:
    """Standstills alone would not show them."""
    plan = mission()
    laid = replayed(logged(tmp_path / "auto.tlog", plan), plan)
    words = [f"{word} S{number}" for number in (1, 2, 3) for word in ("Arrived", "Settled", "Scanned")]
    assert told(laid.run.events) == ["Started", *words, "Finished"]
    assert not laid.inferred
    assert {event.file[-4:] for event in laid.run.events if isinstance(event, Scanned)} == {".e57"}


def test_stops_scanned_outside_their_tolerance_are_reported_and_not_driven_as_planned(tmp_path: Path) -> None:
    """The vehicle drives as a real one: off its stops, which it calls reached."""
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


def stamped(
    path: Path, plan: Mission, faster: float, *, only: frozenset[str] | None = None, **conditions: Any
) -> Path:
    """A log of a vehicle whose clock is so much faster than that of the station."""
    rows = [row for row in heard(path, plan, **conditions) if only is None or row[2].get_type() in only]
    begin = rows[0][0]
    told = [(begin + round((ns - begin) / faster), system, message) for ns, system, message in rows]
    return write_telemetry_log(path / "a.tlog", told)


POSES = frozenset({"HEARTBEAT", "ATTITUDE", "LOCAL_POSITION_NED", "GPS_GLOBAL_ORIGIN"})


@pytest.mark.parametrize(
    ("faster", "only", "answer"),
    [(5.0, POSES, "unknown"), (1.0, POSES, "yes"), (0.2, POSES, "unknown"), (0.2, None, "unknown")],
)
def test_standstills_by_another_clock_are_undecided(
    tmp_path: Path, faster: float, only: frozenset[str] | None, answer: str
) -> None:
    """A simulation that runs faster or slower than time."""
    plan = mission(tolerance_m=0.4)
    verdict = drive_verdict(replayed(stamped(tmp_path, plan, faster, only=only), plan))
    assert verdict.answer == answer, verdict.text
    why = f"{faster:g} s passed for the vehicle in each second of the log"
    assert (why in verdict.text) == (faster != 1.0)


@pytest.mark.parametrize("faster", [5.0, 0.2])
def test_a_scan_that_was_reported_elsewhere_is_no_stop_by_any_clock(tmp_path: Path, faster: float) -> None:
    plan = mission()
    assert drive_verdict(replayed(stamped(tmp_path, plan, faster), plan)).answer == "no"


def test_a_stop_that_was_reported_as_skipped_is_no_stop_by_any_clock(tmp_path: Path) -> None:
    plan = mission(tolerance_m=0.4)
    laid = replayed(stamped(tmp_path, plan, 5.0, faults=("scanner@2",)), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned", "skipped", "scanned"]
    assert drive_verdict(laid).answer == "no"


@pytest.mark.parametrize(("tolerance_m", "answer"), [(0.4, "no"), (3.0, "unknown")])
def test_a_stop_that_was_jumped_over_is_none_by_any_clock_if_the_robot_was_not_there(
    tmp_path: Path, tolerance_m: float, answer: str
) -> None:
    plan = mission(tolerance_m=tolerance_m)
    orders = {0.5: dialect.MAVLink_mission_set_current_message(1, 1, item_of(plan, "S3"))}
    laid = replayed(stamped(tmp_path, plan, 5.0, orders=orders), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["skipped", "skipped", "scanned"]
    assert drive_verdict(laid).answer == answer


@pytest.mark.parametrize("again", [(26.0, 35.0), (0.0, 999.0), (10.0, 30.0)])
def test_a_range_that_is_in_the_log_twice_counts_once(tmp_path: Path, again: tuple[float, float]) -> None:
    """As in parts that overlap: it was a restart, after which the stop seemed to be elsewhere."""
    plan = mission(tolerance_m=0.4)
    rows = heard(tmp_path, plan)
    seconds = [(ns - rows[0][0]) / 1e9 for ns, _, _ in rows]
    first, end = (sum(second < limit for second in seconds) for limit in again)
    path = write_telemetry_log(tmp_path / "a.tlog", [*rows[:end], *rows[first:end], *rows[end:]])
    laid = replayed(path, plan)
    assert told(laid.run.events).count("Paused") == 0 and drive_verdict(laid).answer == "yes"
    assert any(f"{end - first} packets are in the log twice" in line for line in laid.log.oddities)


def test_a_scan_that_failed_is_reported_and_the_drive_goes_on(tmp_path: Path) -> None:
    plan = mission()
    laid = replayed(logged(tmp_path / "auto.tlog", plan, faults=("scanner@2",)), plan)
    assert "Failed S2" in told(laid.run.events)
    assert "Scanned S3" in told(laid.run.events)


def test_a_stop_whose_scan_failed_is_not_visited_though_the_vehicle_waits_on_there(tmp_path: Path) -> None:
    """It stays at the stop's last items for a while, within tolerance: that is no second try."""
    plan = mission(tolerance_m=0.4)
    laid = replayed(logged(tmp_path / "auto.tlog", plan, faults=("scanner@2",)), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned", "skipped", "scanned"]
    assert drive_verdict(laid).answer == "no"


def test_a_stop_whose_scan_failed_is_visited_if_the_vehicle_is_sent_back_to_it(tmp_path: Path) -> None:
    plan = mission(tolerance_m=0.4)
    orders = {27.0: dialect.MAVLink_mission_set_current_message(1, 1, item_of(plan, "S2"))}
    laid = replayed(logged(tmp_path / "auto.tlog", plan, faults=("scanner@2",), orders=orders), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3
    assert drive_verdict(laid).answer == "yes"


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


def test_a_stop_that_the_station_jumped_over_is_skipped_and_never_visited(tmp_path: Path) -> None:
    """Whatever the tolerance: nobody waited there."""
    plan = mission(tolerance_m=0.4)
    orders = {0.5: dialect.MAVLink_mission_set_current_message(1, 1, item_of(plan, "S3"))}
    laid = replayed(logged(tmp_path / "auto.tlog", plan, orders=orders), plan)
    assert [event.stop for event in laid.run.events if isinstance(event, Scanned)] == ["S3"]
    assert [event.stop for event in laid.run.events if isinstance(event, Skipped)] == ["S1", "S2"]
    assert drive_verdict(laid).answer == "no"
    assert "1 of 3 stops" in drive_verdict(laid).text


def test_the_last_stop_skipped_by_command_is_no_visit(tmp_path: Path) -> None:
    """With a return behind it: the vehicle is sent on while it drives to the stop."""
    plan = msgspec.structs.replace(mission(tolerance_m=0.4), return_=((1.0, 1.0), (0.0, 1.0), (0.0, 0.0)))
    sent = translate(plan, "ardupilot", trigger="auto")
    home = next(place for place, one in enumerate(sent.placed) if one.role == "return") + 1
    path = logged(tmp_path / "a.tlog", plan)
    scans = [e.robot_ns for e in replayed(path, plan).run.events if isinstance(e, Scanned)]
    begin = next(e.robot_ns for e in replayed(path, plan).run.events if type(e).__name__ == "Started")
    orders = {(scans[1] - begin) / 1e9 + 4.0: dialect.MAVLink_mission_set_current_message(1, 1, home)}
    laid = replayed(logged(tmp_path / "b.tlog", plan, orders=orders), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned", "scanned", "skipped"]
    assert drive_verdict(laid).exit_code == 1


def test_a_read_back_of_the_same_list_ends_no_run(tmp_path: Path) -> None:
    """A station that restarts asks for the vehicle's list, and the vehicle drives on."""
    plan = mission(tolerance_m=0.4)
    path = logged(tmp_path / "a.tlog", plan, orders={12.0: read_back(plan), 25.0: read_back(plan)[:3]})
    laid = replayed(path, plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3
    assert len(laid.log.uploads) == 1
    assert drive_verdict(laid).exit_code == 0


def test_the_same_mission_uploaded_again_in_mid_run_is_one_run(tmp_path: Path) -> None:
    """A station sends it again, and sends the vehicle on from where it was."""
    plan = mission(tolerance_m=0.4)
    items = upload_of(translate(plan, "ardupilot", trigger="auto"))
    again = tuple(
        dialect.MAVLink_mission_item_int_message(
            1, 1, number, item.frame, item.command, 0, 1, *item.params, item.x, item.y, item.z
        )
        for number, item in enumerate(items)
    )
    whole = logged(tmp_path / "a.tlog", plan)
    first = next(e for e in replayed(whole, plan).run.events if isinstance(e, Scanned))
    begin = next(e.robot_ns for e in replayed(whole, plan).run.events if type(e).__name__ == "Started")
    at = (first.robot_ns - begin) / 1e9 + 1.5
    orders = {
        at: in_mode(HOLD_MODE),
        at + 1.0: (dialect.MAVLink_mission_count_message(1, 1, len(items)), *again),
        at + 2.0: (
            dialect.MAVLink_mission_set_current_message(1, 1, item_of(plan, "S2")),
            in_mode(AUTO_MODE),
        ),
    }
    laid = replayed(logged(tmp_path / "b.tlog", plan, orders=orders), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3
    assert drive_verdict(laid).exit_code == 0


@pytest.mark.parametrize("missing", ["ATTITUDE", "GPS_GLOBAL_ORIGIN", "MISSION_CURRENT"])
def test_stops_whose_position_is_in_the_log_are_placed_by_it(tmp_path: Path, missing: str) -> None:
    """Messages of one kind come every 8 s, or never; poses come ten times a second, and no camera's."""
    plan = mission(tolerance_m=0.4)

    def kept(ns: int, name: str) -> bool:
        rare = missing == "MISSION_CURRENT" and ns % (8 * 10**9) < 2 * 10**8
        return name != "CAMERA_IMAGE_CAPTURED" and (name != missing or rare)

    laid = replayed(logged(tmp_path / "a.tlog", plan, kept=kept), plan)
    assert not laid.inferred
    assert [item.outcome for item in laid.comparison.stops] == ["unconfirmed"] * 3
    assert all(0.05 < (item.deviation_m or 0.0) < 0.4 for item in laid.comparison.stops)


def test_a_stop_is_placed_where_the_vehicle_stood_and_not_where_it_was_reported_as_reached(
    tmp_path: Path,
) -> None:
    """A PX4 rover calls a waypoint reached 0.3 m before it, brakes, and stands 0.3 m behind it."""
    plan = mission(tolerance_m=0.36)
    kept = lambda ns, name: name != "CAMERA_IMAGE_CAPTURED"  # noqa: E731
    laid = replayed(logged(tmp_path / "a.tlog", plan, autopilot="px4", kept=kept), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["unconfirmed"] * 3
    arrived = [event.deviation_m for event in laid.run.events if isinstance(event, Arrived)]
    assert max(arrived) > 0.4
    assert all(0.25 < (item.deviation_m or 0.0) < 0.31 for item in laid.comparison.stops)
    assert drive_verdict(laid).answer == "yes"


def test_a_stop_without_a_report_of_its_scan_is_undecided_where_others_have_one(tmp_path: Path) -> None:
    plan = mission(tolerance_m=0.4)
    whole = replayed(logged(tmp_path / "a.tlog", plan), plan)
    scans = {event.stop: event.robot_ns for event in whole.run.events if isinstance(event, Scanned)}
    late = scans["S2"] + 3 * 10**9

    def kept(ns: int, name: str) -> bool:
        return name != "CAMERA_IMAGE_CAPTURED" or not scans["S1"] + 10**9 < ns < late

    laid = replayed(logged(tmp_path / "b.tlog", plan, kept=kept), plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned", "unconfirmed", "scanned"]
    assert drive_verdict(laid).answer == "unknown"
    assert "S2 is undecided: the log contains no report of its scan" in drive_verdict(laid).text


def test_a_gap_moves_no_pose_against_the_messages(tmp_path: Path) -> None:
    """The vehicle leaves S1 for a second visit unheard: a gap that looks like a step of the clock."""
    plan, deaf = mission(tolerance_m=0.4), (14 * 10**9, 22 * 10**9)
    path = logged(
        tmp_path / "a.tlog", plan, orders={14.0: Orders(plan).jump("S1")},
        kept=lambda ns, name: not deaf[0] <= ns % 10**12 < deaf[1],
    )  # fmt: skip
    laid = replayed(path, plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3
    assert drive_verdict(laid).answer == "yes"


def test_the_heartbeat_of_a_camera_is_not_the_vehicles(tmp_path: Path) -> None:
    plan = mission(tolerance_m=0.4)
    camera = FromVehicle(dialect.MAVLink_heartbeat_message(30, 8, 0, 0, 4, 3))
    laid = replayed(logged(tmp_path / "a.tlog", plan, orders={3.0 + k: camera for k in range(20)}), plan)
    assert told(laid.run.events).count("Paused") == 0
    assert [item.outcome for item in laid.comparison.stops] == ["scanned"] * 3


def test_a_passed_stop_that_nothing_places_cannot_be_reported(tmp_path: Path) -> None:
    """The station hears nothing of the vehicle while it is at S2, and next of it on its way to S3."""
    plan = mission(tolerance_m=0.4)
    whole = replayed(logged(tmp_path / "a.tlog", plan), plan)
    scans = {event.stop: event.robot_ns for event in whole.run.events if isinstance(event, Scanned)}
    deaf = (scans["S1"] + 3 * 10**9, scans["S2"] + 2 * 10**9)
    path = logged(tmp_path / "b.tlog", plan, kept=lambda ns, name: not deaf[0] < ns < deaf[1])
    laid = replayed(path, plan)
    assert [item.outcome for item in laid.comparison.stops] == ["scanned", "unconfirmed", "scanned"]
    assert (drive_verdict(laid).answer, drive_verdict(laid).exit_code) == ("unknown", 3)
    assert "S2" in drive_verdict(laid).text


def test_a_log_with_another_mission_is_not_followed_as_ours(tmp_path: Path) -> None:
    plan = mission()
    path = logged(tmp_path / "auto.tlog", plan)
    moved = msgspec.structs.replace(plan.stops[1], x=plan.stops[1].x + 0.3)
    other = msgspec.structs.replace(plan, stops=(plan.stops[0], moved, plan.stops[2]))
    laid = replayed(path, other)
    assert laid.inferred
    assert any("(stop S2) lies 0.3" in line for line in laid.uploads)
