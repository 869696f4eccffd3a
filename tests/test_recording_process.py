"""A plan's recording is the same whether a process of its own draws it, or ends before it has."""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType, ModuleType

import numpy as np
import pytest

from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import InputError
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Visibility
from stopgo.mission.stages.sight import sight_of
from stopgo.planner import plan
from stopgo.recording_process import RecordingProcess, ResultPickler, recording_process
from stopgo.recordings.rrd.read import check
from tests.disk import small_disk
from tests.planner.worlds import two_rooms
from tests.waiting import wait_until


@pytest.fixture(scope="module")
def results() -> tuple[object, ...]:
    """Stage results of a small floor."""
    part = plan(two_rooms(0.9), Settings(range=4.0)).parts[0]
    sight = sight_of(part.route, part.mission, part.figures)
    return (*part.stage_results(), part.mission, schedule(part.mission), sight)


@contextmanager
def started() -> Iterator[RecordingProcess]:
    """A process that was started, as if this one had not loaded Rerun; a fork would have its locks."""
    with recording_process() as made:
        with pytest.MonkeyPatch.context() as patch:
            patch.delitem(sys.modules, "rerun", raising=False)
            patch.setattr("stopgo.recording_process.can_fork", lambda: False)
            made.start()
        assert made.is_running
        yield made


@pytest.fixture
def process() -> Iterator[RecordingProcess]:
    """A process for a test that ends it."""
    with started() as made:
        yield made


@pytest.fixture(scope="module")
def lasting() -> Iterator[RecordingProcess]:
    """A process for the tests after which it still runs."""
    with started() as made:
        yield made


def pickled(value: object) -> bytes:
    file = io.BytesIO()
    ResultPickler(file).dump(value)
    return file.getvalue()


def test_the_process_writes_what_would_be_written_here(
    lasting: RecordingProcess, results: tuple[object, ...], tmp_path: Path
) -> None:
    here, there = tmp_path / "here.rrd", tmp_path / "there.rrd"
    RecordingProcess().draw("same", results).write(here)
    lasting.draw("same", results).write(there)
    assert lasting.is_running, "the process has drawn it"
    assert check(there) == check(here)
    lasting.draw("next", results).write(there)
    assert lasting.is_running
    assert check(there).recording_id == "next"


