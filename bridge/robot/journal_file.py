"""The journal's file: its folder, its locks, and its opening after a normal end or a crash.

The folder has `journal.sqlite`, `newest` (the newest transaction's number), `reserve` (disk space kept free)
and the locks that keep other processes out. A journal is read whole before it is used.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import IO

import msgspec

from stopgo.bridge.robot.hashed_rows import DamagedRow, NewestTransaction
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_format import NewerJournal
from stopgo.bridge.robot.journal_rows import JournalRows
from stopgo.bridge.robot.reserve import Reserve
from stopgo.mission.errors import InputError

LOCKED_S = 60.0
"""Longest wait for another process's write. A write takes milliseconds; on a machine under load, seconds."""


class Owner(msgspec.Struct, frozen=True):
    """The robot that a state directory belongs to."""

    robot: str


@contextmanager
def open_journal(directory: Path, robot: str) -> Iterator[Journal]:
    """Open the journal of `robot` in `directory`, and keep other processes out.

    Raises
    ------
    InputError
        If the directory cannot be used, is in use, or belongs to another robot.
    """
    with _open_lock(directory, "lock") as lock:
        _lock(lock.fileno(), directory)
        _note_process(lock.fileno(), directory)
        with _opened(directory, robot) as journal:
            yield journal


@contextmanager
def shared_journal(directory: Path, robot: str | None) -> Iterator[Journal]:
    """Open the journal together with other processes that call this; `open_journal` is excluded meanwhile.

    `robot` is its owner; `None` opens that of any. A write that depends on a read belongs into one
    `transaction` with it.
    """
    with _open_lock(directory, "lock") as lock, _open_lock(directory, "opening") as opening:
        _lock(lock.fileno(), directory, shared=True)
        locks = _file_locks(directory)
        # Two processes must not make or convert the tables at the same time.
        locks.flock(opening.fileno(), locks.LOCK_EX)
        with _opened(directory, robot) as journal:
            locks.flock(opening.fileno(), locks.LOCK_UN)
            yield journal


def owner_of(directory: Path) -> str | None:
    """Return the robot that a state directory belongs to; `None` if it has no journal that can be read."""
    if not (directory / "journal.sqlite").is_file():
        return None
    with suppress(InputError), shared_journal(directory, None) as journal:
        owner = journal.fact("owner", Owner)
        return None if owner is None else owner.robot
    return None


def _note_process(lock: int, directory: Path) -> None:
    """Write the process id into the lock file, for the message that another process gets."""
    try:
        os.ftruncate(lock, 0)
        os.pwrite(lock, str(os.getpid()).encode(), 0)
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


def _open_lock(directory: Path, name: str) -> IO[str]:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return (directory / name).open("a+")
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


@contextmanager
def _opened(directory: Path, robot: str | None) -> Iterator[Journal]:
    path = directory / "journal.sqlite"
    reserve = Reserve(directory / "reserve")
    reserve.release_if_needed()
    with ExitStack() as stack:
        newest = stack.enter_context(closing(_newest_transaction(directory)))
        connection = stack.enter_context(closing(_connect(path)))
        journal = _verified(path, robot, connection, newest, reserve)
        reserve.make()
        try:
            yield journal
        except sqlite3.DatabaseError as error:
            raise InputError(f"{path}: {_one_line(error)}; is the disk full, read-only or damaged?") from None


def _verified(
    path: Path,
    robot: str | None,
    connection: sqlite3.Connection,
    newest: NewestTransaction,
    reserve: Reserve,
) -> Journal:
    try:
        rows = JournalRows(connection, newest, reserve)
        rows.verify()
        journal = Journal(rows)
        if robot is not None:
            _claim(journal, path.parent, robot)
    except NewerJournal as newer:
        raise InputError(f"{path}: {newer}") from None
    except (DamagedRow, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: journal corrupted ({_one_line(error)}); move the folder away to begin again,"
            " and bring the robot to its start yourself"
        ) from None
    except sqlite3.DatabaseError as error:
        raise InputError(f"{path}: {_one_line(error)}; is the disk full, read-only or damaged?") from None
    return journal


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _newest_transaction(directory: Path) -> NewestTransaction:
    try:
        return NewestTransaction(directory / "newest")
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


def memory_journal() -> Journal:
    """Return a journal in memory, lost with the last reference to it."""
    return Journal(JournalRows(sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)))


def _connect(path: Path) -> sqlite3.Connection:
    try:
        connection = sqlite3.connect(path, LOCKED_S, isolation_level=None, check_same_thread=False)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA wal_autocheckpoint = 200")  # pages: the log stays far below the reserve
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {_one_line(error)}; move it away to begin again") from None
    return connection


def _lock(lock: int, directory: Path, *, shared: bool = False) -> None:
    locks = _file_locks(directory)
    try:
        locks.flock(lock, (locks.LOCK_SH if shared else locks.LOCK_EX) | locks.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(lock, 32, 0).decode(errors="replace").strip() or "unknown"
        raise InputError(
            f"--state {directory}: in use by another robot process (pid {holder}); give each its own"
        ) from None


def _file_locks(directory: Path) -> ModuleType:
    """Return the system's file locks, which keep two processes from one journal."""
    try:
        import fcntl
    except ModuleNotFoundError:
        raise InputError(
            f"--state {directory}: a robot stores its journal on Linux and macOS only; here you can plan,"
            " and command and watch robots that run elsewhere"
        ) from None
    return fcntl


def _claim(journal: Journal, directory: Path, robot: str) -> None:
    """Make a new directory the robot's, or check that it is."""
    owner = journal.fact("owner", Owner)
    if owner is None:
        journal.store_fact("owner", Owner(robot))
    elif owner.robot != robot:
        raise InputError(f"--state {directory}: belongs to robot {owner.robot}, not {robot}")
