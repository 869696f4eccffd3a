"""A station that was away reads from the robot's record what it missed: each pose once and in order."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from stopgo.bridge.link.link import Request, Unanswered
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import RECORD_PAGE, KeyExpressions, encode
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.robot.recorder import RunRecorder
from stopgo.bridge.robot.run_record import RESTARTED
from stopgo.bridge.station import logged_run
from stopgo.bridge.station.logged_run import LoggedReport, LogHistory, LogItem, read_run
from stopgo.mission.run.events import Health, PoseReport, PosesMissing
from tests.bridge.robot.test_recorder import BEGAN_NS, idle, ns, pose

FAR = 5000
"""More poses than a robot keeps in memory."""

LAST_NET_S = 60.0


class Robot:
    """One that drives and writes down, and a station that follows it, in memory."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(logged_run, "AGAIN_S", 0.0)
        self.folder = folder
        self.board = Switchboard()
        self.keys = KeyExpressions("r1")
        self.asked = 0
        self.lost: set[int] = set()
        """Numbers of the queries without an answer."""
        self.short = ""
        self.boot()
        idle(self.recorder)
        self.board.link().serve(self.keys.record, self._answer)
        self.history = LogHistory(self.board.link(), self.keys)
        self.history.run_id = "run"
        self.told: list[LogItem] = []

    def _answer(self, request: Request) -> bytes:
        self.asked += 1
        if self.asked in self.lost:
            raise Unanswered
        return encode(self.recorder.answer(request))

    def boot(self) -> None:
        self.recorder = RunRecorder(self.folder, room=lambda size: self.short)

    def drive(self, numbers: range, *, heard: bool, boot_id: str = "b") -> None:
        """Poses, an entry for each ten; the station hears them, if the line is not cut."""
        for number in numbers:
            report = pose(number, boot_id=boot_id)
            self.recorder.pose(report, began_ns=BEGAN_NS, over=False)
            if number % 10 == 0:
                self.recorder.write()
            if heard:
                self.told += self.history.take(report)

    def catch_up(self) -> None:
        for _ in range(1000):
            if not self.history.behind:
                return
            self.told += self.history.catch_up()
        raise AssertionError("the station is still behind")

    @property
    def poses(self) -> list[PoseReport]:
        return [item for item in self.told if isinstance(item, PoseReport)]

    @property
    def gaps(self) -> list[PosesMissing]:
        return [item for item in self.told if isinstance(item, PosesMissing)]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    robot = Robot(tmp_path, monkeypatch)
    yield robot
    robot.recorder.close()


def test_health_is_reported_once_whether_it_was_received_or_is_read_later(robot: Robot) -> None:
    pressed = [False]
    robot.recorder.health = lambda: BaseHealth(emergency_stop=pressed[0])
    robot.drive(range(1, 21), heard=True)
    heard = robot.recorder.look(battery=0.5, robot_ns=ns(20))
    assert heard is not None
    robot.told += robot.history.health(heard)
    pressed[0] = True
    robot.drive(range(21, 30), heard=False)
    assert robot.recorder.look(battery=0.5, robot_ns=ns(29)) is not None
    robot.drive(range(30, 41), heard=False)
    pressed[0] = False
    robot.drive(range(41, 51), heard=True)
    heard = robot.recorder.look(battery=0.5, robot_ns=ns(50))
    assert heard is not None
    robot.told += robot.history.health(heard)
    robot.catch_up()
    robot.drive(range(51, 61), heard=True)
    robot.catch_up()
    told = [
        item.report
        for item in robot.told
        if isinstance(item, LoggedReport) and isinstance(item.report, Health)
    ]
    assert sorted((one.robot_ns, one.emergency_stop) for one in told) == [
        (ns(20), False), (ns(29), True), (ns(50), False)
    ]  # fmt: skip


def test_after_a_long_outage_every_pose_comes_once_and_in_order(robot: Robot) -> None:
    robot.drive(range(1, 101), heard=True)
    robot.catch_up()
    robot.drive(range(101, FAR), heard=False)
    robot.drive(range(FAR, FAR + 205), heard=True)
    robot.catch_up()
    assert robot.poses == [pose(seq) for seq in range(1, FAR + 205)]
    assert not robot.gaps
    assert robot.asked <= FAR / 10 / RECORD_PAGE + 5


def test_a_pose_that_was_lost_late_in_a_run_does_not_bring_the_whole_record(robot: Robot) -> None:
    robot.drive(range(1, FAR), heard=True)
    robot.catch_up()
    asked = robot.asked
    robot.drive(range(FAR, FAR + 1), heard=False)
    robot.drive(range(FAR + 1, FAR + 40), heard=True)
    robot.catch_up()
    assert robot.poses == [pose(seq) for seq in range(1, FAR + 40)]
    assert robot.asked <= asked + 1


def test_a_line_that_is_cut_again_while_it_catches_up_goes_on_where_it_was(robot: Robot) -> None:
    robot.drive(range(1, FAR), heard=False)
    robot.drive(range(FAR, FAR + 35), heard=True)
    for cut in (True, False) * 5:
        robot.board.cut = cut
        for _ in range(3):
            robot.told += robot.history.catch_up()
    robot.board.cut = False
    robot.catch_up()
    assert robot.poses == [pose(seq) for seq in range(1, FAR + 35)]


def test_what_a_killed_robot_had_not_written_is_reported_as_missing(robot: Robot) -> None:
    robot.drive(range(1, 106), heard=False)
    robot.boot()
    robot.drive(range(200, 300), heard=True, boot_id="c")
    robot.recorder.write()
    robot.catch_up()
    assert [report.seq for report in robot.poses] == [*range(1, 101), *range(200, 300)]
    assert [(gap.robot_ns, gap.until_ns, gap.reason) for gap in robot.gaps] == [(ns(100), ns(200), RESTARTED)]


def test_what_a_full_disk_had_no_room_for_is_reported_as_missing(robot: Robot) -> None:
    robot.drive(range(1, 101), heard=True)
    robot.catch_up()
    robot.short = "make room"
    robot.drive(range(101, 301), heard=False)
    robot.drive(range(301, 336), heard=True)
    robot.catch_up()
    (gap,) = robot.gaps
    assert (gap.robot_ns, gap.until_ns) == (ns(100), ns(301))
    assert "no room" in gap.reason
    robot.short = ""
    robot.drive(range(336, 401), heard=True)
    robot.catch_up()
    assert [report.seq for report in robot.poses] == [*range(1, 101), *range(301, 401)]
    times = [report.robot_ns for report in robot.poses]
    assert all(before < after for before, after in pairwise(times))


def test_a_past_run_is_read_once_and_in_order_over_a_line_that_is_cut_in_between(robot: Robot) -> None:
    newest = 10 * RECORD_PAGE * 5
    robot.drive(range(1, newest + 1), heard=False)
    robot.lost = {2, 3, 5, 6, 7}
    told = list(read_run(robot.board.link(), robot.keys, "run", patience_s=LAST_NET_S))
    assert [item.seq for item in told if isinstance(item, PoseReport)] == list(range(1, newest + 1))
    assert robot.asked > max(robot.lost)
