"""A recording that cannot be read to its end is refused in one line."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import pytest
import rerun as rr

from mission.errors import InputError
from recordings.carried.reading import read_recording
from recordings.read import check

BROKEN = {
    "empty": lambda data: b"",
    "junk": lambda data: b"hello " * 100,
    "a header only": lambda data: data[:10],
    "cut in the middle": lambda data: data[: len(data) // 2],
    "cut near the end": lambda data: data[:-100],
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_file_is_refused_in_one_line(plan: Path, tmp_path: Path, how: str) -> None:
    path = tmp_path / "broken.rrd"
    path.write_bytes(BROKEN[how](plan.read_bytes()))
    with pytest.raises(InputError) as refused:
        check(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("place", [0.1, 0.3, 0.5, 0.7])
def test_a_damaged_byte_never_ends_the_process(plan: Path, tmp_path: Path, place: float) -> None:
    data = bytearray(plan.read_bytes())
    data[int(place * len(data))] ^= 0xFF
    path = tmp_path / "flipped.rrd"
    path.write_bytes(data)
    try:
        read_recording(path)
    except InputError as refused:
        assert "\n" not in str(refused)


def test_a_reader_that_ends_by_a_signal_is_a_damaged_file(
    plan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = subprocess.CompletedProcess([], returncode=-signal.SIGABRT)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: killed)
    with pytest.raises(InputError, match="ended with signal 6"):
        read_recording(plan)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        check(tmp_path / "none.rrd")


def test_a_recording_of_something_else_is_not_reviewed(tmp_path: Path) -> None:
    path = tmp_path / "other.rrd"
    with rr.RecordingStream("other") as stream:
        stream.save(path)
        stream.log("/a", rr.Scalars(1.0), static=True)
    with pytest.raises(InputError, match="of other, not of stopgo"):
        read_recording(path)
