"""Transactions and checked rows of a journal's database.

One connection, one lock: a thread has the lock for as long as its transaction lasts. Each row is read with
its hash (`hashed_rows`). Each transaction is numbered, and its number is stored in a second file once the
transaction is on disk.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from stopgo.bridge.robot.hashed_rows import DamagedRow, NewestTransaction, read_rows, verify_rows, write_row
from stopgo.bridge.robot.journal_format import bring_up_to_date, make_tables
from stopgo.bridge.robot.reserve import Reserve


class JournalRows:
    """The rows of an open journal; every method may be called from any thread."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        newest: NewestTransaction | None = None,
        reserve: Reserve | None = None,
    ) -> None:
        self.connection = connection
        self._newest = newest
        self._reserve = reserve
        self._lock = threading.RLock()
        self.commit_hook: Callable[[str], None] = lambda moment: None
        """Called just before ("commit") and after ("committed") every commit, for tests of crashes."""
        make_tables(connection)

    def verify(self) -> None:
        """Read everything once after a restart, and convert the journal of an older stopgo.

        Raises
        ------
        DamagedRow
            If any row is not what was written, or a newer stopgo wrote it.
        """
        stored = 0 if self._newest is None else self._newest.read()
        with self.transaction():
            bring_up_to_date(self.connection)
            verify_rows(self.connection)
            if stored > self._changes():
                raise DamagedRow("its last entries are missing")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all rows of the block, or none; they are on disk at its end. A nested one joins the outer."""
        with self._lock:
            if self.connection.in_transaction:
                yield
                return
            if self._reserve is not None:
                self._reserve.release_if_needed()
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                number = self._changes() + 1
                write_row(self.connection, "facts", "changes", number)
                self.commit_hook("commit")
                self.connection.execute("COMMIT")
            except BaseException:
                if self.connection.in_transaction:
                    self.connection.execute("ROLLBACK")
                raise
            self.commit_hook("committed")
            if self._newest is not None:
                self._newest.store(number)

    def _changes(self) -> int:
        """Return the number of the newest transaction."""
        rows = self.read("facts", "WHERE name = 'changes'")
        return int(rows[0][1]) if rows else 0

    def space_shortage(self, size: int) -> str:
        """Return why `size` more bytes would need the reserved disk space; empty if they would not."""
        return "" if self._reserve is None else self._reserve.shortage(size)

    def select(self, statement: str, *values: object) -> list[tuple]:
        """Return the columns that a statement selects; their rows' hashes are not checked."""
        with self._lock:
            return self.connection.execute(statement, values).fetchall()

    def read(self, table: str, clause: str, *values: object) -> list[tuple]:
        """Return whole rows, each checked by its hash.

        Raises
        ------
        DamagedRow
            If a row is not what was written.
        """
        with self._lock:
            return read_rows(self.connection, table, clause, *values)

    def write(self, table: str, *values: object) -> None:
        """Write a row; it replaces a row with the same key."""
        with self.transaction():
            write_row(self.connection, table, *values)

    def delete(self, table: str, condition: str, *values: object) -> None:
        with self.transaction():
            self.connection.execute(f"DELETE FROM {table} WHERE {condition}", values)
