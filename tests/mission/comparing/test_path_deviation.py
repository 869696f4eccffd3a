"""Path deviation: distance from the leg that is driven, whatever other legs pass by."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.comparing.delayed_deviation import DelayedDeviation
from stopgo.mission.comparing.path_deviation import PathFollower, cross_track_of
from stopgo.mission.document import Mission
from stopgo.mission.run.events import Arrived, Finished, Homing, Scanned, Skipped, Started
from stopgo.mission.run.run_log import RunLog
from tests.mission.comparing.reports import SCAN, at, told
from tests.mission.worlds import mission_of, stop


def hook() -> Mission:
    """Out to S1, round a square to S2, whose end lies 1 m off the path's beginning, and on to S3."""
    return mission_of(
        stop("S1", (0.0, 0.0), (10.0, 0.0)),
        stop("S2", (10.0, 0.0), (10.0, 1.0), (0.0, 1.0)),
        stop("S3", (0.0, 1.0), (0.0, 5.0)),
        back=((0.0, 5.0), (0.0, 0.0)),
    )


def line(begin: float, a: tuple[float, float], b: tuple[float, float], count: int = 21) -> list[tuple]:
    """Poses from a to b, one each second from `begin` on."""
    return [(begin + k, *np.add(a, np.subtract(b, a) * k / (count - 1))) for k in range(count)]


def greatest(log: RunLog, mission: Mission) -> float:
    found = cross_track_of(log, [mission]).greatest_m
    assert found is not None
    return found


def test_a_path_that_is_driven_exactly_has_no_deviation() -> None:
    mission = hook()
    poses = line(0, (0, 0), (10, 0)) + line(100, (10, 0), (10, 1)) + line(130, (10, 1), (0, 1))
    log = told(
        mission,
        (Started, 0, {"commander": "ann"}),
        (Arrived, 30, {"stop": "S1", "pose": at(10, 0), "deviation_m": 0.0}),
        (Scanned, 99, {"stop": "S1", "pose": at(10, 0), **SCAN}),
        (Arrived, 160, {"stop": "S2", "pose": at(0, 1), "deviation_m": 0.0}),
        poses=poses,
    )
    assert greatest(log, mission) == pytest.approx(0.0, abs=1e-12)


def test_left_is_positive_and_right_is_negative() -> None:
    follower = PathFollower(hook())
    assert follower.measure(np.array([(2.0, 0.2), (3.0, -0.3)]))[:, 0].tolist() == pytest.approx([0.2, -0.3])


def test_a_robot_on_the_leg_of_a_skipped_stop_is_on_its_path() -> None:
    """From the skip on the robot works on S3, yet it still drives S2's leg: up to 10 m from that of S3."""
    mission = hook()
    log = told(
        mission,
        (Started, 0, {"commander": "ann"}),
        (Arrived, 30, {"stop": "S1", "pose": at(10, 0), "deviation_m": 0.0}),
        (Scanned, 99, {"stop": "S1", "pose": at(10, 0), **SCAN}),
        (Skipped, 100, {"stop": "S2", "reason": "skip by ann"}),
        (Arrived, 300, {"stop": "S3", "pose": at(0, 5), "deviation_m": 0.0}),
        poses=[(s, x, y + 0.005) for s, x, y in line(110, (10, 1), (0, 1)) + line(200, (0, 1), (0, 5))],
    )
    assert greatest(log, mission) == pytest.approx(0.005)


def test_a_pose_near_a_later_piece_is_measured_from_the_one_that_is_driven() -> None:
    """0.6 m left of the first leg is 0.4 m from a leg that is driven later."""
    follower = PathFollower(hook())
    follower.take(told(hook(), (Started, 0, {"commander": "ann"})).events[0])
    assert follower.measure(np.array([(1.0, 0.0), (2.0, 0.6)]))[1, 0] == pytest.approx(0.6)


def test_what_is_measured_does_not_depend_on_how_poses_come() -> None:
    """A run that is heard pose by pose is measured as one that is read whole."""
    xy = np.array([pose[1:] for pose in line(0, (10, 0.1), (10, 1.1)) + line(0, (9.9, 1.2), (0, 1))])
    whole, single = PathFollower(hook()), PathFollower(hook())
    for follower in (whole, single):
        follower.take(_scanned("S1"))
    one_by_one = np.concatenate([single.measure(pose) for pose in xy])
    assert np.array_equal(whole.measure(xy), one_by_one)


def test_events_that_come_late_change_nothing() -> None:
    """Poses of two legs come first, then the events between them, as from a journal after a gap."""
    mission = hook()
    poses = line(0, (0, 0.1), (10, 0.1)) + line(110, (10, 1), (0, 1.2))
    log = told(
        mission,
        (Started, 0, {"commander": "ann"}),
        (Arrived, 30, {"stop": "S1", "pose": at(10, 0), "deviation_m": 0.0}),
        (Scanned, 99, {"stop": "S1", "pose": at(10, 0), **SCAN}),
        poses=poses,
    )
    late = DelayedDeviation(mission)
    late.poses(log.poses)
    assert not late.knows(1)
    for event in log.events:
        late.event(event, mission)
    early, metres = late.measured(int(log.poses.ns[4]))
    rest, others = late.measured()
    assert (len(early), late.knows(3)) == (5, True)
    assert np.array_equal(np.concatenate([early, rest]), log.poses.ns)
    whole = PathFollower(mission)
    expected = []
    xy = log.poses.xy
    for event, before in zip(log.events, (xy[:1], xy[1:21], xy[21:21]), strict=True):
        expected.append(whole.measure(before))
        whole.take(event)
    expected.append(whole.measure(xy[21:]))
    assert np.array_equal(np.concatenate([metres, others]), np.concatenate(expected)[:, 0])


def test_home_is_by_the_return_or_back_along_its_path() -> None:
    mission = hook()
    follower = PathFollower(mission)
    follower.take(_scanned("S1"))
    follower.measure(np.array([(10.0, 0.5)]))
    follower.take(told(mission, (Homing, 5, {"reason": "sent home"})).events[0])
    back = follower.measure(np.array([(10.0, 0.5), (9.0, 0.1), (1.0, 0.1)]))[:, 0]
    assert back.tolist() == pytest.approx([0.0, -0.1, -0.1])
    for name in ("S1", "S2", "S3"):
        follower.take(_scanned(name))
    follower.take(told(mission, (Homing, 9, {"reason": "all stops are behind"})).events[0])
    assert follower.measure(np.array([(0.2, 3.0)]))[0, 0] == pytest.approx(0.2)


def test_after_the_end_there_is_no_path() -> None:
    mission = hook()
    follower = PathFollower(mission)
    follower.take(told(mission, (Finished, 9, {})).events[0])
    assert np.isnan(follower.measure(np.array([(5.0, 5.0)]))).all()


def test_a_hundred_thousand_poses_are_measured_as_one(
    count: int = 100_000,
) -> None:
    x = np.linspace(0.0, 10.0, count)
    measured = PathFollower(hook()).measure(np.stack([x, np.full(count, -0.25)], axis=1))
    assert np.allclose(measured[:, 0], -0.25)
    assert np.allclose(measured[:, 1], x)


def _scanned(name: str):
    place = next(item for item in hook().stops if item.id == name)
    return told(hook(), (Scanned, 1, {"stop": name, "pose": at(place.x, place.y), **SCAN})).events[0]
