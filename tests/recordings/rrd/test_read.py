"""A recording that cannot be read to its end is refused in one line."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr

from stopgo.mission.errors import InputError
from stopgo.recordings.embedded import reading
from stopgo.recordings.embedded.reading import read_each, read_recording
from stopgo.recordings.rrd import subprocess_read
from stopgo.recordings.rrd.read import check
from tests.faults.sizes import some

BROKEN = {
    "empty": lambda data: b"",
    "junk": lambda data: b"hello " * 100,
    "a header only": lambda data: data[:10],
    "cut in the middle": lambda data: data[: len(data) // 2],
    "cut near the end": lambda data: data[:-100],
}


@pytest.fixture(autouse=True)
def _another_process_reads_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "fatal_faults", subprocess_read.fatal_faults)


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_file_is_refused_in_one_line(plan: Path, tmp_path: Path, how: str) -> None:
    path = tmp_path / "broken.rrd"
    path.write_bytes(BROKEN[how](plan.read_bytes()))
    with pytest.raises(InputError) as refused:
        check(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("place", some([0.1, 0.3, 0.5, 0.7], every=2))
def test_a_damaged_byte_never_ends_the_process(plan: Path, tmp_path: Path, place: float) -> None:
    data = bytearray(plan.read_bytes())
    data[int(place * len(data))] ^= 0xFF
    path = tmp_path / "flipped.rrd"
    path.write_bytes(data)
    try:
        read_recording(path)
    except InputError as refused:
        assert "\n" not in str(refused)


def test_the_other_process_reads_all_of_a_recording_with_little_of_rerun(plan: Path) -> None:
    program = subprocess_read.CHILD.replace("        pass", "        raise")
    program += 'assert "rerun.chunk" in sys.modules and "rerun.archetypes" not in sys.modules'
    arguments = json.dumps([sys.path, [str(plan)]])
    done = subprocess.run(
        [sys.executable, "-c", program], input=arguments, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "0\n", "")


ENDING = """
import json, os, sys
for number, path in enumerate(json.load(sys.stdin)[1]):
    print(number, flush=True)
    if "fatal" in path:
        os.abort()
    if "unforeseen" in path:
        sys.exit(1)
"""


def test_a_file_that_ends_its_reader_hides_no_other(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One process reads them all; behind each that ends it, another one goes on."""
    started = []
    run = subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: started.append(a) or run(*a, **k))
    monkeypatch.setattr(subprocess_read, "CHILD", ENDING)
    names = ("a.rrd", "fatal-1.rrd", "unforeseen.rrd", "fatal-2.rrd", "c.rrd")
    for name in names:
        shutil.copy(plan, tmp_path / name)
    (tmp_path / "junk.rrd").write_bytes(b"hello")
    found = {path.name: item for path, item in read_each([tmp_path / name for name in (*names, "junk.rrd")])}
    refused = {name: str(item) for name, item in found.items() if isinstance(item, InputError)}
    assert sorted(refused) == ["fatal-1.rrd", "fatal-2.rrd", "junk.rrd"]
    assert refused["fatal-2.rrd"].endswith("fatal-2.rrd: damaged (reading it ended with signal 6)")
    assert len(started) == 4


def test_a_damaged_table_of_contents_is_not_a_missing_end(plan: Path, tmp_path: Path) -> None:
    """Only the end of a file that was cut is missing; the other may have been copied badly."""
    whole, damaged = plan.read_bytes(), tmp_path / "damaged.rrd"
    for k in (400, 600):  # from the end: in the table of contents
        damaged.write_bytes(whole[:-k] + bytes([whole[-k] ^ 8]) + whole[len(whole) - k + 1 :])
        with pytest.raises(InputError, match=r": is damaged; save the rest with: rerun rrd optimize"):
            check(damaged)
    damaged.write_bytes(whole[:-400])
    with pytest.raises(InputError, match=r": is truncated; save the rest with"):
        check(damaged)


def test_a_link_to_nothing_and_a_pipe_are_called_so(tmp_path: Path) -> None:
    link, pipe = tmp_path / "link.rrd", tmp_path / "pipe.rrd"
    link.symlink_to(tmp_path / "nowhere.rrd")
    os.mkfifo(pipe)
    with pytest.raises(InputError, match=r"link\.rrd: is a link to a file that does not exist"):
        check(link)
    with pytest.raises(InputError, match=r"pipe\.rrd: is a pipe, a socket or a device, not a file"):
        check(pipe)


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
