"""Stations read records of past runs during a run; neither they nor what lies in the folder can stop it."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stopgo.bridge import record_file
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import RecordPage, Rejected
from stopgo.bridge.record_file import RecordFile, open_record_file, read_record_file
from stopgo.bridge.robot import recorder as recorder_module
from stopgo.bridge.robot.recorder import RunRecorder
from tests.bridge.robot.test_recorder import BEGAN_NS, drive, idle, pose, seqs

LAST_NET_S = 60.0


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[RunRecorder]:
    """With a run that is over, and one that is in progress."""
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    drive(recorder, 1, 2, run_id="past")
    drive(recorder, 3, run_id="run")
    yield recorder
    recorder.close()


@pytest.mark.parametrize("question", ["past", None])
def test_the_run_goes_on_while_another_one_is_read(
    recorder: RunRecorder, question: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []

    def go_on() -> None:
        drive(recorder, 4)
        taken.append(4)

    @contextmanager
    def slowly(path: Path) -> Iterator[RecordFile]:
        going_on = threading.Thread(target=go_on, daemon=True)
        going_on.start()
        going_on.join(LAST_NET_S)
        with read_record_file(path) as file:
            yield file

    monkeypatch.setattr(recorder_module, "read_record_file", slowly)
    recorder.answer(Request("key", b"", {} if question is None else {"run": question}))
    assert taken == [4]


def test_a_run_that_goes_on_after_it_was_read_is_read_whole(recorder: RunRecorder) -> None:
    assert seqs(recorder.page("past")) == [1, 2]
    assert [run.entries for run in recorder.index().runs] == [1, 1]
    drive(recorder, 4, run_id="past")
    drive(recorder, 5, run_id="run")
    assert seqs(recorder.page("past")) == [1, 2, 4]
    assert [run.entries for run in recorder.index().runs] == [2, 2]


def test_reading_changes_nothing_in_a_file_that_is_written_meanwhile(tmp_path: Path) -> None:
    with open_record_file(tmp_path / "file") as file:
        file.append(1, b"one")
    whole = (tmp_path / "file").read_bytes() + b"\x91sg\nunfinished"
    (tmp_path / "file").write_bytes(whole)
    with read_record_file(tmp_path / "file") as file:
        assert (file.newest, file.read(1)) == (1, b"one")
    assert (tmp_path / "file").read_bytes() == whole
    with pytest.raises(FileNotFoundError), read_record_file(tmp_path / "none"):
        pass


def test_files_of_others_in_the_folder_are_passed_over(recorder: RunRecorder, tmp_path: Path) -> None:
    (tmp_path / "notes.record").write_bytes(b"")
    (tmp_path / "000009-x.record.bak").write_bytes(b"")
    recorder.close()
    assert recorder.newest_ns == pose(3).robot_ns
    drive(recorder, 4, run_id="next")
    assert [run.run_id for run in recorder.index().runs] == ["past", "run", "next"]


def test_a_record_that_cannot_be_read_is_reported_as_missing(recorder: RunRecorder, tmp_path: Path) -> None:
    (tmp_path / "000001-past.record").unlink()
    (tmp_path / "000001-past.record").mkdir()
    page = recorder.answer(Request("key", b"", {"run": "past"}))
    assert isinstance(page, RecordPage)
    assert [gap.reason for gap in page.missing] == ["the robot's record cannot be read: Is a directory"]
    assert isinstance(recorder.answer(Request("key", b"", {})), Rejected)
    drive(recorder, 4)
    assert seqs(recorder.page("run")) == [3, 4]


def test_a_damaged_length_asks_for_no_more_memory_than_the_file_is_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "000001-run.record"
    with open_record_file(path) as file:
        for number in (1, 2):
            file.append(number, b"x" * 100)
    damaged = bytearray(path.read_bytes())
    damaged[8:12] = b"\xff" * 4  # of the first entry
    path.write_bytes(damaged)
    asked = []

    whole = os.pread

    def pread(handle: int, size: int, at: int) -> bytes:
        asked.append(size)
        return whole(handle, min(size, 1 << 16), at)

    monkeypatch.setattr(record_file.os, "pread", pread)
    with read_record_file(path) as file:
        assert (file.read(1), file.read(2)) == (None, b"x" * 100)
    assert max(asked) < 1 << 21


def test_an_entry_in_unknown_words_ends_no_robot(tmp_path: Path) -> None:
    recorder = RunRecorder(tmp_path)
    idle(recorder)
    drive(recorder, 1)
    recorder.close()
    with open_record_file(next(tmp_path.iterdir())) as file:
        file.append(2, b'{"later": true}')
    again = RunRecorder(tmp_path)
    assert again.newest_ns == 0
    again.pose(pose(3, boot_id="c"), began_ns=BEGAN_NS, over=False)
    again.write()
    assert seqs(again.page("run")) == [1, 3]
    again.close()
