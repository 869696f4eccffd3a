"""A run's log: poses sorted and read-only, and when it began and ended."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.run.events import AnyEvent, Finished, Started
from stopgo.mission.run.run_log import Alignment, LogSource, RunLog, Track

SOURCE = LogSource(name="field.rrd", format="rrd", digest="", messages=3)
SECOND = 1_000_000_000


def started(ns: int) -> AnyEvent:
    return Started(**_envelope(1, ns), commander="ann")


def finished(ns: int) -> AnyEvent:
    return Finished(**_envelope(2, ns))


def _envelope(number: int, ns: int) -> dict:
    return {
        "number": number, "robot": "r1", "boot_id": "b", "run_id": "run", "mission_id": "m",
        "revision": 1, "robot_ns": ns, "mission_time_s": 0.0,
    }  # fmt: skip


def log(poses: Track, events: tuple[AnyEvent, ...] = ()) -> RunLog:
    return RunLog("r1", "run", "m", 1, SOURCE, poses, events)


def test_poses_are_sorted_by_time_and_cannot_be_written() -> None:
    track = Track.of([30, 10, 20], [(3, 0), (0, 0), (0, 4)], [0.3, 0.1, 0.2])
    assert track.ns.tolist() == [10, 20, 30]
    assert track.heading.tolist() == [0.1, 0.2, 0.3]
    assert track.length_m == 4 + 5
    with pytest.raises(ValueError, match="read-only"):
        track.xy[0, 0] = 1.0


def test_poses_of_the_same_moment_keep_their_order() -> None:
    track = Track.of([5, 5, 5], [(2, 0), (0, 0), (1, 0)], np.zeros(3))
    assert track.xy[:, 0].tolist() == [2, 0, 1]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_pose_that_is_not_finite_is_no_pose(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        Track.of([1], [(0.0, bad)], [0.0])


def test_arrays_of_different_lengths_are_no_track() -> None:
    with pytest.raises(ValueError, match="2 times, 1 positions"):
        Track.of([1, 2], [(0, 0)], [0.0])


def test_a_stretch_of_a_track_holds_both_its_ends() -> None:
    track = Track.of([10, 20, 30, 40], np.zeros((4, 2)), np.zeros(4))
    assert track.between(20, 30).ns.tolist() == [20, 30]
    assert track.between(41, 50).ns.tolist() == []
    assert [track.last_until(ns) for ns in (9, 10, 25, 99)] == [None, 0, 1, 3]


def test_a_run_lasts_from_its_start_to_its_end_whatever_else_was_logged() -> None:
    poses = Track.of([1 * SECOND, 20 * SECOND], np.zeros((2, 2)), np.zeros(2))
    run = log(poses, (started(3 * SECOND), finished(13 * SECOND)))
    assert (run.began_ns, run.ended_ns, run.duration_s, run.ended) == (3 * SECOND, 13 * SECOND, 10.0, True)
    assert run.seconds(poses.ns).tolist() == [-2.0, 17.0]


def test_a_foreign_log_lasts_as_long_as_it_reports() -> None:
    poses = Track.of([5 * SECOND, 9 * SECOND], np.zeros((2, 2)), np.zeros(2))
    run = RunLog("rover", None, None, None, SOURCE, poses, alignment=Alignment("first pose at the start"))
    assert (run.duration_s, run.ended, run.revisions) == (4.0, False, ())


def test_an_empty_log_lasts_no_time() -> None:
    run = RunLog("rover", None, None, None, SOURCE)
    assert (run.began_ns, run.ended_ns, run.duration_s, len(run.poses)) == (None, None, 0.0, 0)
