"""Logs that nobody on this project wrote: what each holds, by other readers' word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import read_log

LOGS = Path(__file__).parents[4] / "shared" / "data" / "logs"
pytestmark = pytest.mark.skipif(not LOGS.is_dir(), reason="../shared/data/logs is not here")

HELD = {
    "turtlebot3.bag": (10_527, "/odom", 2741),
    "husky.bag": (16_806, "/husky_velocity_controller/odom", 3952),
    "rosbag2-pose": (4695, "/pose", 1565),
    "rosbag2-split-mcap": (6074, None, 0),
    "crawler.tlog": (25_162, None, 0),
    "copter-bad-data.tlog": (76_791, "LOCAL_POSITION_NED", 1161),
    "rover-stop-and-go.BIN": (85_546, "XKF1", 3048),
    "px4.ulg": (14_604, None, 0),
}
"""Messages by rosbags, pymavlink and pyulog; and poses of the best source."""


@pytest.mark.parametrize("name", HELD)
def test_every_real_log_is_read_to_its_end(name: str) -> None:
    log = read_log(LOGS / name)
    messages, source, poses = HELD[name]
    assert (log.messages, log.lost) == (messages, "")
    counts = {track.source: len(track.ns) for track in log.poses}
    assert counts.get(source or "", 0) == poses
    assert source is not None or not counts


@pytest.mark.parametrize("name", ["turtlebot3.bag", "husky.bag"])
def test_salvage_finds_in_a_whole_bag_what_rosbags_finds(name: str) -> None:
    from stopgo.recordings.logs.ros_bag import salvaged_bag, whole_bag

    with whole_bag(LOGS / name) as whole, salvaged_bag(LOGS / name, "") as salvaged:
        one, other = (
            [(t.name, ns, raw) for t, ns, raw in bag.messages(bag.topics)] for bag in (whole, salvaged)
        )
        assert sorted(one) == sorted(other)


def test_a_bag_with_damage_in_the_middle_gives_the_rest(tmp_path: Path) -> None:
    data = bytearray((LOGS / "turtlebot3.bag").read_bytes())
    data[len(data) // 2 : len(data) // 2 + 200] = b"U" * 200
    path = tmp_path / "flipped.bag"
    path.write_bytes(bytes(data))
    log = read_log(path)
    assert "cannot be decompressed" in log.lost
    assert 2000 < len(log.poses[0].ns) < 2741


def test_scans_of_the_turtlebot_are_within_its_range() -> None:
    sweeps = list(read_log(LOGS / "turtlebot3.bag").sweeps())
    assert len(sweeps) == 457
    assert max(float(np.hypot(*sweep.xyz[:, :2].T).max()) for sweep in sweeps) <= 3.51


@pytest.mark.parametrize("name", ["husky.bag", "crawler.tlog", "rover-stop-and-go.BIN", "px4.ulg"])
def test_the_beginning_of_a_log_is_read_or_refused_in_one_line(tmp_path: Path, name: str) -> None:
    whole = (LOGS / name).read_bytes()
    path = tmp_path / name
    for length in (1, 7, 20, 100, 1000, 5000):
        path.write_bytes(whole[:length])
        try:
            read_log(path)
        except InputError as error:
            assert str(path) in str(error)
