"""The tables of a journal, and how one that an older stopgo wrote is brought up to date."""

from __future__ import annotations

import sqlite3

import msgspec

from stopgo.bridge.link.protocol import CHUNK_BYTES
from stopgo.bridge.robot.sealed_rows import SEALED, DamagedRow, put, seal_of, sealed

FORMAT = 3
"""Of the journal: 1 had no hashes, 2 held each mission in one row; a newer one is refused."""

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
"""`document` numbers a mission's JSON, which lies in `chunks`; 0: only the mission's name has been kept."""


def make_tables(connection: sqlite3.Connection) -> None:
    """Make those that are not there; part of the transaction that is under way, if one is."""
    for statement in filter(str.strip, TABLES.split(";")):
        connection.execute(statement)


def bring_up_to_date(connection: sqlite3.Connection) -> None:
    """Write an older journal's rows as this program does, in the transaction that is under way.

    Raises
    ------
    Damaged
        If the journal is a newer program's, or damaged.
    """
    (found,) = connection.execute("PRAGMA user_version").fetchone()
    if found > FORMAT:
        raise DamagedRow(
            f"a newer stopgo wrote it (format {found}; this one reads up to {FORMAT}); update stopgo"
        )
    for table in SEALED:
        names = columns_of(connection, table)
        if "seal" not in names:
            _seal_all(connection, table, len(names))
    if "sha256" in columns_of(connection, "chunks"):
        _cut_missions(connection)
    if found < FORMAT:
        connection.execute(f"PRAGMA user_version = {FORMAT}")


def columns_of(connection: sqlite3.Connection, table: str) -> list[str]:
    return [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]


def _seal_all(connection: sqlite3.Connection, table: str, columns: int) -> None:
    connection.execute(f"ALTER TABLE {table} ADD COLUMN seal BLOB NOT NULL DEFAULT x''")
    for row in connection.execute(f"SELECT rowid, * FROM {table}").fetchall():
        seal = seal_of(table, row[1 : columns + 1])
        connection.execute(f"UPDATE {table} SET seal = ? WHERE rowid = ?", (seal, row[0]))


def _cut_missions(connection: sqlite3.Connection) -> None:
    """Lay whole missions down in pieces, and number the documents; a push that was under way begins anew."""
    missions = sealed(connection, "missions", "ORDER BY rowid")
    for table in ("missions", "transfers", "chunks"):
        sealed(connection, table, "")
        connection.execute(f"DROP TABLE {table}")
    make_tables(connection)
    for document, (mission_id, revision, manifest, data) in enumerate(missions, start=1):
        put(connection, "missions", mission_id, revision, manifest, document if data else 0)
        chunk_bytes = msgspec.json.decode(manifest)["chunk_bytes"]
        put_pieces(connection, document, data, chunk_bytes)


def put_pieces(
    connection: sqlite3.Connection, document: int, data: bytes, chunk_bytes: int = CHUNK_BYTES
) -> None:
    """Lay a whole document down in pieces."""
    for number, start in enumerate(range(0, len(data), chunk_bytes)):
        put(connection, "chunks", document, number, data[start : start + chunk_bytes])
