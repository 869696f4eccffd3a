"""ROS logs: every container gives the same poses, damaged ones as many as there are, and nothing changes."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import FieldLog, Reading, read_log
from tests.recordings.logs.writing import BEGIN_NS, ODOMETRY, TF, Messages, odometry_rows, write_bag

POSES = [(0.1 * k, 1.0 - 0.01 * k, 0.002 * k) for k in range(40)]
CONTAINERS = ("a.bag", "a.mcap", "a.db3")


def written(folder: Path, name: str, poses: list[tuple[float, float, float]] = POSES) -> Path:
    return write_bag(folder / name, odometry_rows(poses, ros2=not name.endswith(".bag")))


@pytest.mark.parametrize("name", CONTAINERS)
def test_every_container_gives_the_poses_that_were_written(tmp_path: Path, name: str) -> None:
    log = read_log(written(tmp_path, name))
    (track,) = log.poses
    assert (track.source, track.frame, log.lost, log.clock) == ("/odom", "odom", "", "wall")
    assert np.allclose(track.xy, np.array(POSES)[:, :2])
    assert np.allclose(track.heading, np.array(POSES)[:, 2])
    assert track.ns.tolist() == [BEGIN_NS + k * 10**8 for k in range(len(POSES))]


def test_log_times_count_when_they_are_asked_for(tmp_path: Path) -> None:
    log = read_log(written(tmp_path, "a.mcap"), Reading(stamps="log"))
    assert int(log.poses[0].ns[0]) == BEGIN_NS + 5_000_000


@pytest.mark.parametrize("name", CONTAINERS[1:])
def test_a_bag_without_metadata_and_a_raw_file_are_read_whole(tmp_path: Path, name: str) -> None:
    folder = written(tmp_path, name)
    (folder / "metadata.yaml").unlink()
    (part,) = folder.iterdir()
    assert len(read_log(folder).poses[0].ns) == len(read_log(part).poses[0].ns) == len(POSES)


def test_a_packed_file_is_read(tmp_path: Path) -> None:
    from stopgo.recordings.logs.zstandard import zstd

    (part,) = (p for p in written(tmp_path, "a.db3").iterdir() if p.suffix == ".db3")
    packed = tmp_path / "a.db3.zstd"
    packed.write_bytes(zstd.compress(part.read_bytes()))
    assert len(read_log(packed).poses[0].ns) == len(POSES)


def only_file(path: Path) -> Path:
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".mcap", ".db3"))


@pytest.mark.parametrize("name", CONTAINERS)
def test_a_log_that_is_cut_off_gives_what_is_there_and_says_so(tmp_path: Path, name: str) -> None:
    long = [(0.01 * k, 0.0, 0.0) for k in range(3000)]
    whole = only_file(written(tmp_path, name, long)).read_bytes()
    cut = tmp_path / f"cut{Path(name).suffix}"
    cut.write_bytes(whole[: len(whole) * 9 // 10])
    log = read_log(cut)
    assert log.lost
    assert 0.8 * len(long) < len(log.poses[0].ns) < 0.95 * len(long)
    which = (log.poses[0].ns - BEGIN_NS) // 10**8
    assert np.allclose(log.poses[0].xy, np.array(long)[which, :2])


@pytest.mark.parametrize("page", [40, 60, 61])
def test_a_database_with_a_damaged_page_gives_the_rest_and_says_so(tmp_path: Path, page: int) -> None:
    long = [(0.01 * k, 0.0, 0.0) for k in range(400)]
    data = bytearray(only_file(written(tmp_path, "a.db3", long)).read_bytes())
    begin = page * int.from_bytes(data[16:18], "big") + 200
    data[begin : begin + 30] = bytes(30)
    (tmp_path / "damaged.db3").write_bytes(data)
    log = read_log(tmp_path / "damaged.db3")
    assert 0.9 * len(long) < len(log.poses[0].ns) <= len(long)


@pytest.mark.parametrize("name", CONTAINERS)
def test_nothing_readable_is_refused_by_name(tmp_path: Path, name: str) -> None:
    whole = only_file(written(tmp_path, name)).read_bytes()
    path = tmp_path / f"cut{Path(name).suffix}"
    for content in (b"", b"no log at all", whole[:40]):
        path.write_bytes(content)
        with pytest.raises(InputError, match=str(path)):
            read_log(path)


@pytest.mark.parametrize("name", CONTAINERS)
def test_reading_changes_nothing(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, name)
    before = fingerprint(path)
    log = read_log(path)
    list(log.sweeps())
    assert fingerprint(path) == before


def fingerprint(path: Path) -> dict[str, str]:
    files = [path] if path.is_file() else sorted(path.iterdir())
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def test_transforms_give_the_robot_in_the_map(tmp_path: Path) -> None:
    """The map lies 10 m off the odometry's frame and is turned by 90°; frames have leading slashes."""
    messages = Messages(ros2=True)
    rows = []
    for k in range(10):
        ns = BEGIN_NS + k * 10**8
        rows.append(("/tf", TF, ns, messages.transform(ns, "/map", "/odom", (10.0, 0.0, np.pi / 2))))
        rows.append(("/tf", TF, ns + 1, messages.transform(ns, "odom", "base_link", (float(k), 0.0, 0.0))))
    log = read_log(write_bag(tmp_path / "a.mcap", rows))
    (track,) = log.poses
    assert track.frame == "map"
    assert np.allclose(track.xy, [(10.0, k) for k in range(10)])
    assert np.allclose(track.heading, np.pi / 2)
    assert read_log(tmp_path / "a.mcap", Reading(frame="odom")).poses[0].xy[-1].tolist() == [9.0, 0.0]


def test_simulated_stamps_in_a_log_of_wall_time_are_reported(tmp_path: Path) -> None:
    messages = Messages(ros2=True)
    rows = [
        ("/odom", ODOMETRY, BEGIN_NS + k, messages.odometry(10**9 + k, (0.0, 0.0, 0.0))) for k in range(5)
    ]
    log = read_log(write_bag(tmp_path / "a.mcap", rows))
    assert log.clock == "simulated"
    assert "simulated time" in log.oddities[0]


def test_gaps_jumps_and_poses_that_are_no_numbers_are_reported(tmp_path: Path) -> None:
    poses = [(0.01 * k, 0.0, 0.0) for k in range(30)]
    poses[10] = (float("nan"), 0.0, 0.0)
    poses[20:] = [(5.0 + x, y, heading) for x, y, heading in poses[20:]]
    rows = odometry_rows(poses, ros2=True)
    late = [(topic, kind, ns + 4 * 10**9, m) for topic, kind, ns, m in rows[25:]]
    log = read_log(write_bag(tmp_path / "a.mcap", [*rows[:25], *late]), Reading(stamps="log"))
    told = " | ".join(log.poses[0].oddities)
    assert "1 of 30 poses are not finite" in told
    assert "1 gap without poses, 4.1 s" in told
    assert "1 jump of position, the largest 5.01 m" in told


def test_two_robots_stay_apart(tmp_path: Path) -> None:
    rows = [
        *odometry_rows(POSES, ros2=True, topic="/r1/odom"),
        *odometry_rows(POSES, ros2=True, topic="/r2/odom"),
    ]
    log: FieldLog = read_log(write_bag(tmp_path / "a.mcap", rows))
    assert sorted(track.robot for track in log.poses) == ["r1", "r2"]
