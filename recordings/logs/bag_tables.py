"""Refusal of rosbag2 databases whose tables are queries, which may never end, or hold too long messages."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.recordings.logs.bag_sizes import Longest, check_rows

TABLES = ("topics", "messages", "schema", "message_definitions", "metadata")
_QUERIES = (
    "SELECT type, name FROM sqlite_master WHERE lower(tbl_name) IN ({0})"
    " AND (type NOT IN ('table', 'index') OR lower(sql) LIKE 'create virtual%')"
    " UNION ALL SELECT 'computed column', m.name || '.' || c.name"
    " FROM sqlite_master AS m, pragma_table_xinfo(m.name) AS c"
    " WHERE m.type = 'table' AND lower(m.name) IN ({0}) AND c.hidden > 1"
    " AND lower(m.sql) NOT LIKE 'create virtual%' LIMIT 1"
).format(", ".join("?" * len(TABLES)))


def check_tables(connection: Any, path: object) -> None:
    """Refuse a database of which a table is a view, or is virtual, or computed; one that is damaged passes.

    Raises
    ------
    InputError
        Naming the first of them.
    """
    for kind, name in connection.execute(_QUERIES, TABLES * 2):
        shown = "virtual table" if kind == "table" else kind
        raise InputError(f"{path}: {name} is a {shown}, as no rosbag2 has; record or export the bag again")


@contextmanager
def tables_checked(longest: Longest) -> Iterator[None]:
    """Check each database that rosbags opens, before it asks for anything."""
    try:
        import apsw
    except ModuleNotFoundError:  # an earlier rosbags, which does not read with it
        yield
        return

    checked: set[str] = set()

    def check(connection: Any) -> None:
        try:
            check_tables(connection, connection.filename)
            if connection.filename not in checked:  # rosbags opens each one twice
                check_rows(connection, connection.filename, longest)
                checked.add(connection.filename)
        except apsw.Error:
            return  # rosbags finds the damage

    apsw.connection_hooks.append(check)
    try:
        yield
    finally:
        apsw.connection_hooks.remove(check)


def check_salvaged(connection: sqlite3.Connection, path: object) -> None:
    """Check a database that is recovered."""
    try:
        check_tables(connection, path)
    except sqlite3.DatabaseError:
        return  # its rows cannot be read either


__all__ = ["check_salvaged", "tables_checked"]
