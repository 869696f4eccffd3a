"""A station that follows a run reports each pose once and in order, whatever it has missed."""

from __future__ import annotations

import msgspec

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import POSE_PAGE, KeyExpressions, PosePage, encode
from stopgo.bridge.station.follow import PoseHistory, RunFollower
from stopgo.bridge.station.logged_run import LoggedReport
from stopgo.mission.run.events import Health, Pose, PoseReport
from tests.bridge.world import Field, corridor


class Trail:
    """A robot's end of `poses`, in memory: what it would report one boot."""

    def __init__(self, board: Switchboard, *, boot_id: str, poses: int) -> None:
        self.keys = KeyExpressions("r1")
        self.boot_id = boot_id
        self.poses = [self.pose(seq) for seq in range(1, poses + 1)]
        self.asked: list[int] = []
        board.link().serve(self.keys.poses, self.page)

    def pose(self, seq: int, run_id: str = "run") -> PoseReport:
        return PoseReport(
            robot="r1", boot_id=self.boot_id, seq=seq, robot_ns=seq, run_id=run_id,
            mission_time_s=0.0, pose=Pose(x=0.0, y=0.0, heading=0.0), speed=0.0,
        )  # fmt: skip

    def page(self, request: Request) -> bytes:
        since = int(request.parameters["since"])
        self.asked.append(since)
        return encode(PosePage(boot_id=self.boot_id, poses=tuple(self.poses[since : since + POSE_PAGE])))


def followed(board: Switchboard) -> PoseHistory:
    path = PoseHistory(board.link(), KeyExpressions("r1"))
    path.run_id = "run"
    return path


def test_poses_that_were_missed_are_asked_for_in_pages_and_reported_in_order() -> None:
    board = Switchboard()
    robot, path = Trail(board, boot_id="b", poses=120), followed(board)
    told = [*path.take(robot.pose(1)), *path.take(robot.pose(120))]
    while path.behind:
        told += path.catch_up()
    assert [pose.seq for pose in told] == list(range(1, 121))
    assert robot.asked == [1, 51, 101]
    assert [pose.seq for pose in path.take(robot.pose(121))] == [121]


def test_poses_are_counted_again_after_a_reboot() -> None:
    board = Switchboard()
    path = followed(board)
    assert [pose.seq for pose in path.take(Trail(board, boot_id="b", poses=1).pose(1))] == [1]
    robot = Trail(board, boot_id="c", poses=3)
    assert list(path.take(robot.pose(3))) == []
    assert [(pose.boot_id, pose.seq) for pose in path.catch_up()] == [("c", 1), ("c", 2), ("c", 3)]
    assert not path.behind


def test_poses_of_another_run_are_not_reported() -> None:
    board = Switchboard()
    robot, path = Trail(board, boot_id="b", poses=0), followed(board)
    assert list(path.take(robot.pose(7, run_id="other"))) == []
    assert not path.behind


def test_poses_that_nobody_answers_for_are_not_asked_for_again_at_once() -> None:
    board = Switchboard()
    robot, path = Trail(board, boot_id="b", poses=3), followed(board)
    list(path.take(robot.pose(3)))
    board.cut = True
    assert path.behind
    assert list(path.catch_up()) == []
    assert not path.behind


def test_health_that_is_received_before_its_run_is_reported_with_the_run_and_once() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    follower = RunFollower(field.board.link(), field.keys, lambda: True)
    told = Health(robot_ns=1, run_id=field.controller.run.run_id, battery=0.5, emergency_stop=True)
    assert not list(follower.take(told))
    assert LoggedReport(told) in list(follower.take(field.report()))
    assert not [item for item in follower.take(field.report()) if isinstance(item, LoggedReport)]
    later = msgspec.structs.replace(told, robot_ns=2, emergency_stop=False)
    assert list(follower.take(later)) == [LoggedReport(later)]
