"""A robot's records of its runs come back whole, or are reported as missing."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from stopgo.bridge.link.capabilities import RECORD, WITHOUT
from stopgo.bridge.link.protocol import RECORD_PAGE, PoseRow, RecordPage
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.robot.pages import POSES_KEPT
from stopgo.bridge.robot.recorder import RETIRED, RunRecorder
from stopgo.bridge.robot.run_record import DAMAGED, RESTARTED, UNSEEN
from stopgo.mission.run.events import Pose, PoseReport, PosesMissing
from tests.disk import small_disk
from tests.faults.sizes import some

BEGAN_NS = 1_000_000_000


def pose(seq: int, *, run_id: str | None = "run", boot_id: str = "b") -> PoseReport:
    robot_ns = BEGAN_NS + seq * 50_000_000
    return PoseReport(
        robot="r1", boot_id=boot_id, seq=seq, robot_ns=robot_ns, run_id=run_id,
        mission_time_s=(robot_ns - BEGAN_NS) / 1e9, pose=Pose(x=seq / 7, y=-seq / 3, heading=0.1), speed=0.5,
    )  # fmt: skip


def row(report: PoseReport) -> PoseRow:
    place = report.pose
    return PoseRow(report.seq, report.robot_ns, place.x, place.y, place.heading, report.speed)


def drive(recorder: RunRecorder, *numbers: int, run_id: str = "run", boot_id: str = "b") -> None:
    """An entry of poses."""
    for number in numbers:
        recorder.pose(pose(number, run_id=run_id, boot_id=boot_id), began_ns=BEGAN_NS, over=False)
    recorder.write()


def idle(recorder: RunRecorder) -> None:
    """The robot waits for a run, so that its begin is seen."""
    recorder.pose(pose(0, run_id=None), began_ns=0, over=False)


def seqs(page: RecordPage) -> list[int]:
    return [pose.seq for entry in page.entries for pose in entry.poses]


def gaps(page: RecordPage) -> list[PosesMissing]:
    return [gap for entry in page.entries for gap in entry.missing]


def ns(seq: int) -> int:
    return pose(seq).robot_ns


def test_what_was_written_down_comes_back_the_same_also_after_a_reboot(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    for first in range(1, 101, 10):
        drive(recorder, *range(first, first + 10))
    for told in (recorder, RunRecorder(tmp_path)):
        page = told.page("run")
        assert [pose for entry in page.entries for pose in entry.poses] == [
            row(pose(seq)) for seq in range(1, 101)
        ]
        assert [entry.number for entry in page.entries] == list(range(1, page.newest + 1))
        assert not gaps(page)


def test_a_record_is_read_page_by_page_from_a_number_or_a_time_on(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    for seq in range(1, 2 * RECORD_PAGE + 6):
        drive(recorder, seq)
    assert seqs(recorder.page("run", RECORD_PAGE)) == list(range(RECORD_PAGE + 1, 2 * RECORD_PAGE + 1))
    for last in range(2 * RECORD_PAGE + 6):
        later = recorder.page("run", None, robot_ns=ns(last))
        assert later.since == last
        assert seqs(later)[:1] == [last + 1] * (last < 2 * RECORD_PAGE + 5)


def test_of_a_run_that_is_over_the_first_pose_is_the_last(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    drive(recorder, 1)
    for seq in (2, 3):
        recorder.pose(pose(seq), began_ns=BEGAN_NS, over=True)
    recorder.write()
    assert seqs(recorder.page("run")) == [1, 2]


def test_a_killed_robot_loses_what_it_had_not_written_and_the_record_says_so(tmp_path: Path) -> None:
    killed = RunRecorder(tmp_path)
    idle(killed)
    drive(killed, 1, 2, 3)
    killed.pose(pose(4), began_ns=BEGAN_NS, over=False)
    again = RunRecorder(tmp_path)
    drive(again, 9, 10, boot_id="c")
    page = again.page("run")
    assert seqs(page) == [1, 2, 3, 9, 10]
    assert [(gap.robot_ns, gap.until_ns, gap.reason) for gap in gaps(page)] == [(ns(3), ns(9), RESTARTED)]


def test_an_entry_that_was_cut_anywhere_is_taken_off_and_the_others_stay(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    drive(recorder, 1, 2)
    (path,) = tmp_path.iterdir()
    whole = path.stat().st_size
    drive(recorder, 3, 4)
    after = path.read_bytes()
    for end in some(range(whole, len(after)), every=9):
        path.write_bytes(after[:end])
        again = RunRecorder(tmp_path)
        assert seqs(again.page("run")) == [1, 2]
        drive(again, 5, boot_id="c")
        assert seqs(again.page("run")) == [1, 2, 5]
        assert again.page("run").newest == 2


def test_a_bit_that_flips_anywhere_is_never_reported_as_a_pose(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    for seq in (1, 2, 3):
        drive(recorder, seq)
    (path,) = tmp_path.iterdir()
    sound = path.read_bytes()
    for at in some(range(len(sound)), every=9):
        path.write_bytes(sound[:at] + bytes([sound[at] ^ 0x10]) + sound[at + 1 :])
        page = RunRecorder(tmp_path).page("run")
        assert set(seqs(page)) < {1, 2, 3}
        assert len(seqs(page)) == 2
        assert {gap.reason for gap in gaps(page)} <= {DAMAGED}


def test_what_lies_between_a_damaged_entrys_neighbours_is_missing(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    drive(recorder, 1)
    (path,) = tmp_path.iterdir()
    end = path.stat().st_size
    drive(recorder, 2)
    drive(recorder, 3)
    damaged = bytearray(path.read_bytes())
    damaged[end + 30] ^= 1
    path.write_bytes(damaged)
    page = RunRecorder(tmp_path).page("run")
    assert seqs(page) == [1, 3]
    assert [(gap.robot_ns, gap.until_ns) for gap in gaps(page)] == [(ns(1), ns(3))]


def test_the_oldest_finished_run_makes_room_and_is_reported_to_have(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path, limit_bytes=3000)
    idle(recorder)
    for run_id in ("one", "two", "three"):
        for seq in range(1, 9):
            drive(recorder, seq, run_id=run_id)
    runs = recorder.index().runs
    assert [(run.run_id, run.retired) for run in runs] == [("one", True), ("two", False), ("three", False)]
    assert sum(run.bytes for run in runs) <= 3000
    assert [gap.reason for gap in recorder.page("one").missing] == [RETIRED]
    assert seqs(recorder.page("three")) == list(range(1, 9))


def test_a_run_that_reaches_the_limit_alone_goes_on_without_a_record(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path, limit_bytes=1000)
    idle(recorder)
    for seq in range(1, 20):
        drive(recorder, seq)
    page = recorder.page("run")
    kept = seqs(page)
    assert kept == list(range(1, len(kept) + 1))
    (gap,) = page.missing
    assert (gap.robot_ns, gap.until_ns) == (ns(len(kept)), ns(19))
    assert "limit" in gap.reason


@pytest.mark.parametrize("kind", ["announced", "met"])
def test_a_full_disk_leaves_a_gap_that_is_reported_and_the_record_goes_on(tmp_path: Path, kind: str) -> None:
    short = [""]
    recorder = RunRecorder(tmp_path, room=lambda size: short[0])
    idle(recorder)
    drive(recorder, 1)
    if kind == "announced":
        short[0] = "make room"
        drive(recorder, 2)
        drive(recorder, 3)
        short[0] = ""
    else:
        with small_disk(next(tmp_path.iterdir()).stat().st_size + 10):
            drive(recorder, 2)
            drive(recorder, 3)
    (gap,) = recorder.page("run").missing
    assert (gap.robot_ns, gap.until_ns) == (ns(1), ns(3))
    drive(recorder, 4)
    page = RunRecorder(tmp_path).page("run")
    assert seqs(page) == [1, 4]
    assert [(gap.robot_ns, gap.until_ns) for gap in gaps(page)] == [(ns(1), ns(4))]
    assert not recorder.page("run").missing


def test_a_record_that_begins_within_a_run_lacks_its_beginning(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    drive(recorder, 40)
    (gap,) = gaps(recorder.page("run"))
    assert (gap.robot_ns, gap.until_ns, gap.reason) == (BEGAN_NS, ns(40), UNSEEN)


def test_health_is_written_down_when_it_changes(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    pressed = [False]
    recorder.health = lambda: BaseHealth(emergency_stop=pressed[0], localisation=0.9)
    idle(recorder)
    for seq in (1, 2, 3):
        recorder.pose(pose(seq), began_ns=BEGAN_NS, over=False)
        pressed[0] = seq == 3
        recorder.look(battery=0.5, robot_ns=ns(seq))
        recorder.write()
    told = [health for entry in recorder.page("run").entries for health in entry.health]
    assert [(health.robot_ns, health.emergency_stop) for health in told] == [(ns(1), False), (ns(3), True)]
    assert {(health.battery, health.localisation, health.safety_field) for health in told} == {
        (0.5, 0.9, None)
    }


def test_what_follows_without_a_record_is_reported_with_the_number_of_poses_that_are_kept() -> None:
    assert f"{POSES_KEPT} poses" in WITHOUT[RECORD]


def test_a_disk_that_does_not_answer_delays_no_pose_and_no_state(tmp_path: Path) -> None:
    """The threads that publish them also look for a lost link."""
    entered, goes_on = threading.Event(), threading.Event()

    def room(size: int) -> str:
        entered.set()
        assert goes_on.wait(60.0)
        return ""

    recorder = RunRecorder(tmp_path, room=room)
    idle(recorder)
    writing = threading.Thread(target=drive, args=(recorder, 1))
    writing.start()
    assert entered.wait(60.0)
    recorder.pose(pose(2), began_ns=BEGAN_NS, over=False)
    assert not goes_on.is_set()
    goes_on.set()
    writing.join(60.0)
    recorder.write()
    assert seqs(recorder.page("run")) == [1, 2]
    recorder.close()
