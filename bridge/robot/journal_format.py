"""Tables of a journal, and the conversion of a journal that an older stopgo wrote."""

from __future__ import annotations

import sqlite3

import msgspec

from stopgo.bridge.link.protocol import CHUNK_BYTES
from stopgo.bridge.robot.hashed_rows import HASHED_TABLES, read_rows, row_hash, write_row

FORMAT = 3
"""Format of the journal: 1 had no hashes, 2 had each mission in one row; a newer one is refused."""


class NewerJournal(sqlite3.DatabaseError):
    """A journal that a newer stopgo wrote; nothing of it is damaged."""


TABLES = """
CREATE TABLE IF NOT EXISTS facts (name TEXT PRIMARY KEY, value BLOB NOT NULL, seal BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS events (
    number INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, run_id TEXT NOT NULL,
    mission_id TEXT NOT NULL, revision INTEGER NOT NULL, robot_ns INTEGER NOT NULL, body BLOB NOT NULL,
    seal BLOB NOT NULL);
CREATE INDEX IF NOT EXISTS events_of_run ON events (run_id, number);
CREATE TABLE IF NOT EXISTS answers (
    cmd_id TEXT PRIMARY KEY, order_sha TEXT NOT NULL, body BLOB NOT NULL, seal BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS missions (
    mission_id TEXT NOT NULL, revision INTEGER NOT NULL, manifest BLOB NOT NULL, document INTEGER NOT NULL,
    seal BLOB NOT NULL, PRIMARY KEY (mission_id, revision));
CREATE TABLE IF NOT EXISTS nonces (nonce TEXT PRIMARY KEY, digest TEXT NOT NULL, seal BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS transfers (
    mission_id TEXT PRIMARY KEY, manifest BLOB NOT NULL, document INTEGER NOT NULL, seal BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS chunks (
    document INTEGER NOT NULL, number INTEGER NOT NULL, data BLOB NOT NULL, seal BLOB NOT NULL,
    PRIMARY KEY (document, number));
"""
"""`document` is the number of a mission's JSON in `chunks`; 0: only the mission's name is still stored."""


def make_tables(connection: sqlite3.Connection) -> None:
    """Make the tables that do not exist; part of the open transaction, if there is one."""
    for statement in filter(str.strip, TABLES.split(";")):
        connection.execute(statement)


def bring_up_to_date(connection: sqlite3.Connection) -> None:
    """Convert an older journal's rows to this format, in the open transaction.

    Raises
    ------
    NewerJournal
        If the journal is a newer program's.
    DamagedRow
        If it is damaged.
    """
    (found,) = connection.execute("PRAGMA user_version").fetchone()
    if found > FORMAT:
        raise NewerJournal(
            f"a newer stopgo wrote it (format {found}; this one reads up to {FORMAT}); update stopgo"
        )
    for table in HASHED_TABLES:
        names = columns_of(connection, table)
        if "seal" not in names:
            _hash_all(connection, table, len(names))
    if "sha256" in columns_of(connection, "chunks"):
        _divide_missions(connection)
    if found < FORMAT:
        connection.execute(f"PRAGMA user_version = {FORMAT}")


def columns_of(connection: sqlite3.Connection, table: str) -> list[str]:
    return [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]


def _hash_all(connection: sqlite3.Connection, table: str, columns: int) -> None:
    connection.execute(f"ALTER TABLE {table} ADD COLUMN seal BLOB NOT NULL DEFAULT x''")
    for row in connection.execute(f"SELECT rowid, * FROM {table}").fetchall():
        hashed = row_hash(table, row[1 : columns + 1])
        connection.execute(f"UPDATE {table} SET seal = ? WHERE rowid = ?", (hashed, row[0]))


def _divide_missions(connection: sqlite3.Connection) -> None:
    """Store whole missions in chunks, and number the documents; an unfinished push begins again."""
    missions = read_rows(connection, "missions", "ORDER BY rowid")
    for table in ("missions", "transfers", "chunks"):
        read_rows(connection, table, "")
        connection.execute(f"DROP TABLE {table}")
    make_tables(connection)
    for document, (mission_id, revision, manifest, data) in enumerate(missions, start=1):
        write_row(connection, "missions", mission_id, revision, manifest, document if data else 0)
        chunk_bytes = msgspec.json.decode(manifest)["chunk_bytes"]
        put_chunks(connection, document, data, chunk_bytes)


def put_chunks(
    connection: sqlite3.Connection, document: int, data: bytes, chunk_bytes: int = CHUNK_BYTES
) -> None:
    """Store a whole document in chunks."""
    for number, start in enumerate(range(0, len(data), chunk_bytes)):
        write_row(connection, "chunks", document, number, data[start : start + chunk_bytes])
