"""The journal outlives the process that wrote it, whole transactions at a time."""

from __future__ import annotations

import errno
import os
import re
import sqlite3
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.link.protocol import Manifest
from stopgo.bridge.robot.hashed_rows import HASHED_TABLES, write_row
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import LOCKED_S, Owner, memory_journal, open_journal, shared_journal
from stopgo.bridge.robot.journal_format import FORMAT, TABLES
from stopgo.bridge.robot.reserve import LEAST_FREE_BYTES, RESERVE_BYTES, Reserve
from stopgo.bridge.robot.stored_missions import MISSIONS_KEPT
from stopgo.bridge.station.watch import event_line
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.run.events import Started, UnknownKind, event_of
from stopgo.mission.run.run_commands import Verb
from stopgo.mission.run.tolerance import StopErrors
from tests.bridge.world import Field, corridor


def started() -> Started:
    return Started(
        number=0, robot="r1", boot_id="b", run_id="run", mission_id="m", revision=1, robot_ns=5,
        mission_time_s=0.0, commander="me",
    )  # fmt: skip


def test_events_are_numbered_from_one_and_go_on_after_reopening(tmp_path: Path) -> None:
    with open_journal(tmp_path, "r1") as journal:
        assert [journal.append(started()).number for _ in range(2)] == [1, 2]
    with open_journal(tmp_path, "r1") as journal:
        assert journal.append(started()).number == 3
        assert [event.number for event in journal.events(since=1)] == [2, 3]


def test_a_transaction_that_fails_leaves_nothing() -> None:
    journal = memory_journal()
    with pytest.raises(RuntimeError), journal.transaction():
        journal.append(started())
        journal.store_fact("owner", Owner("r1"))
        raise RuntimeError
    assert journal.newest == 0
    assert journal.fact("owner", Owner) is None


def test_two_robots_on_one_state_directory_are_refused(tmp_path: Path) -> None:
    first, second = open_journal(tmp_path, "r1"), open_journal(tmp_path, "r1")
    with first, pytest.raises(InputError, match="in use"), second:
        pass


def test_a_state_directory_belongs_to_one_robot(tmp_path: Path) -> None:
    with open_journal(tmp_path, "r1"):
        pass
    with pytest.raises(InputError, match="belongs to robot r1"), open_journal(tmp_path, "r2"):
        pass


def test_a_damaged_journal_is_named(tmp_path: Path) -> None:
    (tmp_path / "journal.sqlite").write_bytes(b"no database" * 1000)
    with pytest.raises(InputError, match=r"journal\.sqlite"), open_journal(tmp_path, "r1"):
        pass


def test_what_another_process_writes_is_waited_for_on_a_slow_machine_too(tmp_path: Path) -> None:
    with shared_journal(tmp_path, "r1") as journal:
        assert journal.rows.connection.execute("PRAGMA busy_timeout").fetchone() == (1000 * LOCKED_S,)


def test_a_disk_too_full_for_the_lock_names_the_state_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    opened = open_journal(tmp_path / "s", "r1")
    with pytest.raises(InputError, match=r"--state .*s: cannot be used \(No space left"), opened:
        pass


def test_a_state_path_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    with pytest.raises(InputError, match="cannot be used"), open_journal(tmp_path / "state", "r1"):
        pass


FORMER_TABLES = """
CREATE TABLE missions (
    mission_id TEXT NOT NULL, revision INTEGER NOT NULL, manifest BLOB NOT NULL, document BLOB NOT NULL,
    seal BLOB NOT NULL, PRIMARY KEY (mission_id, revision));
CREATE TABLE transfers (mission_id TEXT PRIMARY KEY, manifest BLOB NOT NULL, seal BLOB NOT NULL);
CREATE TABLE chunks (
    sha256 TEXT NOT NULL, number INTEGER NOT NULL, data BLOB NOT NULL, seal BLOB NOT NULL,
    PRIMARY KEY (sha256, number));
"""
"""Of format 2, where they differ."""


