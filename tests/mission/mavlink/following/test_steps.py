"""Observations of a vehicle as steps of a run; no vehicle is needed for it."""

from __future__ import annotations

import msgspec
import pytest

from stopgo.mission.document import ScannerSpec
from stopgo.mission.mavlink.following.listed_mission import ListedMission, listed_mission
from stopgo.mission.mavlink.following.resuming import resume_place
from stopgo.mission.mavlink.following.steps import (
    Observation,
    after_skipped,
    run_on_vehicle,
    steps,
    taken_over,
)
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import AnyEvent, Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Run
from tests.mission.mavlink.following.worlds import told, tour

SCAN = ScanResult(file="scan-1.e57", size=1600, points=100, sha256="0" * 64)
S2_AT = Pose(x=2.0, y=1.0, heading=0.0)


def listed(**details: object) -> ListedMission:
    mission = tour(**details)
    return listed_mission(mission, translate(mission, "ardupilot"))


def going(at: int = 1, stop_state: str = "NAVIGATING", **fields: object) -> Run:
    """A run on the way to S2."""
    plain = {
        "state": "RUNNING",
        "run_id": "r",
        "leg": at,
        "at": at,
        "stop_state": stop_state,
        "done": ("S1",),
    }
    return Run(**(plain | fields))  # type: ignore[arg-type]


def seen(place: int, **fields: object) -> Observation:
    return Observation(mode="AUTO", armed=True, place=place, **fields)  # type: ignore[arg-type]


def after(run: Run, listed: ListedMission, observed: Observation) -> tuple[list[str], Run]:
    """Its reports, and the run then."""
    changes = steps(run, listed, observed)
    return told([event_of(telling) for change in changes for telling in change.events]), (
        changes[-1].run if changes else run
    )


def event_of(telling: object) -> AnyEvent:
    blank = {"number": 0, "robot": "", "boot_id": "", "run_id": "", "mission_id": "", "revision": 0}
    return telling(**blank, robot_ns=0, mission_time_s=0.0)  # type: ignore[operator,no-any-return]


def test_a_place_in_the_list_reports_the_stop_and_the_work_there() -> None:
    items = listed().stops[1]
    roles = [placed.role for placed in listed().sent.placed]
    assert (roles[items.first], roles[items.at]) == ("corner", "stop")
    assert (roles[items.scan], items.after) == ("trigger", listed().stops[2].first)


def test_a_waypoint_that_is_reached_is_an_arrival_only_within_the_tolerance() -> None:
    mine, items = listed(), listed().stops[1]
    near, far = Pose(x=2.03, y=1.0, heading=0.0), Pose(x=2.3, y=1.0, heading=0.0)
    assert after(going(), mine, seen(items.at, pose=near))[0] == []
    assert after(going(), mine, seen(items.at + 1, pose=near))[0] == ["Arrived S2"]
    assert after(going(), mine, seen(items.at + 1, pose=far))[0] == []
    assert after(going(), mine, seen(items.at + 1, pose=far, still=True))[0] == ["Failed S2", "Held"]
    assert after(going(), mine, seen(items.at + 1))[0] == []


def test_a_stop_with_tries_left_is_tried_again_without_a_word() -> None:
    mine, items = listed(retries=1), listed().stops[1]
    far = Pose(x=2.3, y=1.0, heading=0.0)
    words, run = after(going(), mine, seen(items.at + 1, pose=far, still=True))
    assert words == [] and (run.attempt, run.stop_state) == (1, "WAITING")


def test_a_scan_counts_when_its_wait_is_over() -> None:
    mine, items = listed(), listed().stops[1]
    scanning = going(stop_state="SCANNING", leg=2)
    words, run = after(scanning, mine, seen(items.scan, pose=S2_AT, scan=SCAN))
    assert words == [] and run.stop_state == "VERIFYING"
    assert after(run, mine, seen(items.after, pose=S2_AT))[0] == ["Scanned S2"]


def test_a_scan_that_nobody_confirms_is_unconfirmed_once_it_is_in_vain_to_wait() -> None:
    mine, items = listed(), listed().stops[1]
    scanning = going(stop_state="SCANNING", leg=2)
    assert after(scanning, mine, seen(items.after, stood=S2_AT))[0] == []
    words, run = after(scanning, mine, seen(items.after, stood=S2_AT, report_overdue=True))
    assert words == ["Unconfirmed S2"] and run.done == ("S1", "S2")


def test_a_scan_without_a_hash_is_no_scan() -> None:
    mine, items = listed(), listed().stops[1]
    scanning = going(stop_state="VERIFYING", scan=msgspec.structs.replace(SCAN, sha256=""))
    assert after(scanning, mine, seen(items.after, pose=S2_AT))[0] == ["Failed S2", "Held"]


def test_a_stop_that_was_left_is_never_gone_back_to() -> None:
    mine, items = listed(retries=3), listed().stops[1]
    scanning = going(stop_state="SCANNING")
    words, run = after(scanning, mine, seen(items.after, scan=ScanFailed(reason="dark")))
    assert words == ["Failed S2", "Held"] and run.state == "HELD"


