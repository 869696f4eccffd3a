"""Failures of base and scanner, stop by stop, in simulated time."""

from __future__ import annotations

import math
import sqlite3
from pathlib import Path
from threading import Event

import msgspec
import pytest

from stopgo.bridge.robot.base import Rest
from stopgo.bridge.robot.simulated_faults import Fault, Faults, read_faults
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.run.events import Pose, Scanned
from stopgo.mission.run.run_commands import Verb
from stopgo.mission.run.scans import ScanFailed
from tests.bridge.world import Field, corridor
from tests.disk import small_disk


def started(mission: Mission, *faults: Fault) -> Field:
    """A field whose robot has begun the mission."""
    field = Field(faults=Faults(faults))
    field.station().push(mission)
    field.order("start")
    return field


def with_policy(**details: object) -> Mission:
    mission = corridor()
    policy = msgspec.structs.replace(mission.policy, **details)
    return with_digest(msgspec.structs.replace(mission, policy=policy))


def test_a_failed_scan_is_taken_again() -> None:
    field = started(corridor(), Fault("scanner", 2))
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")
    assert "Failed s2" not in field.told()


def test_a_scan_that_ended_while_the_program_was_away_is_not_taken_again() -> None:
    field = started(corridor())
    field.work_until(lambda run: run.stop_state == "SCANNING")
    run = field.controller.run
    field.scanner.scan(f"{run.run_id}-s1-1", corridor().stops[0].scan, interrupt=Event())
    field.boot()
    assert field.controller.run.state == "PAUSED"
    field.work()
    assert (field.controller.run.done, field.controller.run.state) == (("s1",), "PAUSED")
    field.order("resume")
    field.work()
    assert field.controller.run.scans == 3


def test_every_scan_has_a_name_of_its_own() -> None:
    field = started(corridor())
    field.work_until(lambda run: run.stop_state == "SCANNING")
    field.boot()
    field.order("resume")
    field.work()
    scanned = [event for event in field.journal.events() if isinstance(event, Scanned)]
    assert [event.file.rpartition("-")[2] for event in scanned] == ["2.e57", "3.e57", "4.e57"]


def test_a_scan_without_points_is_not_a_scan() -> None:
    field = started(corridor(retries=0), Fault("empty", 1))
    field.work()
    assert field.controller.run.state == "HELD"
    assert "0 points" in field.controller.run.reason


def test_tries_that_are_used_up_hold_the_robot_and_retry_gives_new_ones() -> None:
    field = started(corridor(), Fault("scanner", 1), Fault("scanner", 2))
    field.work()
    assert field.controller.run.state == "HELD"
    assert field.told()[-2:] == ["Failed s1", "Held"]
    assert field.order("resume").reason == "wrong_state"
    assert field.order("retry", stop="s1").outcome == "ok"
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_held_robot_goes_on_after_skip() -> None:
    field = started(corridor(retries=0), Fault("scanner", 1))
    field.work()
    assert field.order("skip").outcome == "ok"
    field.work()
    assert (field.controller.run.skipped, field.controller.run.done) == (("s1",), ("s2", "s3"))


@pytest.mark.parametrize(
    ("on_failure", "state", "at_home"),
    [("skip", "FINISHED", True), ("abort", "ABORTED", False), ("home", "ABORTED", True)],
)
def test_the_mission_says_what_a_failure_leads_to(on_failure: str, state: str, at_home: bool) -> None:
    field = started(corridor(retries=0, on_failure=on_failure), Fault("scanner", 2))
    field.work()
    assert field.controller.run.state == state
    assert (abs(field.base.pose().x) < 1e-6) == at_home
    assert "Failed s2" in field.told()


def test_a_slip_is_corrected_until_the_stop_is_within_tolerance() -> None:
    field = started(corridor(), Fault("slip", 1, 0.2))
    field.work()
    assert field.controller.run.state == "FINISHED"
    arrived = [event for event in field.journal.events() if type(event).__name__ == "Arrived"]
    assert all(event.deviation_m <= 0.05 for event in arrived)  # type: ignore[union-attr]


def test_a_stop_that_is_never_reached_fails() -> None:
    slips = [Fault("slip", drive, 0.2) for drive in range(1, 20)]
    field = started(corridor(retries=0), *slips)
    field.work()
    assert field.controller.run.state == "HELD"
    assert "(50 mm are tolerated) after 3 corrections" in field.controller.run.reason


def test_a_blocked_leg_holds_the_robot_and_retry_drives_the_rest() -> None:
    field = started(corridor(on_failure="skip"), Fault("blocked", 2))
    field.work()
    assert field.controller.run.state == "HELD"
    assert "blocked at (3." in field.controller.run.reason
    field.order("retry")
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_robot_that_shakes_is_not_scanned_from_until_it_stands_still() -> None:
    calm, shaken = started(corridor()), started(corridor(), Fault("shaking", 1, 10.0))
    calm.work()
    shaken.work()
    late = shaken.journal.events()[2].mission_time_s - calm.journal.events()[2].mission_time_s
    assert 9.0 < late < 13.0