def journal_of_the_second_format(folder: Path) -> None:
    """A journal as it was when each mission lay in one row; revision 1 is kept by its name only."""
    with open_journal(folder, "r1") as journal:
        field = Field(journal=journal)
        field.station().push(corridor(revision=2))
        stored = journal.missions.read(corridor().id, 2)
    assert stored is not None
    manifest, document = stored
    connection = sqlite3.connect(folder / "journal.sqlite")
    for table in ("missions", "transfers", "chunks"):
        connection.execute(f"DROP TABLE {table}")
    connection.executescript(FORMER_TABLES)
    body = msgspec.json.encode(manifest)
    write_row(connection, "missions", manifest.mission_id, 1, body, b"")
    write_row(connection, "missions", manifest.mission_id, 2, body, document)
    write_row(connection, "transfers", "other", body)
    write_row(connection, "chunks", manifest.sha256, 0, document[:100])
    connection.execute("PRAGMA user_version = 2")
    connection.commit()
    connection.close()


def journal_of_the_first_format(folder: Path) -> None:
    """A journal as it was before rows had hashes."""
    journal_of_the_second_format(folder)
    connection = sqlite3.connect(folder / "journal.sqlite")
    connection.execute("DROP INDEX events_of_run")
    for table in HASHED_TABLES:
        connection.execute(f"ALTER TABLE {table} RENAME TO new_{table}")
    connection.executescript(re.sub(r",\s*seal BLOB NOT NULL", "", FORMER_TABLES + TABLES))
    for table in HASHED_TABLES:
        columns = ", ".join(name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})"))
        connection.execute(f"INSERT INTO {table} SELECT {columns} FROM new_{table}")
        connection.execute(f"DROP TABLE new_{table}")
    connection.execute("DELETE FROM facts WHERE name = 'changes'")
    connection.execute("PRAGMA user_version = 0")
    connection.commit()
    connection.close()
    (folder / "newest").unlink()


@pytest.mark.parametrize("former", [journal_of_the_first_format, journal_of_the_second_format])
def test_a_journal_of_a_former_format_is_brought_up_to_date(
    tmp_path: Path, former: Callable[[Path], None]
) -> None:
    former(tmp_path)
    for state in ("READY", "PAUSED"):
        with open_journal(tmp_path, "r1") as journal:
            field = Field(journal=journal)
            assert field.controller.run.state == state
            assert journal.missions.read(corridor().id, 1) is None
            assert journal.missions.newest_manifest(corridor().id) is not None
            verb: Verb = "start" if state == "READY" else "resume"
            assert field.order(verb, cmd_id=verb).outcome == "ok"


def test_a_flipped_bit_in_a_mission_of_a_former_format_is_found(tmp_path: Path) -> None:
    journal_of_the_second_format(tmp_path)
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    connection.execute("UPDATE missions SET document = replace(document, '0.3', '0.8') WHERE revision = 2")
    connection.commit()
    connection.close()
    with pytest.raises(InputError, match="a row of missions"), open_journal(tmp_path, "r1"):
        pass


def test_a_journal_of_a_newer_stopgo_is_refused(tmp_path: Path) -> None:
    with open_journal(tmp_path, "r1"):
        pass
    connection = sqlite3.connect(tmp_path / "journal.sqlite")
    connection.execute(f"PRAGMA user_version = {FORMAT + 1}")
    connection.close()
    with pytest.raises(InputError) as refused, open_journal(tmp_path, "r1"):
        pass
    assert str(refused.value) == (
        f"{tmp_path / 'journal.sqlite'}: a newer stopgo wrote it (format {FORMAT + 1}; this one reads up to"
        f" {FORMAT}); update stopgo"
    )


def test_a_state_that_only_a_newer_stopgo_knows_is_refused_in_one_line(tmp_path: Path) -> None:
    with open_journal(tmp_path, "r1") as journal:
        journal.store_fact("run", NewerRun(state="CHARGING"))
    with pytest.raises(InputError, match="update stopgo"), open_journal(tmp_path, "r1") as journal:
        Field(journal=journal)


def test_an_event_of_a_newer_stopgo_is_reported_by_its_kind() -> None:
    journal = memory_journal()
    journal.append(started())
    body = journal.bodies()[0].replace(b'"Started"', b'"Recharged"')
    event = event_of(body)
    assert isinstance(event, UnknownKind)
    assert (event.kind, event.number, event.run_id) == ("Recharged", 1, "run")
    assert "Recharged: unknown to this stopgo" in event_line(event, StopErrors())


