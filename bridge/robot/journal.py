"""The robot's journal: events, commands and their answers, missions, and the state of the run.

One SQLite file per robot. The parts, each in a module of its own, each using only those above it:

hashed_rows      a hash in every row, and the number of the newest transaction in a second file
journal_format   the tables, and the conversion of a journal that an older stopgo wrote
journal_rows     `JournalRows`: the lock, transactions, reading and writing rows, the check after a restart
stored_missions  `StoredMissions`: accepted missions, and the one that is arriving in chunks
journal          `Journal`: facts, events, answers and nonces
journal_file     opening and locking; `open_journal` for one process, `shared_journal` for several

Tables
    facts      one current value per name, as JSON: "run", "lease", "owner", "changes", and others
    events     numbered from 1 without a gap; never changed, never deleted
    answers    by command id, with the command's hash: the newest 10 000
    nonces     by nonce, the digest of the mission that was committed with it: the newest 10 000
    missions   by id and revision, the manifest and the number of its document, 0 once that is dropped
    transfers  the mission that is arriving: at most one
    chunks     by document and number, the bytes

Invariants
    1. A transaction is on disk when its block ends (`synchronous = FULL`), or leaves nothing.
    2. Whatever belongs together is one transaction. Nested transactions join the outer one.
    3. A row that is read is the row that was written, or reading fails: the robot does not start on it.
    4. Transactions are numbered. If `newest` has a higher number than the database, its end was lost, and the
       journal is refused. `newest` is written after the commit, so a crash between the two refuses nothing.
    5. A document that nothing refers to may be deleted at any time, in small transactions, so that a pause
       or an abort never waits long for the lock.
    6. Some disk space is reserved (`reserve`), and is given up first when the disk fills.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TypeVar

import msgspec

from stopgo.bridge.robot.journal_rows import JournalRows
from stopgo.bridge.robot.stored_missions import StoredMissions
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import AnyEvent, event_of
from stopgo.mission.run.run_commands import Answer
from stopgo.mission.run.states import Change, events_of

ANSWERS_KEPT = 10_000
NONCES_KEPT = 10_000

S = TypeVar("S", bound=msgspec.Struct)


class Journal:
    """An open journal; every method may be called from any thread."""

    def __init__(self, rows: JournalRows) -> None:
        self.rows = rows
        self.missions = StoredMissions(rows)
        self._decoded: dict[tuple[str, type], tuple[str | bytes, msgspec.Struct]] = {}
        """The last value of each fact, with the JSON that it was decoded from."""

    def transaction(self) -> AbstractContextManager[None]:
        """Write all rows of the block, or none; they are on disk at its end. A nested one joins the outer."""
        return self.rows.transaction()

    def space_shortage(self, size: int) -> str:
        """Return why `size` more bytes would need the reserved disk space; empty if they would not."""
        return self.rows.space_shortage(size)

    def fact(self, name: str, kind: type[S]) -> S | None:
        """Return the value that was stored last under this name.

        Raises
        ------
        InputError
            If it is not of this kind, so a newer stopgo wrote it.
        """
        stored, before = self.rows.fact(name), self._decoded.get((name, kind))
        if stored is None:
            return None
        if before is not None and before[0] is stored and isinstance(before[1], kind):
            return before[1]
        try:
            found = decoded(stored, kind)
        except msgspec.ValidationError as error:
            raise InputError(
                f"the journal's {name}: {error}; a newer stopgo wrote it: update stopgo"
            ) from None
        self._decoded[name, kind] = stored, found
        return found

    def store_fact(self, name: str, value: msgspec.Struct) -> None:
        self.rows.write("facts", name, msgspec.json.encode(value))

    def forget_fact(self, name: str) -> None:
        self.rows.delete("facts", "name = ?", name)

    def store_change(self, change: Change, *, robot: str, boot_id: str, now_ns: int) -> None:
        """Store a change of the run with its events."""
        with self.transaction():
            self.store_fact("run", change.run)
            for event in events_of(change, robot=robot, boot_id=boot_id, now_ns=now_ns):
                self.append(event)

    def append(self, event: AnyEvent) -> AnyEvent:
        """Store the event under the next number, and return it with that number."""
        with self.transaction():
            numbered = msgspec.structs.replace(event, number=self.newest + 1)
            self.rows.write(
                "events", numbered.number, type(event).__name__, event.run_id, event.mission_id,
                event.revision, event.robot_ns, msgspec.json.encode(numbered),
            )  # fmt: skip
        return numbered

    def events(
        self, *, since: int = 0, run_id: str | None = None, limit: int = 10**9
    ) -> tuple[AnyEvent, ...]:
        """Return the events with a number above `since`, in order."""
        return tuple(map(event_of, self.bodies(since=since, run_id=run_id, limit=limit)))

    def bodies(self, *, since: int = 0, run_id: str | None = None, limit: int = 10**9) -> tuple[bytes, ...]:
        """Return the same events as they were written, in JSON."""
        rows = self.rows.read(
            "events", "WHERE number > ? AND (? IS NULL OR run_id = ?) ORDER BY number LIMIT ?",
            since, run_id, run_id, limit,
        )  # fmt: skip
        return tuple(row[-1] for row in rows)

    @property
    def newest(self) -> int:
        """Number of the newest event, 0 if there is none."""
        return int(self.rows.select("SELECT COALESCE(MAX(number), 0) FROM events")[0][0])

    @property
    def newest_ns(self) -> int:
        """Time of the newest event, 0 if there is none."""
        return int(self.rows.select("SELECT COALESCE(MAX(robot_ns), 0) FROM events")[0][0])

    def has_run(self, mission_id: str, revision: int) -> bool:
        """True if a run of this mission has begun and ended."""
        return bool(
            self.rows.select(
                "SELECT 1 FROM events WHERE mission_id = ? AND revision = ?"
                " AND kind IN ('Finished', 'Aborted') LIMIT 1",
                *(mission_id, revision),
            )
        )

    def last_event(self, run_id: str, kind: str) -> AnyEvent | None:
        """Return the newest event of a kind in a run."""
        rows = self.rows.read(
            "events", "WHERE run_id = ? AND kind = ? ORDER BY number DESC LIMIT 1", run_id, kind
        )
        return event_of(rows[0][-1]) if rows else None

    def answer(self, cmd_id: str) -> tuple[str, Answer] | None:
        """Return the stored answer of a command, after the hash of that command."""
        rows = self.rows.read("answers", "WHERE cmd_id = ?", cmd_id)
        return (rows[0][1], decoded(rows[0][2], Answer)) if rows else None

    def store_answer(self, order_sha: str, answer: Answer) -> None:
        self.rows.write("answers", answer.cmd_id, order_sha, msgspec.json.encode(answer))

    def forget_answers(self, *, keep: int) -> None:
        """Drop all but the newest answers; commands that old have expired and would be refused."""
        self.rows.delete("answers", "rowid <= (SELECT MAX(rowid) FROM answers) - ?", keep)

    def nonce(self, nonce: str) -> str | None:
        """Return the digest of the mission that was committed with this nonce; `None` if there is none."""
        rows = self.rows.read("nonces", "WHERE nonce = ?", nonce)
        return str(rows[0][1]) if rows else None

    def store_nonce(self, nonce: str, digest: str) -> None:
        with self.transaction():
            if self.nonce(nonce) is None:
                self.rows.write("nonces", nonce, digest)
            self.rows.delete("nonces", "rowid <= (SELECT MAX(rowid) FROM nonces) - ?", NONCES_KEPT)
