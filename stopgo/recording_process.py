"""A plan's recording in a process of its own, which loads Rerun while the floor is planned.

The process is forked, so that it has what is loaded here; where none can be forked, a new one is started. The
results go through a pipe, and the process writes and checks the file. If it ends early, for whatever reason,
the recording is drawn here.
"""

from __future__ import annotations

import contextlib
import copyreg
import json
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import IO, TYPE_CHECKING, Any

from stopgo.mission.console.freed_memory import give_back, looking_seldom
from stopgo.mission.console.process import ending_signals
from stopgo.mission.errors import InputError
from stopgo.planner.geometry.side_work import can_fork
from stopgo.spared_modules import SPARED_OF_RERUN, gather_when_used, load_when_used

if TYPE_CHECKING:
    from stopgo.recordings.plan import CommonDrawings, PlanRecording

CHILD = """
import json, sys
sys.path[:] = json.loads(sys.stdin.buffer.readline())
from stopgo.recording_process import serve
asked, answers = sys.stdin.buffer, sys.stdout.buffer
sys.stdout = sys.stderr
serve(asked, answers)
"""
"""Program of a process that is not forked; its first line of input is the path of modules."""

GIVEN_BACK_AT_ONCE = ("MIMALLOC_PURGE_DELAY", "0")
"""For Rerun's allocator: else it keeps what the threads of each recording have freed, 7 to 12 MB."""

CACHED = "_cached_"
"""Begin of the names of values that are derived from a result, and that no drawing reads."""
UNDRAWN = {"Visibility": "in_sight"}
"""Values of classes that no drawing reads either, and without which their defaults hold."""


class RecordingProcess:
    """The process that draws the recordings of one command's plans, one after the other."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | _Fork | None = None
        self._pickler: ResultPickler | None = None
        self._here = _Recordings()

    @property
    def is_running(self) -> bool:
        """True from the start to the end of the process, or to the first sign that it has ended."""
        return self._process is not None

    def start(self) -> None:
        """Start the process, unless Rerun is missing, or already loaded here."""
        if "rerun" in sys.modules or find_spec("rerun") is None or not sys.executable:
            return
        with contextlib.suppress(OSError):
            self._process = _Fork() if can_fork() else _program()

    def end(self) -> None:
        """End the process, also in the middle of its work."""
        process, self._process, self._pickler = self._process, None, None
        if process is not None:
            process.kill()
            process.communicate()

    def draw(self, recording_id: str, results: Iterable[object], *, more: bool = False) -> PlanDrawing:
        """Begin to draw a recording of these stage results.

        With `more`, the next recording has some of the results too: they are sent and drawn once.
        """
        asked = (recording_id, tuple(results), more)
        if self._process is not None:
            try:
                self._send(asked)
            except (pickle.PicklingError, TypeError, AttributeError):  # of a result that a plug-in made
                self.end()
        if not more:
            self._pickler = None
        return PlanDrawing(self, lambda: self._here.of(*asked))

    def written(self, path: Path) -> bool:
        """True once the recording that is being drawn is in `path`, and was read to its end.

        Raises
        ------
        OSError, InputError
            The file cannot be written, or does not hold what was written.
        """
        if self._process is None:
            return False
        try:
            self._send(path)
            assert self._process is not None and self._process.stdout is not None
            problem = pickle.load(self._process.stdout)
        except (EOFError, AssertionError, pickle.UnpicklingError):
            self.end()
            return False
        except BaseException:
            self.end()
            raise
        if problem is not None:
            raise problem
        return True

    def _send(self, value: object) -> None:
        """Send to the process without a copy; if it has ended, that is noticed when its answer is read."""
        assert self._process is not None and self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            if self._pickler is None:
                self._pickler = ResultPickler(self._process.stdin)
            self._pickler.dump(value)
            self._process.stdin.flush()


class PlanDrawing:
    """A recording that is drawn, next to the other files of a plan."""

    def __init__(self, process: RecordingProcess, drawn_here: Callable[[], PlanRecording]) -> None:
        self._process = process
        self._drawn_here = drawn_here

    def write(self, path: Path) -> None:
        """Write the recording into `path`, and read the file to its end."""
        if not self._process.written(path):
            self._drawn_here().write(path)


@contextmanager
def recording_process() -> Iterator[RecordingProcess]:
    """Yield a process that ends with the block; until it is started, recordings are drawn here."""
    process = RecordingProcess()
    try:
        yield process
    finally:
        process.end()


def _program() -> subprocess.Popen[bytes]:
    """Start a process that loads all that it needs."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", CHILD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C reaches this process, which ends the other
    )
    assert process.stdin is not None
    process.stdin.write(json.dumps(sys.path).encode() + b"\n")
    process.stdin.flush()
    return process


