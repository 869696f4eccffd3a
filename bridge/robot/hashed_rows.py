"""Rows of an SQLite file, each with a hash of its columns, so that damage on the disk is found.

A small second file has the number of the newest transaction. A flipped bit, or a lost end of the database, is
found before the robot acts on it.
"""

from __future__ import annotations

import hashlib
import os
import sqlite3
from pathlib import Path

import msgspec

HASHED_TABLES = ("facts", "events", "answers", "missions", "nonces", "transfers", "chunks")
SLOT_BYTES = 24
_to_disk = getattr(os, "fdatasync", os.fsync)  # macOS has the second only


class DamagedRow(sqlite3.DatabaseError):
    """A row, or a whole file, that does not hold what was written."""


def row_hash(table: str, values: tuple[object, ...]) -> bytes:
    """Return the hash of a row's columns; in the tables its column is called `seal`."""
    return hashlib.sha256(msgspec.msgpack.encode((table, *values))).digest()[:16]


def read_rows(connection: sqlite3.Connection, table: str, clause: str, *values: object) -> list[tuple]:
    """Return whole rows, without their hashes.

    Raises
    ------
    DamagedRow
        If a row is not what was written.
    """
    rows = connection.execute(f"SELECT * FROM {table} {clause}", values).fetchall()
    for row in rows:
        if row_hash(table, row[:-1]) != row[-1]:
            raise DamagedRow(f"a row of {table} is not what was written ({str(row[0])[:40]})")
    return [row[:-1] for row in rows]


def write_row(connection: sqlite3.Connection, table: str, *values: object) -> None:
    """Write a row; it replaces a row with the same key."""
    marks = ", ".join("?" * (len(values) + 1))
    connection.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (*values, row_hash(table, values)))


def verify_rows(connection: sqlite3.Connection) -> None:
    """Read everything once.

    Raises
    ------
    DamagedRow
        If any row is not what was written, or an event is missing.
    """
    (report,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if report != "ok":
        raise DamagedRow(" ".join(str(report).split()))
    for table in HASHED_TABLES:
        read_rows(connection, table, "")
    count, newest = connection.execute("SELECT COUNT(*), COALESCE(MAX(number), 0) FROM events").fetchone()
    if count != newest:
        raise DamagedRow(f"of {newest} events {newest - count} are missing")


class NewestTransaction:
    """The number of the newest transaction, in a file of its own that has two slots, written in turn."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)

    def close(self) -> None:
        os.close(self._file)

    def store(self, number: int) -> None:
        """Store the number; it is on disk when this returns."""
        value = number.to_bytes(8, "big")
        os.pwrite(self._file, value + row_hash("newest", (number,)), (number % 2) * SLOT_BYTES)
        _to_disk(self._file)

    def read(self) -> int:
        """Return the number, 0 if none was ever stored.

        Raises
        ------
        DamagedRow
            If neither slot holds what was written.
        """
        whole = os.pread(self._file, 2 * SLOT_BYTES, 0)
        slots = [whole[at : at + SLOT_BYTES] for at in range(0, len(whole), SLOT_BYTES)]
        numbers = [_number_in(slot) for slot in slots if slot.strip(b"\0")]
        known = [number for number in numbers if number is not None]
        if numbers and not known:
            raise DamagedRow("the number of its newest entry is not what was written")
        return max(known, default=0)


def _number_in(slot: bytes) -> int | None:
    """Return the number in a slot, `None` if the slot is damaged."""
    number = int.from_bytes(slot[:8], "big")
    return number if slot[8:] == row_hash("newest", (number,)) else None