def test_a_robot_that_never_stands_still_fails_the_stop() -> None:
    field = started(corridor(retries=0), Fault("shaking", 1, 1000.0))
    field.work()
    assert field.controller.run.reason == "s1: not still within 32 s"


def test_a_base_that_is_located_less_well_stands_still_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started(corridor(retries=0), Fault("shaking", 1, 1000.0))
    monkeypatch.setattr(field.base, "rest", lambda: Rest(metres=0.02, radians=0.02))
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_low_battery_sends_it_home_and_it_goes_on_once_charged() -> None:
    field = started(corridor(), Fault("drain", 2, 0.1))
    field.work()
    assert field.controller.run.state == "PAUSED"
    assert abs(field.base.pose().x) < 1e-6
    assert field.controller.run.done == ("s1", "s2")
    field.base.charge()
    assert field.order("resume").outcome == "ok"
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == ("FINISHED", ("s1", "s2", "s3"))


def test_a_robot_carried_off_its_route_is_not_resumed() -> None:
    field = started(corridor())
    field.order("pause")
    field.base.stand_at(Pose(x=1.0, y=0.5, heading=0.0))
    refused = field.order("resume")
    assert refused.reason == "off_route"
    assert "drive it by hand to (1.00, 0.00), within 0.35 m" in refused.message
    field.base.stand_at(Pose(x=1.0, y=0.02, heading=0.0))
    assert field.order("resume").outcome == "ok"


@pytest.mark.parametrize(("verb", "away_m"), [("resume", 0.15), ("resume", 0.34), ("home", 0.15)])
def test_a_robot_within_its_radius_of_its_route_goes_back_to_it_first(
    monkeypatch: pytest.MonkeyPatch, verb: Verb, away_m: float
) -> None:
    field = started(corridor())
    field.order("pause")
    field.base.stand_at(Pose(x=1.0, y=away_m, heading=0.0))
    paths: list[tuple[tuple[float, float], ...]] = []
    goto = field.base.goto
    monkeypatch.setattr(
        field.base, "goto", lambda path, **more: paths.append(tuple(path)) or goto(path, **more)
    )
    assert field.order(verb).outcome == "ok"
    field.work()
    assert paths[0][0] == pytest.approx((1.0, 0.0)) and len(paths[0]) == 2
    assert field.controller.run.state == ("ABORTED" if verb == "home" else "FINISHED")


def test_a_robot_that_rolled_past_the_last_stop_takes_it_again() -> None:
    field = started(corridor(), Fault("scanner", 3))
    mission = field.controller.snapshot()[1]
    assert mission is not None
    last = mission.stops[-1]
    field.work_until(lambda run: run.at == len(mission.stops) - 1)
    field.order("pause")
    field.base.stand_at(Pose(x=last.x + 0.16, y=last.y, heading=0.0))
    assert field.order("resume").outcome == "ok"
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_turn_that_a_pause_ended_is_finished_before_the_scan() -> None:
    mission = corridor()
    first = msgspec.structs.replace(mission.stops[0], heading=math.pi / 2)
    mission = with_digest(msgspec.structs.replace(mission, stops=(first, *mission.stops[1:])))
    field = started(mission, Fault("slip", 1, 0.2))
    field.work_until(lambda run: run.leg > run.at)
    run_s = (field.clock.now_ns() - field.controller.run.started_ns) / 1e9
    field.clock.at(run_s + 1.0, lambda: field.order("pause"))
    field.work()
    assert 0.1 < field.base.pose().heading < 1.4
    field.order("resume")
    field.work_until(lambda run: run.stop_state == "SCANNING")
    assert abs(field.base.pose().heading - math.pi / 2) < 1e-3


def test_home_while_paused_drives_home() -> None:
    field = started(corridor())
    field.clock.at(72.0, lambda: field.order("pause"))
    field.work()
    assert field.order("home").outcome == "ok"
    field.work()
    assert field.controller.run.state == "ABORTED"
    assert abs(field.base.pose().x) < 1e-6


def test_a_paused_return_home_is_continued() -> None:
    field = started(corridor())
    field.clock.at(80.0, lambda: field.order("home"))
    field.clock.at(83.0, lambda: field.order("pause"))
    field.work()
    assert field.controller.run.state == "PAUSED"
    field.boot()
    field.order("resume")
    field.work()
    assert field.controller.run.state == "ABORTED"
    assert abs(field.base.pose().x) < 1e-6


def test_a_skip_does_not_turn_a_robot_round_that_is_on_its_return_home() -> None:
    field = started(corridor(), Fault("blocked", 2))
    field.work_until(lambda run: run.done == ("s1",))
    field.order("home")
    field.work()
    assert field.controller.run.detailed_state == "HELD homing"
    assert field.order("skip").reason == "wrong_state"
    field.order("retry")
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == ("ABORTED", ("s1",))


