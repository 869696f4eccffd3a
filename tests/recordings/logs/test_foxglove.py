"""Foxglove's JSON in MCAP: poses, transforms, fixes and scans, whole or damaged."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import Reading, listing, read_log
from tests.recordings.logs.writing import (
    BEGIN_NS,
    foxglove_pose,
    foxglove_time,
    foxglove_transform,
    write_json_mcap,
)

POSES = [(0.1 * k, 1.0 - 0.01 * k, 0.002 * k) for k in range(40)]
TIMES = [BEGIN_NS + k * 10**8 for k in range(len(POSES))]
Row = tuple[str, str, int, Any]


def pose_rows(frame: str = "map") -> list[Row]:
    return [
        ("/pose", "foxglove.PoseInFrame", ns + 5_000_000,
         {"timestamp": foxglove_time(ns), "frame_id": frame, "pose": foxglove_pose(pose, 0.5)})
        for ns, pose in zip(TIMES, POSES, strict=True)
    ]  # fmt: skip


@pytest.mark.parametrize("chunked", [True, False])
def test_poses_in_a_frame_are_those_that_were_written(tmp_path: Path, chunked: bool) -> None:
    log = read_log(write_json_mcap(tmp_path / "a.mcap", pose_rows(), chunked=chunked))
    (track,) = log.poses
    assert (track.source, track.frame, log.lost, log.format) == ("/pose", "map", "", "Foxglove JSON (mcap)")
    assert np.allclose(track.xy, np.array(POSES)[:, :2])
    assert np.allclose(track.heading, np.array(POSES)[:, 2])
    assert track.height is not None and np.allclose(track.height, 0.5)
    assert track.ns.tolist() == TIMES
    assert "foxglove.PoseInFrame" in listing.as_text(log)
    by_log = read_log(Path(log.path), Reading(stamps="log"))
    assert by_log.poses[0].ns.tolist() == [ns + 5_000_000 for ns in TIMES]


def test_a_single_pose_of_several_counts_and_a_path_without_times_does_not(tmp_path: Path) -> None:
    def rows(many: int) -> list[Row]:
        return [
            ("/poses", "foxglove.PosesInFrame", ns,
             {"timestamp": foxglove_time(ns), "frame_id": "map", "poses": [foxglove_pose(pose)] * many})
            for ns, pose in zip(TIMES, POSES, strict=True)
        ]  # fmt: skip

    assert len(read_log(write_json_mcap(tmp_path / "a.mcap", rows(1))).poses[0].ns) == len(POSES)
    path = read_log(write_json_mcap(tmp_path / "b.mcap", rows(2)))
    assert path.poses == () and "several poses at one time" in path.oddities[0]


@pytest.mark.parametrize("together", [True, False])
def test_transforms_are_chained_and_one_given_once_does_not_move(tmp_path: Path, together: bool) -> None:
    """map > odom once, shifted by (10, 0) and turned by a right angle; odom > base_link always."""
    still = foxglove_transform(TIMES[0], "map", "odom", (10.0, 0.0, np.pi / 2))
    moving = [
        foxglove_transform(ns, "odom", "base_link", pose) for ns, pose in zip(TIMES, POSES, strict=True)
    ]
    if together:
        given = [{"transforms": [still, moving[0]]}, *({"transforms": [one]} for one in moving[1:])]
        rows = [("/tf", "foxglove.FrameTransforms", ns, one) for ns, one in zip(TIMES, given, strict=True)]
    else:
        rows = [("/tf", "foxglove.FrameTransform", TIMES[0], one) for one in [still, *moving]]
    (track,) = read_log(write_json_mcap(tmp_path / "a.mcap", rows)).poses
    x, y, heading = np.array(POSES).T
    assert np.allclose(track.xy, np.column_stack([10 - y, x]))
    assert np.allclose(track.heading, heading + np.pi / 2)


@pytest.mark.parametrize("together", [True, False])
def test_fixes_are_positions_on_the_earth(tmp_path: Path, together: bool) -> None:
    fixes = [
        {"timestamp": foxglove_time(ns), "frame_id": "gps", "latitude": 47.0 + 1e-5 * k, "longitude": 8.0,
         "altitude": 400.0, "position_covariance": [0] * 9, "position_covariance_type": 0}
        for k, ns in enumerate(TIMES)
    ]  # fmt: skip
    kind, rows = "foxglove.LocationFix", fixes
    if together:
        kind, rows = "foxglove.LocationFixes", [{"fixes": fixes[k : k + 4]} for k in range(0, len(fixes), 4)]
    (track,) = read_log(
        write_json_mcap(tmp_path / "a.mcap", [("/fix", kind, TIMES[0], one) for one in rows])
    ).poses
    assert track.origin is not None and (track.origin.lat, track.origin.lon) == (47.0, 8.0)
    assert len(track.ns) == len(TIMES)
    assert track.xy[-1] == pytest.approx((0.0, 1.11176 * 39), abs=0.01)


def test_scans_are_points_in_the_scanners_frame(tmp_path: Path) -> None:
    """A cloud whose scanner is 1 m ahead and turned left; a laser with a range that is no measurement."""
    points = np.array([(1.0, 0.0, 0.2), (0.0, 2.0, 0.3)], "<f4")
    mount = foxglove_pose((1.0, 0.0, np.pi / 2))
    about = {"timestamp": foxglove_time(TIMES[0]), "frame_id": "laser"}
    cloud = {
        **about, "pose": mount, "point_stride": 12,
        "fields": [{"name": name, "offset": 4 * k, "type": 7} for k, name in enumerate("xyz")],
        "data": base64.b64encode(points.tobytes()).decode(),
    }  # fmt: skip
    scan = {
        **about, "pose": foxglove_pose((0, 0, 0)), "start_angle": 0.0, "end_angle": np.pi,
        "ranges": [1.0, 0.0, 3.0], "intensities": [],
    }  # fmt: skip
    rows = [
        ("/cloud", "foxglove.PointCloud", TIMES[0], cloud),
        ("/scan", "foxglove.LaserScan", TIMES[1], scan),
    ]
    found = {sweep.source: sweep for sweep in read_log(write_json_mcap(tmp_path / "a.mcap", rows)).sweeps()}
    assert found["/cloud"].frame == "laser"
    assert np.allclose(found["/cloud"].xyz, [(1.0, 1.0, 0.2), (-1.0, 0.0, 0.3)])
    assert np.allclose(found["/scan"].xyz, [(1.0, 0.0, 0.0), (-3.0, 0.0, 0.0)])


@pytest.mark.parametrize(
    "wrong",
    [
        b"not json", b"[]", b"{}", b"\xff\xfe", b'{"timestamp": {"sec": "x"}}', b"null", b"[" * 100_000,
        b'{"timestamp":{"sec":1e400,"nsec":0},"frame_id":"map","pose":{}}',
    ],
)  # fmt: skip
def test_a_message_that_is_none_is_left_out_and_counted(tmp_path: Path, wrong: bytes) -> None:
    rows = [*pose_rows(), ("/pose", "foxglove.PoseInFrame", TIMES[-1], wrong)]
    rows += [
        ("/tf", "foxglove.FrameTransforms", TIMES[0], wrong),
        ("/p", "foxglove.PointCloud", TIMES[0], wrong),
    ]
    log = read_log(write_json_mcap(tmp_path / "a.mcap", rows))
    assert len(log.poses[0].ns) == len(POSES)
    assert any("/pose: text that is not a foxglove.PoseInFrame (1 messages" in line for line in log.oddities)
    assert list(log.sweeps()) == []


def test_a_file_that_is_cut_off_gives_what_is_there_and_says_so(tmp_path: Path) -> None:
    path = write_json_mcap(tmp_path / "a.mcap", pose_rows(), chunked=False)
    path.write_bytes(path.read_bytes()[:-3000])
    log = read_log(path)
    assert 20 < len(log.poses[0].ns) < len(POSES)
    assert log.lost


def test_other_encodings_are_named(tmp_path: Path) -> None:
    path = write_json_mcap(tmp_path / "a.mcap", pose_rows(), encoding="protobuf")
    with pytest.raises(InputError, match="channels are in protobuf"):
        read_log(path)