def test_results_that_recordings_share_are_sent_once(results: tuple[object, ...]) -> None:
    file = io.BytesIO()
    pickler = ResultPickler(file)
    pickler.dump(("first", results))
    first = file.tell()
    pickler.dump(("second", results))
    assert file.tell() - first < 100
    file.seek(0)
    unpickler = pickle.Unpickler(file)
    (_, before), (_, after) = unpickler.load(), unpickler.load()
    assert all(a is b for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize("when", ["beside", "killed between", "here"])
def test_recordings_that_share_results_are_as_each_alone(
    request: pytest.FixtureRequest, results: tuple[object, ...], tmp_path: Path, when: str
) -> None:
    alone, shared = tmp_path / "alone.rrd", tmp_path / "shared.rrd"
    RecordingProcess().draw("same", results).write(alone)
    fixture = {"beside": "lasting", "killed between": "process"}.get(when)
    sharing = request.getfixturevalue(fixture) if fixture else RecordingProcess()
    for recording_id, more in (("first", True), ("same", True), ("last", False), ("same", False)):
        drawing = sharing.draw(recording_id, results, more=more)
        if when == "killed between" and recording_id == "same" and sharing._process is not None:
            sharing._process.kill()
        drawing.write(shared)
        assert check(shared).recording_id == recording_id
        assert recording_id != "same" or check(shared) == check(alone)
    assert sharing.is_running == (when == "beside")


def test_results_are_pickled_without_a_search_in_other_modules(
    results: tuple[object, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search would load the modules that only stand-ins hold a place for."""

    class StandIn(ModuleType):
        def __getattribute__(self, name: str) -> object:
            raise AssertionError(name)

    others = {"stand-in": StandIn("stand-in"), **sys.modules}
    monkeypatch.setattr(sys, "modules", others)
    assert pickle.loads(pickled(results)) is not None


@pytest.mark.parametrize("when", ["before", "during", "after"])
def test_a_process_that_is_killed_costs_no_recording(
    process: RecordingProcess, results: tuple[object, ...], tmp_path: Path, when: str
) -> None:
    child = process._process
    assert child is not None
    if when == "before":
        child.kill()
        child.wait()
    drawing = process.draw("killed", results)
    if when == "during":
        child.kill()
    elif when == "after":
        drawing.write(tmp_path / "first.rrd")
        child.kill()
        drawing = process.draw("killed", results)
    drawing.write(tmp_path / "plan.rrd")
    assert not process.is_running
    assert check(tmp_path / "plan.rrd").recording_id == "killed"


def test_results_that_cannot_be_sent_are_drawn_here(
    process: RecordingProcess, results: tuple[object, ...], tmp_path: Path
) -> None:
    process.draw("own", (*results, lambda: None)).write(tmp_path / "plan.rrd")
    assert not process.is_running
    assert check(tmp_path / "plan.rrd").recording_id == "own"


def test_a_full_disk_is_reported_as_here(results: tuple[object, ...], tmp_path: Path) -> None:
    with small_disk(10_000), started() as process:
        drawing = process.draw("full", results)
        with pytest.raises(OSError, match="File too large"):
            drawing.write(tmp_path / "plan.rrd")


def test_a_file_that_does_not_hold_the_recording_is_an_error(
    lasting: RecordingProcess, results: tuple[object, ...], tmp_path: Path
) -> None:
    drawing = lasting.draw("lost", results)
    with pytest.raises((OSError, InputError)):
        drawing.write(tmp_path / "no folder" / "plan.rrd")
    assert lasting.is_running


def test_derived_values_stay_here_and_read_only_ones_stay_read_only(results: tuple[object, ...]) -> None:
    floor = results[0]
    vars(floor)["_cached_by_a_test"] = lambda: None
    sent = pickle.loads(pickled(floor))
    del vars(floor)["_cached_by_a_test"]
    assert "_cached_by_a_test" not in vars(sent)
    assert isinstance(sent.status, MappingProxyType)
    assert b"stopgo.planner" not in pickled(results)


def test_the_line_of_sight_without_limits_is_not_sent(results: tuple[object, ...]) -> None:
    seen = next(result for result in results if isinstance(result, Visibility))
    assert seen.in_sight is not None
    sent = pickle.loads(pickled(seen))
    assert sent.in_sight is None
    assert np.array_equal(sent.first, seen.first)


OWNER = """
import sys
from stopgo.recording_process import RecordingProcess
process = RecordingProcess()
process.start()
print(process._process.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_the_process_ends_when_its_owner_is_killed() -> None:
    owner = subprocess.Popen(
        [sys.executable, "-c", OWNER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert owner.stdout is not None and owner.stdin is not None
    child = int(owner.stdout.readline())
    owner.send_signal(signal.SIGKILL)
    owner.communicate()
    wait_until(lambda: not _runs(child))


def _runs(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


FORKED = """
import pickle, sys
from pathlib import Path
from stopgo.recording_process import recording_process
results = pickle.load(sys.stdin.buffer)
for path in sys.argv[1:]:
    with recording_process() as process:
        process.start()
        assert type(process._process).__name__ == "_Fork"
        drawing = process.draw("same", results)
        if "killed" in path:
            process._process.kill()
        drawing.write(Path(path))
        print(process.is_running)
"""


@pytest.mark.skipif(sys.platform != "linux" or os.cpu_count() == 1, reason="no process is forked here")
def test_a_fork_writes_what_would_be_written_here(results: tuple[object, ...], tmp_path: Path) -> None:
    """One is asked for nothing more, and then another one is killed."""
    here, there, killed = (tmp_path / f"{name}.rrd" for name in ("here", "there", "killed"))
    RecordingProcess().draw("same", results).write(here)
    command = [sys.executable, "-c", FORKED, str(there), str(killed)]
    done = subprocess.run(command, input=pickled(results), capture_output=True, check=True)
    assert done.stdout.split() == [b"True", b"False"]
    assert check(killed) == check(there) == check(here)
