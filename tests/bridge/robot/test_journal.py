"""The journal outlives the process that wrote it, whole transactions at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from bridge.robot.journal import Owner, memory_journal, open_journal
from mission.errors import InputError
from mission.events import Started


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


def test_a_state_path_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    with pytest.raises(InputError, match="cannot be used"), open_journal(tmp_path / "state", "r1"):
        pass