@pytest.mark.parametrize("mode", ["HOLD", "MANUAL"])
def test_a_scan_in_progress_outlives_a_hold_and_nothing_else(mode: str) -> None:
    mine, items = listed(), listed().stops[1]
    observed = Observation(mode=mode, armed=True, place=items.scan)
    change = taken_over(going(stop_state="SCANNING"), mine, observed)
    assert change is not None
    assert change.run.stop_state == ("SCANNING" if mode == "HOLD" else "WAITING")


def test_a_vehicle_that_waits_at_a_stop_that_was_left_out_is_led_past_it() -> None:
    mine, (_, items, last) = listed(), listed().stops
    skipped = going(at=2, skipped=("S2",), leg=1)
    assert after_skipped(skipped, mine, seen(items.at)) is None
    assert after_skipped(skipped, mine, seen(items.scan)) == last.first
    assert after_skipped(going(at=2, done=("S1", "S2")), mine, seen(items.scan)) is None


@pytest.mark.parametrize(
    ("pose", "ahead"),
    [
        (Pose(x=1.5, y=0.0, heading=0.0), "corner"),
        (Pose(x=2.0, y=0.5, heading=0.0), "stop"),
        (Pose(x=1.0, y=0.0, heading=0.0), "corner"),
    ],
)
def test_after_a_reboot_the_vehicle_goes_on_along_the_piece_on_which_it_stands(
    pose: Pose, ahead: str
) -> None:
    mine = listed()
    place = resume_place(going(stop_state="WAITING"), mine, seen(0), pose)
    assert mine.sent.placed[place].role == ahead and mine.sent.placed[place].stop == "S2"


def test_a_vehicle_that_has_lost_nothing_keeps_its_item() -> None:
    mine, items = listed(), listed().stops[1]
    here = Pose(x=2.0, y=0.5, heading=0.0)
    assert resume_place(going(stop_state="WAITING"), mine, seen(items.at), here) == items.at
    assert resume_place(going(stop_state="SCANNING"), mine, seen(items.scan + 1), S2_AT) == items.scan + 1
    assert resume_place(going(stop_state="WAITING"), mine, seen(items.scan + 1), S2_AT) == items.at


def test_a_stop_that_is_not_in_the_list_is_named() -> None:
    from stopgo.mission.errors import InputError

    whole = tour()
    shorter = msgspec.structs.replace(whole, stops=whole.stops[:2])
    with pytest.raises(InputError, match="S3"):
        listed_mission(whole, translate(shorter, "ardupilot"))


def test_a_vehicle_that_ends_its_mission_in_another_mode_was_not_taken_over() -> None:
    mine = listed()
    ended = Observation(mode="HOLD", armed=True, place=mine.end)
    assert taken_over(going(at=2), mine, ended) is None
    paused = taken_over(going(at=2, state="PAUSED"), mine, ended)
    assert paused is not None and paused.run.state == "RUNNING"


def test_home_is_no_answer_of_a_vehicle_that_drives_forward_only() -> None:
    mine, items = listed(on_failure="home"), listed().stops[1]
    far = Pose(x=2.3, y=1.0, heading=0.0)
    assert after(going(), mine, seen(items.at + 1, pose=far, still=True))[0] == ["Failed S2", "Held"]


def test_a_scanner_that_does_not_see_all_around_must_face_the_right_way() -> None:
    mission = msgspec.structs.replace(tour(), scanner=ScannerSpec(profile="default", range=5.0, fov_deg=90.0))
    mine = listed_mission(mission, translate(mission, "generic"))
    items, faces = mine.stops[1], mission.stops[1].heading
    right, wrong = (Pose(x=2.0, y=1.0, heading=faces + off) for off in (0.05, 0.2))
    assert after(going(), mine, seen(items.at + 1, pose=right))[0] == ["Arrived S2"]
    words, run = after(going(), mine, seen(items.at + 1, pose=wrong, still=True))
    assert words == ["Failed S2", "Held"] and "11.5°" in run.reason


def test_a_mission_that_somebody_has_cleared_or_replaced_does_not_lie_ready() -> None:
    ready, mine = Run(state="READY", mission_id="m", revision=1), listed()
    for items in (0, 5, mine.end + 7):
        assert run_on_vehicle(ready, items, mine) == Run()
        assert run_on_vehicle(going(), items, mine) == going()
    for items in (None, mine.end, mine.end + 1):  # some count home too
        assert run_on_vehicle(ready, items, mine) == ready


@pytest.mark.parametrize("stop_state", ["SCANNING", "VERIFYING"])
def test_a_scan_during_which_the_vehicle_moved_has_failed(stop_state: str) -> None:
    mine, items = listed(), listed().stops[1]
    observed = seen(items.scan + 1, pose=S2_AT, scan=SCAN, moved="the vehicle moved 0.40 m during the scan")
    words, run = after(going(stop_state=stop_state, scan=SCAN), mine, observed)
    assert words == ["Failed S2", "Held"] and "moved 0.40 m during the scan" in run.reason
    assert after(going(stop_state="SCANNING", state="PAUSED"), mine, observed)[0] == []
