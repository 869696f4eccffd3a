"""Gaps in the poses of a run: reported with their length and place, and never counted as driven."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
from stopgo.mission.run.boots import UNKNOWN, joined_boots
from stopgo.mission.run.events import Arrived, Finished, Scanned, Started
from stopgo.mission.run.pose_gaps import gap_limit_ns, gaps_after
from stopgo.mission.run.run_log import Track
from tests.mission.comparing.reports import SCAN, at, told
from tests.mission.comparing.test_path_deviation import hook, line

NS = 10**9


def track(*seconds: float, restarts: tuple[float, ...] = ()) -> Track:
    xy = [(float(k), 0.0) for k in range(len(seconds))]
    ns = np.rint(np.array(seconds) * NS)
    return Track.of(ns, xy, np.zeros(len(xy)), restarts_ns=[round(s * NS) for s in restarts])


@pytest.mark.parametrize(
    ("usual_s", "limit_s"),
    [(0.005, 3.0), (0.1, 3.0), (1.0, 3.0), (5.0, 15.0)],
    ids=["200 Hz", "10 Hz", "1 Hz", "0.2 Hz"],
)
def test_a_gap_is_three_times_what_is_usual_and_three_seconds_at_least(
    usual_s: float, limit_s: float
) -> None:
    assert gap_limit_ns([usual_s * NS] * 5) == pytest.approx(limit_s * NS)
    longer = track(0, usual_s, 2 * usual_s, 3 * usual_s, 3 * usual_s + limit_s + 0.1)
    assert longer.gaps.tolist() == [False, False, False, True]
    assert longer.length_m == 3.0


def test_a_restart_is_a_gap_however_short() -> None:
    found = track(0, 1, 2, 3, restarts=(2.0,))
    assert found.gaps.tolist() == [False, True, False]
    assert [len(path) for path in found.paths] == [2, 2]
    assert not gaps_after(found.ns, (0, 9 * NS)).any()


def unseen() -> Comparison:
    """Leg S2 of 12 m: nobody sees its middle 9 m, and the straight line between the ends is 1 m."""
    mission = hook()
    log = told(
        mission,
        (Started, 0, {"commander": "ann"}),
        (Arrived, 20, {"stop": "S1", "pose": at(10, 0), "deviation_m": 0.0}),
        (Scanned, 99, {"stop": "S1", "pose": at(10, 0), **SCAN}),
        (Arrived, 160, {"stop": "S2", "pose": at(0, 1), "deviation_m": 0.0}),
        (Scanned, 161, {"stop": "S2", "pose": at(0, 1), **SCAN}),
        (Finished, 161, {}),
        poses=line(0, (0, 0.03), (10, 0.03))
        + line(100, (10, 0.03), (10, 0.03), 3)
        + line(159, (2, 1.0), (0, 1.0), 3),
    )  # fmt: skip
    return compare(log, [mission])


def test_what_was_not_seen_is_reported_and_not_counted() -> None:
    run = unseen()
    (gap,) = run.sighted.gaps
    assert (gap.begin_s, gap.end_s, gap.begin, gap.end) == (102.0, 159.0, (10.0, 0.03), (2.0, 1.0))
    assert gap.metres == pytest.approx(8.97)
    assert run.log.poses.length_m == pytest.approx(12.0)
    text = comparison_text(run)
    assert "cross-track error ≤ 30.0 mm while recorded (57.2 % of the path), unseen 0:57" in text
    assert "no poses for 0:57 from 1:42: 9.0 m of the path unseen, from (10.00, 0.03) to (2.00, 1.00)" in text
    told_json = msgspec.json.decode(msgspec.json.encode(comparison_json(run)))
    assert (told_json["seen"], told_json["unseen_s"]) == (pytest.approx(12 / 20.97), 57.0)
    assert told_json["gaps"][0]["unseen_m"] == pytest.approx(8.97)


def test_a_run_that_was_seen_late_and_not_to_its_end_says_so() -> None:
    mission = hook()
    log = told(
        mission,
        (Started, 0, {"commander": "ann"}),
        (Arrived, 40, {"stop": "S1", "pose": at(10, 0), "deviation_m": 0.0}),
        (Scanned, 41, {"stop": "S1", "pose": at(10, 0), **SCAN}),
        (Arrived, 90, {"stop": "S2", "pose": at(0, 1), "deviation_m": 0.0}),
        (Scanned, 91, {"stop": "S2", "pose": at(0, 1), **SCAN}),
        poses=line(30, (6, 0), (10, 0), 11) + line(41, (10, 0), (10, 1), 3),
    )
    before, after = compare(log, [mission]).sighted.gaps
    assert (before.begin_s, before.begin, before.metres) == (0.0, None, pytest.approx(6.0))
    assert (after.end, after.metres) == (None, pytest.approx(10.0))


def test_poses_of_two_boots_are_neither_mixed_nor_joined() -> None:
    """The second boot's clock is 10 s behind, and the robot stands 1 m further."""
    mission = hook()
    log = told(
        mission,
        (Started, 0, {"commander": "a"}),
        (Arrived, 12, {"stop": "S1", "pose": at(5, 0), "deviation_m": 0, "boot_id": "c"}),
    )
    begin = log.events[0].robot_ns
    before = Track.of([begin + k * NS for k in range(20)], [(k / 10, 0) for k in range(20)], [0] * 20)
    after = Track.of(
        [begin + (k + 10) * NS for k in range(20)], [(3 + k / 10, 0) for k in range(20)], [0] * 20
    )
    joined = joined_boots(log.events, {"b": before, "c": after})
    assert np.all(np.diff(joined.poses.ns) > 0)
    assert joined.poses.length_m == pytest.approx(3.8)
    assert joined.poses.gaps.sum() == 1
    assert joined.events[1].robot_ns - joined.poses.ns[20] == 2 * NS
    assert joined.events[1].mission_time_s > 20
    assert "clock went back 9.0 s" in joined.notes[0]
    same = joined_boots(log.events[:1], {"b": before})
    assert same.poses is before


def test_an_old_recording_that_cannot_distinguish_two_boots_has_no_path() -> None:
    mission = hook()
    early = {"stop": "S1", "pose": at(5, 0), "deviation_m": 0, "boot_id": "c"}
    poses = line(0, (0, 0), (10, 0))
    log = told(mission, (Started, 5, {"commander": "a"}), (Arrived, 2, early), poses=poses)
    joined = joined_boots(log.events, {UNKNOWN: log.poses})
    assert len(joined.poses) == 0
    assert "left out" in joined.notes[-1]
    log = told(mission, (Started, 0, {"commander": "a"}), (Arrived, 7, early), poses=poses)
    assert np.flatnonzero(joined_boots(log.events, {UNKNOWN: log.poses}).poses.gaps).tolist() == [6]
