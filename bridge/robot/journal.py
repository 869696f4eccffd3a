"""The robot's memory: what happened, what was ordered and answered, what it holds and where it stands.

One SQLite file. What belongs together is written in one transaction and is on disk before anybody is told.
What is read is what was written, or the robot does not come up: see hashed_rows.
"""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from types import ModuleType
from typing import IO, TypeVar

import msgspec

from stopgo.bridge.link.protocol import Manifest
from stopgo.bridge.robot.hashed_rows import DamagedRow, NewestTransaction, read_rows, verify_rows, write_row
from stopgo.bridge.robot.journal_format import bring_up_to_date, make_tables, put_chunks
from stopgo.bridge.robot.reserve import Reserve
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import AnyEvent, event_of
from stopgo.mission.run.orders import Answer
from stopgo.mission.run.states import Change, told_of

ANSWERS_KEPT = 10_000
NONCES_KEPT = 10_000
MISSIONS_KEPT = 4
"""Of those that are not needed; of older ones their names."""
AT_ONCE = 8
"""Pieces that are read or forgotten in one go."""
LET_PASS_S = 0.0005
"""Between two goes: who lets go of a lock and takes it again at once never lets anybody else have it."""
UNNAMED = "document NOT IN (SELECT document FROM missions UNION SELECT document FROM transfers)"
LOCKED_S = 60.0
"""How long another process's write is waited for; it takes milliseconds, on a machine under load seconds."""

S = TypeVar("S", bound=msgspec.Struct)


