"""A rosbag2 database whose columns hold values of other types is refused as unreadable."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from stopgo.recordings.logs.ros_bag import Damaged, whole_bag


def test_a_number_where_qos_profiles_are_written_is_damage(tmp_path: Path) -> None:
    path = tmp_path / "odd.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("create table topics(id, name, type, serialization_format, offered_qos_profiles)")
        database.execute("insert into topics values(1, '/odom', 5, 'cdr', 7)")
        database.execute("create table messages(id, topic_id, timestamp, data)")
        database.execute("insert into messages values(1, 1, 0, zeroblob(10))")
        database.commit()
    with pytest.raises(Damaged, match="not iterable"), whole_bag(path):
        pass
