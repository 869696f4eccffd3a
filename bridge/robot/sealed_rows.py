"""Rows of an SQLite file that show when anything but this program has changed them.

Each row carries a hash of its columns, and a small file beside the database the number of the newest
transaction: a bit that flips on the disk, or a tail that is lost, is found before anything follows from it.
"""

from __future__ import annotations

import hashlib
import os
import sqlite3
from pathlib import Path

import msgspec

SEALED = ("facts", "events", "answers", "missions", "nonces", "transfers", "chunks")
SLOT_BYTES = 24
_to_disk = getattr(os, "fdatasync", os.fsync)  # macOS has the second only


class DamagedRow(sqlite3.DatabaseError):
    """What is read is not what was written."""


def seal_of(table: str, values: tuple[object, ...]) -> bytes:
    """Hash of a row's columns."""
    return hashlib.sha256(msgspec.msgpack.encode((table, *values))).digest()[:16]


def sealed(connection: sqlite3.Connection, table: str, clause: str, *values: object) -> list[tuple]:
    """Whole rows, without their seals.

    Raises
    ------
    Damaged
        If a row is not what was written.
    """
    rows = connection.execute(f"SELECT * FROM {table} {clause}", values).fetchall()
    for row in rows:
        if seal_of(table, row[:-1]) != row[-1]:
            raise DamagedRow(f"a row of {table} is not what was written ({str(row[0])[:40]})")
    return [row[:-1] for row in rows]


def put(connection: sqlite3.Connection, table: str, *values: object) -> None:
    """Write a row, in place of one with its key."""
    marks = ", ".join("?" * (len(values) + 1))
    connection.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (*values, seal_of(table, values)))


def verify(connection: sqlite3.Connection) -> None:
    """Read everything once.

    Raises
    ------
    Damaged
        If anything is not what was written.
    """
    (told,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if told != "ok":
        raise DamagedRow(" ".join(str(told).split()))
    for table in SEALED:
        sealed(connection, table, "")
    count, newest = connection.execute("SELECT COUNT(*), COALESCE(MAX(number), 0) FROM events").fetchone()
    if count != newest:
        raise DamagedRow(f"of {newest} events {newest - count} are missing")


class NewestTransaction:
    """The number of the newest transaction, in a file of its own: two places, written in turn."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)

    def close(self) -> None:
        os.close(self._file)

    def store(self, number: int) -> None:
        """On disk when this returns."""
        value = number.to_bytes(8, "big")
        os.pwrite(self._file, value + seal_of("newest", (number,)), (number % 2) * SLOT_BYTES)
        _to_disk(self._file)

    def read(self) -> int:
        """The number, 0 if none was ever stored.

        Raises
        ------
        Damaged
            If neither place holds what was written.
        """
        whole = os.pread(self._file, 2 * SLOT_BYTES, 0)
        slots = [whole[at : at + SLOT_BYTES] for at in range(0, len(whole), SLOT_BYTES)]
        numbers = [_number_in(slot) for slot in slots if slot.strip(b"\0")]
        known = [number for number in numbers if number is not None]
        if numbers and not known:
            raise DamagedRow("the number of its newest entry is not what was written")
        return max(known, default=0)


def _number_in(slot: bytes) -> int | None:
    number = int.from_bytes(slot[:8], "big")
    return number if slot[8:] == seal_of("newest", (number,)) else None