class Journal:
    """An open journal; every method may be called from any thread."""

    def __init__(
        self,
        connection: sqlite3.Connection,
        newest: NewestTransaction | None = None,
        reserve: Reserve | None = None,
    ) -> None:
        self._connection = connection
        self._newest = newest
        self._reserve = reserve
        self._lock = threading.RLock()
        self.edge: Callable[[str], None] = lambda moment: None
        """Called just before and just after every commit; where tests let the power or the disk fail."""
        make_tables(connection)

    def verify(self) -> None:
        """Read everything once, and bring what an older stopgo wrote up to date.

        Raises
        ------
        Damaged
            If anything is not what was written, or a newer stopgo wrote it.
        """
        stored = 0 if self._newest is None else self._newest.read()
        with self.transaction():
            bring_up_to_date(self._connection)
            verify_rows(self._connection)
            if stored > self._changes():
                raise DamagedRow("its last entries are missing")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All that is written inside comes to be, or none of it; nested ones join the outer."""
        with self._lock:
            if self._connection.in_transaction:
                yield
                return
            if self._reserve is not None:
                self._reserve.release_if_needed()
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                number = self._changes() + 1
                self._put("facts", "changes", number)
                self.edge("commit")
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise
            self.edge("committed")
            if self._newest is not None:
                self._newest.store(number)

    def _changes(self) -> int:
        """Number of the newest transaction."""
        rows = self._sealed("facts", "WHERE name = 'changes'")
        return int(rows[0][1]) if rows else 0

    def room_for(self, size: int) -> str:
        """Why `size` more bytes are too many beside what is kept free for stops; empty if they are not."""
        return "" if self._reserve is None else self._reserve.shortage(size)

    def fact(self, name: str, kind: type[S]) -> S | None:
        """What was stored last under this name.

        Raises
        ------
        InputError
            If it is not of this kind: a newer stopgo wrote it.
        """
        rows = self._sealed("facts", "WHERE name = ?", name)
        try:
            return msgspec.json.decode(rows[0][1], type=kind) if rows else None
        except msgspec.ValidationError as error:
            raise InputError(
                f"the journal's {name}: {error}; a newer stopgo wrote it: update stopgo"
            ) from None

    def store_fact(self, name: str, value: msgspec.Struct) -> None:
        self._write("facts", name, msgspec.json.encode(value))

    def store_change(self, change: Change, *, robot: str, boot_id: str, now_ns: int) -> None:
        """A step of the run, and the events that tell of it."""
        with self.transaction():
            self.store_fact("run", change.run)
            for event in told_of(change, robot=robot, boot_id=boot_id, now_ns=now_ns):
                self.append(event)

    def append(self, event: AnyEvent) -> AnyEvent:
        """The event with its number, which is the next one."""
        with self.transaction():
            numbered = msgspec.structs.replace(event, number=self.newest + 1)
            self._write(
                "events", numbered.number, type(event).__name__, event.run_id, event.mission_id,
                event.revision, event.robot_ns, msgspec.json.encode(numbered),
            )  # fmt: skip
        return numbered

    def events(
        self, *, since: int = 0, run_id: str | None = None, limit: int = 10**9
    ) -> tuple[AnyEvent, ...]:
        """Events with a number above `since`, in order."""
        return tuple(map(event_of, self.bodies(since=since, run_id=run_id, limit=limit)))

    def bodies(self, *, since: int = 0, run_id: str | None = None, limit: int = 10**9) -> tuple[bytes, ...]:
        """The same as they were written, in JSON."""
        rows = self._sealed(
            "events", "WHERE number > ? AND (? IS NULL OR run_id = ?) ORDER BY number LIMIT ?",
            since, run_id, run_id, limit,
        )  # fmt: skip
        return tuple(row[-1] for row in rows)

    @property
    def newest(self) -> int:
        """Number of the newest event, 0 if there is none."""
        return int(self._rows("SELECT COALESCE(MAX(number), 0) FROM events")[0][0])

    @property
    def newest_ns(self) -> int:
        """Time of the newest event, 0 if there is none."""
        return int(self._rows("SELECT COALESCE(MAX(robot_ns), 0) FROM events")[0][0])

    def has_run(self, mission_id: str, revision: int) -> bool:
        """Whether a run of this mission has begun and ended."""
        return bool(
            self._rows(
                "SELECT 1 FROM events WHERE mission_id = ? AND revision = ?"
                " AND kind IN ('Finished', 'Aborted') LIMIT 1",
                *(mission_id, revision),
            )
        )

    def last_event(self, run_id: str, kind: str) -> AnyEvent | None:
        """The newest event of a kind in a run."""
        rows = self._sealed(
            "events", "WHERE run_id = ? AND kind = ? ORDER BY number DESC LIMIT 1", run_id, kind
        )
        return event_of(rows[0][-1]) if rows else None

    def forget_fact(self, name: str) -> None:
        self._delete("facts", "name = ?", name)

    def answer(self, cmd_id: str) -> tuple[str, Answer] | None:
        """The stored answer of a command, and the hash of the order it belongs to."""
        rows = self._sealed("answers", "WHERE cmd_id = ?", cmd_id)
        return (rows[0][1], msgspec.json.decode(rows[0][2], type=Answer)) if rows else None

    def store_answer(self, order_sha: str, answer: Answer) -> None:
        self._write("answers", answer.cmd_id, order_sha, msgspec.json.encode(answer))

    def forget_answers(self, *, keep: int) -> None:
        """Drop all but the newest answers; orders that old have long expired and are refused anyway."""
        self._delete("answers", "rowid <= (SELECT MAX(rowid) FROM answers) - ?", keep)

    def mission(self, mission_id: str, revision: int) -> tuple[Manifest, bytes] | None:
        """A stored mission, unless only its name has been kept."""
        manifest = self.held(mission_id, revision)
        return None if manifest is None else (manifest, b"".join(self.pieces(manifest)))

    def held(self, mission_id: str, revision: int) -> Manifest | None:
        """The same without its document."""
        rows = self._sealed(
            "missions", "WHERE mission_id = ? AND revision = ? AND document != 0", mission_id, revision
        )
        return msgspec.json.decode(rows[0][2], type=Manifest) if rows else None

    def part(self, manifest: Manifest, start: int, size: int) -> bytes:
        """So many bytes of a stored mission's document."""
        first, last = start // manifest.chunk_bytes, (start + size - 1) // manifest.chunk_bytes
        data = b"".join(self.pieces(manifest, first, last))
        return data[start - first * manifest.chunk_bytes :][:size]

    def pieces(self, manifest: Manifest, first: int = 0, last: int = 10**9) -> Iterator[bytes]:
        """The pieces of a mission's document, stored or as far as it arrived; orders pass between them."""
        document = self._document(manifest)
        for number in range(first, min(last + 1, manifest.chunks), AT_ONCE):
            if number > first:
                time.sleep(LET_PASS_S)
            clause = "WHERE document = ? AND number BETWEEN ? AND ? ORDER BY number"
            until = min(number + AT_ONCE - 1, last)
            yield from (row[2] for row in self._sealed("chunks", clause, document, number, until))

    def _document(self, manifest: Manifest) -> int:
        """The number of the mission's document, or of the same that is arriving; 0 if there is neither."""
        whole = (manifest.mission_id, manifest.revision)
        rows = self._rows("SELECT document FROM missions WHERE mission_id = ? AND revision = ?", *whole)
        return next((number for (number,) in rows if number), self._arriving(manifest))

    def _arriving(self, manifest: Manifest) -> int:
        """The number of the document of which pieces are being received; 0 if they are of another."""
        rows = self._sealed("transfers", "WHERE mission_id = ?", manifest.mission_id)
        same = rows and _cut(msgspec.json.decode(rows[0][1], type=Manifest)) == _cut(manifest)
        return int(rows[0][2]) if same else 0

    def store_mission(self, manifest: Manifest, document: bytes) -> None:
        """Keep a mission that came by another way than in pieces."""
        with self.transaction():
            number = self._new_document()
            put_chunks(self._connection, number, document, manifest.chunk_bytes)
            self._name_mission(manifest, number)

    def _name_mission(self, manifest: Manifest, document: int) -> None:
        encoded = msgspec.json.encode(manifest)
        self._write("missions", manifest.mission_id, manifest.revision, encoded, document)

    def _new_document(self) -> int:
        newest = "SELECT MAX(document) AS number FROM "
        tables = " UNION ALL ".join(newest + table for table in ("missions", "transfers", "chunks"))
        return 1 + int(self._rows(f"SELECT COALESCE(MAX(number), 0) FROM ({tables})")[0][0])

    def newest_revision(self, mission_id: str) -> Manifest | None:
        """What was stored of a mission last, also when only its name has been kept."""
        statement = "SELECT manifest FROM missions WHERE mission_id = ? ORDER BY revision DESC LIMIT 1"
        rows = self._rows(statement, mission_id)
        return msgspec.json.decode(rows[0][0], type=Manifest) if rows else None

    def keep_transfer(self, manifest: Manifest) -> None:
        """What has arrived becomes a stored mission, unless it is one already; the transfer is over.

        Its pieces stay where they are: however long the document is, nothing waits for this.
        """
        with self.transaction():
            if self.held(manifest.mission_id, manifest.revision) is None:
                self._name_mission(manifest, self._document(manifest))
            self.end_transfer(manifest)

    def retire_missions(self, *needed: tuple[str | None, int | None]) -> None:
        """Of missions that are not `needed` (id, revision) keep the newest few; of the others only the name.

        The name still tells that a revision was stored here, and with which digest.
        """
        with self.transaction():
            whole = self._rows(
                "SELECT mission_id, revision, manifest FROM missions WHERE document != 0 ORDER BY rowid"
            )
            old = [row for row in whole if row[:2] not in needed]
            for mission_id, revision, manifest in old[:-MISSIONS_KEPT]:
                self._write("missions", mission_id, revision, manifest, 0)

    def drop_pieces(self) -> None:
        """Forget the pieces of documents that nothing names any more; orders pass between them."""
        while self._rows(f"SELECT 1 FROM chunks WHERE {UNNAMED} LIMIT 1"):
            self._delete("chunks", f"rowid IN (SELECT rowid FROM chunks WHERE {UNNAMED} LIMIT {AT_ONCE})")
            time.sleep(LET_PASS_S)

    def nonce(self, nonce: str) -> str | None:
        """The digest of the mission that was committed with it before."""
        rows = self._sealed("nonces", "WHERE nonce = ?", nonce)
        return str(rows[0][1]) if rows else None

    def store_nonce(self, nonce: str, digest: str) -> None:
        with self.transaction():
            if self.nonce(nonce) is None:
                self._write("nonces", nonce, digest)
            self._delete("nonces", "rowid <= (SELECT MAX(rowid) FROM nonces) - ?", NONCES_KEPT)

    def transfer(self, mission_id: str) -> Manifest | None:
        """What is being received of this mission."""
        rows = self._sealed("transfers", "WHERE mission_id = ?", mission_id)
        return msgspec.json.decode(rows[0][1], type=Manifest) if rows else None

    def begin_transfer(self, manifest: Manifest) -> None:
        """Receive this and forget what was being received, but for pieces of the same document and size."""
        with self.transaction():
            number = self._arriving(manifest) or self._new_document()
            self._delete("transfers", "TRUE")
            self._write("transfers", manifest.mission_id, msgspec.json.encode(manifest), number)

    def end_transfer(self, manifest: Manifest) -> None:
        self._delete("transfers", "mission_id = ?", manifest.mission_id)

    def store_chunk(self, manifest: Manifest, number: int, data: bytes) -> None:
        """Store a piece of what is being received."""
        with self.transaction():
            self._write("chunks", self._arriving(manifest), number, data)

    def chunks_held(self, manifest: Manifest) -> tuple[int, ...]:
        """Numbers of the pieces that have arrived."""
        document = self._arriving(manifest)
        rows = self._rows("SELECT number FROM chunks WHERE document = ? ORDER BY number", document)
        return tuple(number for (number,) in rows)

    def _rows(self, statement: str, *values: object) -> list[tuple]:
        with self._lock:
            return self._connection.execute(statement, values).fetchall()

    def _sealed(self, table: str, clause: str, *values: object) -> list[tuple]:
        with self._lock:
            return read_rows(self._connection, table, clause, *values)

    def _put(self, table: str, *values: object) -> None:
        write_row(self._connection, table, *values)

    def _write(self, table: str, *values: object) -> None:
        with self.transaction():
            self._put(table, *values)

    def _delete(self, table: str, which: str, *values: object) -> None:
        with self.transaction():
            self._connection.execute(f"DELETE FROM {table} WHERE {which}", values)


