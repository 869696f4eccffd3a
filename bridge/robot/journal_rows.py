"""Transactions and checked rows of a journal's database.

One connection, one lock: a thread has the lock for as long as its transaction lasts. Each row is read with
its hash (`hashed_rows`). Each transaction is numbered, and its number is stored in a second file once the
transaction is on disk.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from stopgo.bridge.robot.hashed_rows import DamagedRow, NewestTransaction, read_rows, verify_rows, write_row
from stopgo.bridge.robot.journal_format import bring_up_to_date, make_tables
from stopgo.bridge.robot.lock_waits import LockWaits, WatchedLock
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
        self.waits = LockWaits()
        """Sections of the journal's lock; a controller adds those of its own."""
        self._lock = WatchedLock(self.waits)
        self._writing = False
        self._facts: dict[str, str | bytes | None] = {}
        """Values of facts as they were read since the last transaction of any process."""
        self._facts_of = 0
        """The number that SQLite gave to the last transaction of another process."""
        self._behind: int | None = None
        """Number that the second file could not take; the next transaction tries again first."""
        self.commit_hook: Callable[[str], None] = lambda moment: None
        """Called just before ("commit") and after ("committed") every commit, for tests of crashes."""
        make_tables(connection)

    def verify(self) -> None:
        """Read everything once after a restart, and convert the journal of an older stopgo.

        Raises
        ------
        DamagedRow
            If any row is not what was written.
        NewerJournal
            If a newer stopgo wrote it.
        """
        stored = 0 if self._newest is None else self._newest.read()
        with self.transaction():
            bring_up_to_date(self.connection)
            verify_rows(self.connection)
            if stored > self._changes():
                raise DamagedRow("its last entries are missing")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all rows of the block, or none; they are on disk at its end. A nested one joins the outer.

        Raises
        ------
        sqlite3.DatabaseError
            If nothing of it is stored: the disk is full, or has failed.
        """
        with self._lock:
            if self._writing:
                yield
                return
            self._writing = True
            self._facts.clear()
            try:
                with storage_errors():
                    self._begin()
                yield
                number = self._changes() + 1
                write_row(self.connection, "facts", "changes", number)
                with storage_errors():
                    self.commit_hook("commit")
                    self.connection.execute("COMMIT")
            except BaseException:
                with contextlib.suppress(sqlite3.DatabaseError):  # then the next transaction begins with it
                    self._roll_back()
                raise
            finally:
                self._writing = False
                self._facts.clear()
            self.commit_hook("committed")
            self._number(number)

    def _begin(self) -> None:
        if self._newest is not None and self._behind is not None:
            self._newest.store(self._behind)
            self._behind = None
        if self._reserve is not None:
            self._reserve.release_if_needed()
        self._roll_back()
        self.connection.execute("BEGIN IMMEDIATE")

    def _roll_back(self) -> None:
        if self.connection.in_transaction:
            self.connection.execute("ROLLBACK")

    def _number(self, number: int) -> None:
        """Store the number of a transaction that is on disk; what fails here has undone nothing of it."""
        if self._newest is None:
            return
        try:
            self._newest.store(number)
        except OSError:
            self._behind = number

    def _changes(self) -> int:
        """Return the number of the newest transaction."""
        rows = self.read("facts", "WHERE name = 'changes'")
        return int(rows[0][1]) if rows else 0

    def space_shortage(self, size: int) -> str:
        """Return why `size` more bytes would need the reserved disk space; empty if they would not."""
        with storage_errors():
            return "" if self._reserve is None else self._reserve.shortage(size)

    def free_within(self, longest_s: float) -> AbstractContextManager[bool]:
        """Keep other threads' transactions out for the block, if none lasts longer than that."""
        return self._lock.within(longest_s)

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

    def fact(self, name: str) -> str | bytes | None:
        """Return the value of a fact as it was written, `None` if there is none.

        Outside transactions a row is read and checked once, until some process has written: who follows an
        autopilot asks for several facts at each message, and few of them change.
        """
        with self._lock:
            if self._writing:
                return self._read_fact(name)
            ((others,),) = self.connection.execute("PRAGMA data_version").fetchall()
            if others != self._facts_of:
                self._facts.clear()
                self._facts_of = others
            if name not in self._facts:
                self._facts[name] = self._read_fact(name)
            return self._facts[name]

    def _read_fact(self, name: str) -> str | bytes | None:
        rows = read_rows(self.connection, "facts", "WHERE name = ?", name)
        return rows[0][1] if rows else None

    def write(self, table: str, *values: object) -> None:
        """Write a row; it replaces a row with the same key."""
        with self.transaction():
            write_row(self.connection, table, *values)

    def delete(self, table: str, condition: str, *values: object) -> None:
        with self.transaction():
            self.connection.execute(f"DELETE FROM {table} WHERE {condition}", values)


@contextmanager
def storage_errors() -> Iterator[None]:
    """Raise a failure of the disk outside SQLite as SQLite does, so that callers know one kind of error."""
    try:
        yield
    except OSError as error:
        raise sqlite3.OperationalError(error.strerror or str(error)) from error