def test_missions_that_no_run_needs_are_retired_and_their_names_kept() -> None:
    field = Field()
    station = field.station()
    for revision in range(1, MISSIONS_KEPT + 4):
        station.push(corridor(revision=revision))
    kept = [field.journal.missions.read(corridor().id, revision) is not None for revision in range(1, 8)]
    assert kept == [False, False, *[True] * (MISSIONS_KEPT + 1)]
    newest = field.journal.missions.newest_manifest(corridor().id)
    assert newest is not None
    assert newest.revision == MISSIONS_KEPT + 3
    with pytest.raises(NegativeResult, match="older_revision"):
        station.push(corridor(revision=1))


def test_of_what_is_retired_or_no_longer_sent_no_piece_stays() -> None:
    field = Field()
    station = field.station()
    for revision in range(1, MISSIONS_KEPT + 4):
        station.push(corridor(revision=revision))
    ((held,),) = field.journal.rows.select("SELECT COUNT(DISTINCT document) FROM chunks")
    assert held == MISSIONS_KEPT + 1


def test_nothing_that_is_announced_touches_a_stored_mission() -> None:
    """Another manifest that claims the same document has pieces of its own."""
    field = Field()
    field.station().push(corridor())
    stored = field.journal.missions.read(corridor().id, 1)
    assert stored is not None
    claims = msgspec.structs.replace(stored[0], revision=2, digest="0" * 64)
    field.journal.missions.begin_transfer(claims)
    field.journal.missions.store_chunk(claims, 0, b"x")
    assert field.journal.missions.read(corridor().id, 1) == stored


def test_any_part_of_a_document_is_given() -> None:
    journal = memory_journal()
    document = bytes(range(256)) * 20
    manifest = Manifest(
        mission_id="m", revision=1, digest="d", size=len(document), sha256="s", chunk_bytes=1024
    )
    journal.missions.store(manifest, document)
    for start, size in ((0, 1024), (1000, 2000), (5000, 1000), (6000, 10)):
        assert journal.missions.part(manifest, start, size) == document[start : start + size]


def test_a_push_that_would_take_the_space_kept_for_stops_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_journal(tmp_path, "r1") as journal:
        field = Field(journal=journal)
        monkeypatch.setattr(Reserve, "_free", lambda self: 1024)
        with pytest.raises(NegativeResult, match="make room"):
            field.station().push(corridor())


@pytest.mark.parametrize("left", [0, 4096])
def test_space_that_a_killed_robot_began_to_keep_is_kept_again(tmp_path: Path, left: int) -> None:
    reserve = tmp_path / "reserve"
    reserve.write_bytes(bytes(left))
    with open_journal(tmp_path, "r1"):
        assert reserve.stat().st_size == RESERVE_BYTES


def test_space_that_is_not_kept_yet_counts_as_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Reserve, "_free", lambda self: RESERVE_BYTES + LEAST_FREE_BYTES - 1)
    (tmp_path / "reserve").touch()
    assert "make room" in Reserve(tmp_path / "reserve").shortage(size=1)


class NewerRun(msgspec.Struct):
    state: str


def test_a_fact_is_the_one_that_any_process_wrote_last(tmp_path: Path) -> None:
    def robot(journal: Journal) -> str | None:
        owner = journal.fact("owner", Owner)
        return owner and owner.robot

    with shared_journal(tmp_path, "r1") as one, shared_journal(tmp_path, "r1") as other:
        assert robot(one) == robot(other) == "r1"
        other.store_fact("owner", Owner("r2"))
        assert robot(one) == robot(other) == "r2"
        with pytest.raises(RuntimeError), one.transaction():
            one.store_fact("owner", Owner("r3"))
            assert robot(one) == "r3"
            raise RuntimeError
        assert robot(one) == robot(other) == "r2"
        one.forget_fact("owner")
        assert robot(one) is robot(other) is None


def test_a_fact_that_was_not_changed_is_read_once(tmp_path: Path) -> None:
    with open_journal(tmp_path, "r1") as journal:
        first = journal.fact("owner", Owner)
        assert journal.fact("owner", Owner) is first
        with journal.transaction():
            assert journal.fact("owner", Owner) is not first