class _Fork:
    """A fork of this process that serves; it is used as a Popen is."""

    def __init__(self) -> None:
        asked, to = os.pipe()
        back, answers = os.pipe()
        self.stdin, self.stdout = os.fdopen(to, "wb"), os.fdopen(back, "rb")
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ending_signals())  # else both may answer one
        try:
            self.pid = os.fork()
            if not self.pid:
                self._serve(asked, answers, before)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        os.close(asked)
        os.close(answers)

    def _serve(self, asked: int, answers: int, mask: set[int]) -> None:
        """In the other process: serve without this terminal; it never returns."""
        try:
            os.setsid()  # Ctrl-C reaches the first process, which ends this one
            for ending in ending_signals():
                signal.signal(ending, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            self.stdin.close()  # else the input would never end
            self.stdout.close()
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for number in (1, 2):
                os.dup2(nowhere, number)
            sys.stdout = sys.stderr = os.fdopen(nowhere, "w")  # a thread may hold the locks of the real ones
            with os.fdopen(asked, "rb") as requests, os.fdopen(answers, "wb") as replies:
                serve(requests, replies)
        finally:
            os._exit(0)

    def kill(self) -> None:
        """End it, also in the middle of its work."""
        if self.pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Wait until it has ended."""
        if self.pid:
            with contextlib.suppress(ChildProcessError):  # where SIGCHLD is ignored it has gone by itself
                os.waitpid(self.pid, 0)
            self.pid = 0

    def communicate(self) -> None:
        """Close the pipes, and wait until it has ended."""
        with contextlib.suppress(BrokenPipeError):
            self.stdin.close()
        self.stdout.close()
        self.wait()


def serve(asked: IO[bytes], answers: IO[bytes]) -> None:
    """Draw and write recordings until the input ends; each answer is None, or the error of the writing."""
    os.environ.setdefault(*GIVEN_BACK_AT_ONCE)
    leave_pandas_out()
    load_when_used(SPARED_OF_RERUN)
    gather_when_used()
    with looking_seldom(), contextlib.suppress(EOFError):
        import stopgo.recordings.plan  # noqa: F401  loaded while nothing is asked yet

        requests, recordings = pickle.Unpickler(asked), _Recordings()
        while True:
            wanted = requests.load()
            if not wanted[-1]:
                requests = pickle.Unpickler(asked)
            _serve_one(recordings.of(*wanted), requests, answers)
            del wanted  # the next results need its memory


def _serve_one(recording: PlanRecording, requests: pickle.Unpickler, answers: IO[bytes]) -> None:
    recording.draw()
    give_back()
    problem = None
    try:
        recording.write(requests.load())
    except (OSError, InputError) as error:
        problem = error
    answers.write(pickle.dumps(problem))
    answers.flush()


class _Recordings:
    """Recordings of one plan after the other, in the process that draws them."""

    def __init__(self) -> None:
        self._common: CommonDrawings | None = None

    def of(self, recording_id: str, results: Iterable[object], more: bool) -> PlanRecording:
        """Return a recording of these results; with `more`, drawings of them are kept for the next."""
        from stopgo.recordings.plan import CommonDrawings, PlanRecording

        if more and self._common is None:
            self._common = CommonDrawings()
        recording = PlanRecording(recording_id, self._common)
        if not more:
            self._common = None
        for result in results:
            recording.observe(result)
        return recording


class _WithoutPandas:
    """Finder of modules that does not find pandas."""

    def find_spec(self, name: str, *_: Any) -> None:
        if name == "pandas":
            raise ModuleNotFoundError(name=name)


def leave_pandas_out() -> None:
    """Spare this process pandas, 0.2 s, which pyarrow loads to ask of each array whether it is a series."""
    sys.meta_path.insert(0, _WithoutPandas())


class ResultPickler(pickle.Pickler):
    """Pickles stage results, each once; what was derived from them stays here."""

    def __init__(self, file: IO[bytes]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)

    def reducer_override(self, value: Any) -> Any:
        if type(value).__name__ == "UnsetType":  # else pickle looks for it in all modules, also in stand-ins
            return _unset, ()
        if isinstance(value, MappingProxyType):
            return _read_only, (dict(value),)
        values = getattr(value, "__dict__", None)
        if isinstance(value, type) or not isinstance(values, dict):
            return NotImplemented
        left = {name: held for name, held in values.items() if not _is_undrawn(value, name)}
        if len(left) == len(values):
            return NotImplemented
        return copyreg.__newobj__, (type(value),), left  # type: ignore[attr-defined]


def _is_undrawn(value: object, name: str) -> bool:
    return name.startswith(CACHED) or name == UNDRAWN.get(type(value).__name__)


def _unset() -> object:
    from msgspec import UNSET

    return UNSET


def _read_only(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(values)
