"""A rosbag2 database whose columns hold values of other types, or whose tables are none, is refused."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.recordings.logs.ros_bag import Damaged, salvaged_bag, whole_bag

TOPICS = "create table topics(id, name, type, serialization_format, offered_qos_profiles)"
MESSAGES = "create table messages(id, topic_id, timestamp, data)"
QOS = ("insert into topics values(1, '/odom', 'nav_msgs/msg/Odometry', 'cdr', '')",)
ODD = {
    "topics": ("create view topics as select 1 as id, 'a' as name, 'b' as type", MESSAGES),
    "messages": (TOPICS, *QOS, "create view messages as select 1 as id, 1 as topic_id"),
    "schema": (TOPICS, MESSAGES, "create view schema as select 4 as schema_version"),
    "MESSAGES": (TOPICS, *QOS, "create virtual table MESSAGES using fts5(id, topic_id, timestamp, data)"),
    "messages.data": (
        TOPICS,
        *QOS,
        "create table messages(id, topic_id, timestamp, data as (zeroblob(9)))",
    ),
}


def made(path: Path, statements: Sequence[str]) -> Path:
    with closing(sqlite3.connect(path)) as database:
        for statement in statements:
            database.execute(statement)
        database.commit()
    return path


def test_a_number_where_qos_profiles_are_written_is_damage(tmp_path: Path) -> None:
    odd = "insert into topics values(1, '/odom', 5, 'cdr', 7)"
    row = "insert into messages values(1, 1, 0, zeroblob(10))"
    path = made(tmp_path / "odd.db3", (TOPICS, odd, MESSAGES, row))
    with pytest.raises(Damaged, match="not iterable"), whole_bag(path):
        pass


@pytest.mark.parametrize("name", ODD)
def test_a_table_that_is_a_query_is_refused_before_it_is_asked(tmp_path: Path, name: str) -> None:
    """A query that never ends was waited for, and filled the memory."""
    path = made(tmp_path / "odd.db3", ODD[name])
    refused = rf"odd.db3: {name} is a (view|virtual table|computed column), as no rosbag2 has"
    with pytest.raises(InputError, match=refused), whole_bag(path):
        pass
    with pytest.raises(InputError, match=refused), salvaged_bag(path, ""):
        pass