def _cut(manifest: Manifest) -> tuple[str, int]:
    """Which document is sent, in pieces of which size."""
    return manifest.sha256, manifest.chunk_bytes


class Owner(msgspec.Struct, frozen=True):
    """Which robot a state directory belongs to."""

    robot: str


@contextmanager
def open_journal(directory: Path, robot: str) -> Iterator[Journal]:
    """The journal of `robot` in `directory`, which no other process uses meanwhile.

    Raises
    ------
    InputError
        If the directory cannot be used, is in use, or belongs to another robot.
    """
    with _lock_file(directory, "lock") as lock:
        _take(lock.fileno(), directory)
        _note_process(lock.fileno(), directory)
        with _opened(directory, robot) as journal:
            yield journal


@contextmanager
def shared_journal(directory: Path, robot: str) -> Iterator[Journal]:
    """The same, while other processes may use it too; only `open_journal` excludes them, and is excluded.

    Whoever writes from what was read does both in one `transaction`.
    """
    with _lock_file(directory, "lock") as lock, _lock_file(directory, "opening") as opening:
        _take(lock.fileno(), directory, shared=True)
        locks = _locks(directory)
        # Two at once cannot make the tables, or change how the file is written.
        locks.flock(opening.fileno(), locks.LOCK_EX)
        with _opened(directory, robot) as journal:
            locks.flock(opening.fileno(), locks.LOCK_UN)
            yield journal


