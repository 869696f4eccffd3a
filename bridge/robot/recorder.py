"""Writes down where the robot was: poses, states and health of each run, for stations that were away.

Beside the journal and not in it: poses come many times a second, and a record may be let go where an event
may not. There is a file for each run. Whatever is not in it is told as missing, with the reason.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Malformed, RecordIndex, RecordPage, Rejected, Reply, RunKept, count_of
from stopgo.bridge.record_file import open_record_file, read_record_file
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.robot.run_record import RunRecord
from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import file_name
from stopgo.mission.run.events import Health, PoseReport, PosesMissing, StateReport

ENTRY_S = 0.5
"""How often an entry is written: what a robot that is killed can lose, with the time that takes."""
LIMIT_BYTES = 512_000_000
"""Some two hundred hours of runs."""
MOST_RUNS = 1000
"""Of older ones not even the name is kept."""
RETIRED = "let go for want of room, as the oldest run that was over"
KEPT, GONE = ".record", ".retired"
_NAME = re.compile(r"[0-9]+-.*\.(record|retired)", re.ASCII)


class RunRecorder:
    """The records of one robot's runs; every method may be called from any thread.

    `room` says why so many bytes more are too many for the disk; empty if they are not.
    """

    def __init__(
        self,
        folder: Path,
        *,
        room: Callable[[int], str] = lambda size: "",
        limit_bytes: int = LIMIT_BYTES,
    ) -> None:
        self.health: Callable[[], BaseHealth] = BaseHealth
        """Asks the base."""
        self._folder = folder
        self._room = room
        self._limit_bytes = limit_bytes
        self._lock = threading.RLock()
        self._open = ExitStack()
        self._run: RunRecord | None = None
        self._past_lock = threading.Lock()
        """Held while other runs are read, which takes long; the robot's own threads never wait for it."""
        self._reading = ExitStack()
        self._read: RunRecord | None = None
        self._read_size = 0
        self._counted: dict[Path, tuple[int, int]] = {}
        """Size and entries of files of other runs."""
        self._older: dict[Path, int] = {}
        """Files of other runs, oldest first, and their sizes."""
        self._idle = False
        """Whether there was a time without a run, so that the begin of the next is seen."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be used for the record ({error.strerror})") from None

    def close(self) -> None:
        """Write what is left, and close the files."""
        self._end_run()
        with self._past_lock:
            self._read = None
            self._reading.close()

    def _end_run(self) -> None:
        with self._lock:
            self.write()
            self._run = None
            self._open.close()

    def idle(self) -> None:
        """No run is under way: the begin of the next is seen."""
        self._idle = True

    def pose(self, report: PoseReport, *, began_ns: int, over: bool) -> None:
        """Take a pose, if it is of a run; of one that is `over` only the first."""
        with self._lock:
            if report.run_id is None or (over and not self._is_of(report.run_id)):
                self._idle = True
                return
            with suppress(OSError):  # a folder that is gone or full: then it is missing
                run = self._of(report.run_id)
                run.pose(report, began_ns=began_ns, over=over, seen=self._idle)
            self._idle = self._idle or over

    def state(self, report: StateReport) -> None:
        """Take a state of the run that is recorded."""
        with self._lock:
            if self._run is not None and report.run_id == self._run.run_id:
                self._run.state(report)

    def look(self, *, battery: float, robot_ns: int) -> Health | None:
        """Take how the base is now; that, if it is not as it was."""
        base = self.health()
        with self._lock:
            if self._run is None:
                return None
            told = Health(
                robot_ns=robot_ns, run_id=self._run.run_id, battery=battery,
                localisation=base.localisation, emergency_stop=base.emergency_stop,
                safety_field=base.safety_field,
            )  # fmt: skip
            return told if self._run.health(told) else None

    def write(self) -> None:
        """Write down what was taken; if there is no room, it is missing."""
        with self._lock:
            if self._run is not None:
                self._run.write(self._shortage)

    @property
    def newest_ns(self) -> int:
        """Time of the newest pose of all, 0 if there is none: a clock goes on behind it."""
        with self._lock:
            paths = self._paths()
            if not paths:
                return 0
            with read_record_file(paths[-1]) as file:
                return RunRecord(_run_in(paths[-1]), file).newest_ns

    def answer(self, request: Request) -> Reply:
        """Entries of the run that a question names, or the runs that there are records of."""
        told = request.parameters
        try:
            since = None if "time" in told else count_of(told.get("since", "0"))
            robot_ns = count_of(told.get("time", "0"), digits=19)
        except ValueError as error:
            return Malformed(message=f"since or time: {error}")
        run_id = told.get("run")
        try:
            return self.index() if run_id is None else self.page(run_id, since, robot_ns=robot_ns)
        except OSError as error:
            why = f"the robot's record cannot be read: {error.strerror}"
            return Rejected(reason="storage", messages=(why,)) if run_id is None else _nothing(run_id, why)

    def page(self, run_id: str, since: int | None = 0, *, robot_ns: int = 0) -> RecordPage:
        """The entries of a run above a number, or of what is later than a time."""
        with self._lock:
            if self._is_of(run_id) and self._run is not None:
                return _page(self._run, since, robot_ns)
        with self._past_lock:
            path = next((path for path in self._paths() if _run_in(path) == file_name(run_id)), None)
            if path is None:
                return RecordPage(run_id=run_id, since=0, entries=(), newest=0)
            if path.suffix == GONE:
                return _nothing(run_id, RETIRED)
            return _page(self._past(run_id, path), since, robot_ns)

    def _past(self, run_id: str, path: Path) -> RunRecord:
        """The record of another run, which stays open for its next page unless it grows meanwhile."""
        size = path.stat().st_size
        if self._read is None or (self._read.run_id, self._read_size) != (run_id, size):
            self._reading.close()
            self._read = RunRecord(run_id, self._reading.enter_context(read_record_file(path)))
            self._read_size = size
        return self._read

    def index(self) -> RecordIndex:
        """The runs that there are records of."""
        with self._lock:
            run = self._run
        with self._past_lock:
            return RecordIndex(runs=tuple(self._kept(path, run) for path in self._paths()))

    def _kept(self, path: Path, run: RunRecord | None) -> RunKept:
        run_id, size = _run_in(path), path.stat().st_size
        if run is not None and file_name(run.run_id) == run_id:
            return RunKept(run_id=run.run_id, entries=run.file.newest, bytes=size, retired=False)
        if self._counted.get(path, (-1, 0))[0] != size:
            with read_record_file(path) as file:
                self._counted[path] = size, file.newest
        return RunKept(run_id=run_id, entries=self._counted[path][1], bytes=size, retired=path.suffix == GONE)

    def _is_of(self, run_id: str) -> bool:
        return self._run is not None and self._run.run_id == run_id

    def _of(self, run_id: str) -> RunRecord:
        """The run's own, opened; the one before is over then."""
        if self._run is not None and self._run.run_id == run_id:
            return self._run
        self._end_run()
        paths = self._paths()
        number = int(paths[-1].name.partition("-")[0]) + 1 if paths else 1
        fresh = self._folder / f"{number:06}-{file_name(run_id)}{KEPT}"
        path = next((path for path in paths if _run_in(path) == file_name(run_id)), fresh)
        self._older = {older: older.stat().st_size for older in paths if older != path}
        self._run = RunRecord(run_id, self._open.enter_context(open_record_file(path)))
        return self._run

    def _shortage(self, size: int) -> str:
        """Why so many bytes find no room; the oldest runs make it, up to the limit of the record."""
        short = self._room(size)
        if short:
            return f"no room on the robot's disk: {short}"
        mine = 0 if self._run is None else self._run.file.size
        for path in tuple(self._older):
            if mine + sum(self._older.values()) + size <= self._limit_bytes:
                break
            if path.suffix == KEPT:
                self._retire(path)
        for path in tuple(self._older)[:-MOST_RUNS]:
            path.unlink(missing_ok=True)
            del self._older[path]
        if mine + size > self._limit_bytes:
            return f"the record of this run has reached the limit of {self._limit_bytes / 1e6:g} MB"
        return ""

    def _retire(self, path: Path) -> None:
        """Keep no more of a run than that it was."""
        with path.open("wb"):
            gone = path.with_suffix(GONE)
        path.rename(gone)
        older = {gone if one == path else one: size for one, size in self._older.items()}
        self._older = {**older, gone: 0}

    def _paths(self) -> list[Path]:
        """The files, oldest run first."""
        return sorted(path for path in self._folder.iterdir() if _NAME.fullmatch(path.name))


def _run_in(path: Path) -> str:
    """The run whose record a file is."""
    return path.stem.partition("-")[2]


def _nothing(run_id: str, why: str) -> RecordPage:
    gone = PosesMissing(run_id=run_id, robot_ns=0, until_ns=0, mission_time_s=0.0, reason=why)
    return RecordPage(run_id=run_id, since=0, entries=(), newest=0, missing=(gone,))


def _page(run: RunRecord, since: int | None, robot_ns: int) -> RecordPage:
    return run.page(run.before(robot_ns) if since is None else since)
