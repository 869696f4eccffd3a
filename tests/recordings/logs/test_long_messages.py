"""Messages and chunks that are too long are refused by their lengths, if they would be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs import bag_sizes, ros, salvage
from stopgo.recordings.logs.field_log import Reading
from stopgo.recordings.logs.ros_bag import salvaged_bag, whole_bag
from tests.recordings.logs.writing import ODOMETRY, odometry_rows, write_bag

POSES = [(0.1 * k, 0.0, 0.0) for k in range(20)]
KINDS = (".mcap", ".db3")


def bag(folder: Path, kind: str, topic: str = "/odom") -> Path:
    return write_bag(folder / f"bag{kind}", odometry_rows(POSES, ros2=True, topic=topic))


def test_a_message_of_a_database_longer_than_any_of_its_type_is_refused(tmp_path: Path) -> None:
    """One of 500 MB was read into 3.5 GB."""
    path = bag(tmp_path, ".db3")
    refused = r"a message of \d+ bytes on /odom, more than 99, as no nav_msgs/msg/Odometry has; leave that"
    with pytest.raises(InputError, match=refused), whole_bag(path, {ODOMETRY: 99}):
        pass
    with whole_bag(path, {"tf2_msgs/msg/TFMessage": 99}) as other:
        assert len(list(other.messages(other.topics))) == len(POSES)


def test_a_needed_chunk_larger_than_any_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bag(tmp_path, ".mcap")
    monkeypatch.setattr(bag_sizes, "LARGEST_CHUNK", 999)
    with (
        pytest.raises(InputError, match=r"a chunk of \d+ bytes, more than 999; write the file with smaller"),
        whole_bag(path, {ODOMETRY: 10**6}),
    ):
        pass
    with whole_bag(path, {"tf2_msgs/msg/TFMessage": 10**6}) as other:
        assert other.topics[0].count == len(POSES)


@pytest.mark.parametrize("kind", KINDS)
def test_messages_that_are_too_long_are_left_out_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """Those in a chunk are of a known length only once the chunk is unpacked."""
    monkeypatch.setattr(ros, "LONGEST_MESSAGE", 99)
    found = ros.read_ros(bag(tmp_path, kind), Reading())
    assert found.poses == ()
    assert f"/odom: longer than any {ODOMETRY} ({len(POSES)} messages, left out)" in found.oddities


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_bags_long_records_are_named_and_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(salvage, "LARGEST_CHUNK", 99)
    with salvaged_bag(bag(tmp_path, kind), "") as found:
        assert list(found.messages(found.topics)) == []
        assert "too long" in found.lost()