def _note_process(lock: int, directory: Path) -> None:
    try:
        os.ftruncate(lock, 0)
        os.pwrite(lock, str(os.getpid()).encode(), 0)
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


def _lock_file(directory: Path, name: str) -> IO[str]:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return (directory / name).open("a+")
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


@contextmanager
def _opened(directory: Path, robot: str) -> Iterator[Journal]:
    path = directory / "journal.sqlite"
    reserve = Reserve(directory / "reserve")
    reserve.release_if_needed()
    with ExitStack() as stack:
        newest = stack.enter_context(closing(_newest(directory)))
        connection = stack.enter_context(closing(_connect(path)))
        journal = _verified(path, robot, connection, newest, reserve)
        reserve.make()
        try:
            yield journal
        except sqlite3.DatabaseError as error:
            raise InputError(f"{path}: {_line(error)}; is the disk full, read-only or damaged?") from None


def _verified(
    path: Path, robot: str, connection: sqlite3.Connection, newest: NewestTransaction, reserve: Reserve
) -> Journal:
    try:
        journal = Journal(connection, newest, reserve)
        journal.verify()
        _claim(journal, path.parent, robot)
    except (DamagedRow, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: {_line(error)}; nothing in it can be trusted: move the folder away to begin anew,"
            " and bring the robot to its start yourself"
        ) from None
    except sqlite3.DatabaseError as error:
        raise InputError(f"{path}: {_line(error)}; is the disk full, read-only or damaged?") from None
    return journal


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _newest(directory: Path) -> NewestTransaction:
    try:
        return NewestTransaction(directory / "newest")
    except OSError as error:
        raise InputError(f"--state {directory}: cannot be used ({error.strerror})") from None


def memory_journal() -> Journal:
    """A journal that is gone when it is let go."""
    return Journal(sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False))


def _connect(path: Path) -> sqlite3.Connection:
    try:
        connection = sqlite3.connect(path, LOCKED_S, isolation_level=None, check_same_thread=False)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA wal_autocheckpoint = 200")  # pages: the log stays far below the reserve
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {_line(error)}; move it away to begin anew") from None
    return connection


def _take(lock: int, directory: Path, *, shared: bool = False) -> None:
    locks = _locks(directory)
    try:
        locks.flock(lock, (locks.LOCK_SH if shared else locks.LOCK_EX) | locks.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(lock, 32, 0).decode(errors="replace").strip() or "unknown"
        raise InputError(
            f"--state {directory}: in use by another robot process (pid {holder}); give each its own"
        ) from None


def _locks(directory: Path) -> ModuleType:
    """The system's file locks, which keep two processes from one journal."""
    try:
        import fcntl
    except ModuleNotFoundError:
        raise InputError(
            f"--state {directory}: a robot's journal is kept on Linux and macOS only; here you can plan, and "
            "command and watch robots that run elsewhere"
        ) from None
    return fcntl


def _claim(journal: Journal, directory: Path, robot: str) -> None:
    owner = journal.fact("owner", Owner)
    if owner is None:
        journal.store_fact("owner", Owner(robot))
    elif owner.robot != robot:
        raise InputError(f"--state {directory}: belongs to robot {owner.robot}, not {robot}")