def test_a_return_home_that_was_paused_ends_for_the_reason_it_began() -> None:
    field = started(corridor())
    field.work_until(lambda run: run.done == ("s1",))
    field.order("home")
    field.order("pause")
    assert field.controller.run.reason == "pause by test"
    field.order("resume")
    assert field.controller.run.reason == "sent home by test"
    field.work()
    assert getattr(field.journal.events()[-1], "reason", "") == "sent home by test"


@pytest.mark.parametrize(
    ("policy", "state", "done"),
    [
        ("continue", "FINISHED", ("s1", "s2", "s3")),
        ("hold", "HELD", ()),
        ("finish_stop", "HELD", ("s1",)),
        ("home", "PAUSED", ()),
    ],
)
def test_a_lost_link_is_met_as_the_mission_says(policy: str, state: str, done: tuple[str, ...]) -> None:
    field = started(with_policy(link_loss=policy))
    field.clock.at(2.0, lambda: field.controller.on_link_silence(31.0))
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == (state, done)
    field.controller.on_link_silence(0.0)
    if state != "FINISHED":
        field.order("retry" if state == "HELD" else "resume")
        field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_lost_link_cuts_no_scan_short() -> None:
    field = started(with_policy(link_loss="hold"))
    field.clock.at(30.0, lambda: field.controller.on_link_silence(31.0))
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == ("HELD", ("s1",))


def full_disk(moment: str) -> None:
    raise sqlite3.OperationalError("database or disk is full")


def test_a_full_disk_refuses_commands_and_stops_the_robot_until_there_is_room() -> None:
    field = started(corridor())

    def fill() -> None:
        field.journal.rows.commit_hook = full_disk
        assert field.order("skip").reason == "storage"

    field.clock.at(3.0, fill)
    field.work()
    assert field.controller.run.state == "HELD"
    assert field.base.speed() == 0.0
    field.journal.rows.commit_hook = lambda moment: None
    assert field.order("retry").outcome == "ok"
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


@pytest.mark.parametrize(
    ("verb", "state", "event"), [("pause", "PAUSED", "Paused"), ("abort", "ABORTED", "Aborted")]
)
def test_a_full_disk_keeps_no_stop_from_arriving(verb: Verb, state: str, event: str) -> None:
    field = started(corridor())
    field.journal.rows.commit_hook = full_disk
    order = field.command(verb)
    answer = field.controller.execute(order)
    assert (answer.outcome, field.controller.run.state, field.base.speed()) == ("ok", state, 0.0)
    assert field.controller.execute(order) == answer
    field.controller.on_link_silence(0.0)
    assert field.told()[-1] == "Started"
    field.journal.rows.commit_hook = lambda moment: None
    field.controller.on_link_silence(0.0)
    assert field.told()[-1] == event
    assert field.controller.execute(order) == answer
    field.boot()
    assert (field.controller.run.state, field.told()[-1]) == (state, event)


def test_a_push_of_the_mission_that_is_run_stores_once_what_a_full_disk_had_no_room_for() -> None:
    field = started(corridor())
    station = field.station(commander="test")
    field.journal.rows.commit_hook = full_disk
    field.order("pause")
    field.journal.rows.commit_hook = lambda moment: None
    station.push(corridor())
    field.controller.on_link_silence(0.0)
    assert field.told() == ["Started", "Paused"]
    field.order("resume")
    assert field.told() == ["Started", "Paused", "Resumed"]


def test_a_full_disk_ends_no_simulated_robot(tmp_path: Path) -> None:
    field = Field(keep=tmp_path / "world.json", record=tmp_path / "scans.log")
    with small_disk(0):
        field.base.stand_at(Pose(x=1.0, y=0.0, heading=0.0))
        scanned = field.scanner.scan("s1", corridor().stops[0].scan, interrupt=Event())
    assert field.base.pose().x == 1.0
    assert scanned == ScanFailed(reason="the scan cannot be written: File too large")


def test_a_full_disk_rejects_a_mission() -> None:
    field = Field()
    station = field.station()
    field.journal.rows.commit_hook = full_disk
    with pytest.raises(
        NegativeResult, match="storage: the journal cannot be written: database or disk is full"
    ):
        station.push(corridor())
    assert field.controller.run.state == "IDLE"


@pytest.mark.parametrize("text", ["slip", "slip@x", "melt@1", "slip@1=much", "@1", "slip@1=nan", "slip@-1"])
def test_a_fault_that_makes_no_sense_is_named(text: str) -> None:
    with pytest.raises(InputError, match="--fault"):
        read_faults([text])
    assert read_faults(["slip@2=0.2"]) == Faults((Fault("slip", 2, 0.2),))
