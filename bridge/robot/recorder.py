"""Recorder of poses, states and health of each run, for stations that were disconnected meanwhile.

The records are not in the journal: poses come many times a second, and a record may be deleted where an
event may not. Each run has its own file. Whatever is not in it is reported as missing, with the reason.
"""

from __future__ import annotations

import re
import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Malformed, RecordIndex, RecordPage, Rejected, Reply, RunKept, count_of
from stopgo.bridge.record_file import open_record_file, read_record_file
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.robot.run_record import RunRecord
from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import file_name
from stopgo.mission.run.events import Health, PoseReport, PosesMissing, StateReport, reported_charge

ENTRY_S = 0.5
"""Interval of entries. A killed robot loses at most this, and the time of one write."""
LIMIT_BYTES = 512_000_000
"""About two hundred hours of runs."""
MAX_RUNS = 1000
"""Runs whose names are stored; older ones are deleted entirely."""
MOST_ARRIVED = 50_000
"""Poses and states that wait for the disk: over half an hour at 20 poses a second; older ones are dropped."""
RETIRED = "let go for want of room, as the oldest run that was over"
RECORD_SUFFIX, RETIRED_SUFFIX = ".record", ".retired"
_NAME = re.compile(r"[0-9]+-.*\.(record|retired)", re.ASCII)


class RunRecorder:
    """The records of one robot's runs; every method may be called from any thread.

    `room` returns why a number of bytes is too much for the disk; empty if it is not.
    """

    def __init__(
        self,
        folder: Path,
        *,
        room: Callable[[int], str] = lambda size: "",
        limit_bytes: int = LIMIT_BYTES,
    ) -> None:
        self.health: Callable[[], BaseHealth] = BaseHealth
        """Returns the base's health."""
        self._folder = folder
        self._room = room
        self._limit_bytes = limit_bytes
        self._lock = threading.RLock()
        self._open = ExitStack()
        self._run: RunRecord | None = None
        self._past_lock = threading.Lock()
        """Guards the reading of other runs, which takes long; the robot's own threads never wait for it."""
        self._reading = ExitStack()
        self._read: RunRecord | None = None
        self._read_size = 0
        self._counted: dict[Path, tuple[int, int]] = {}
        """Size and entries of files of other runs."""
        self._older: dict[Path, int] = {}
        """Files of other runs, oldest first, and their sizes."""
        self._arrived: deque[Callable[[], None]] = deque(maxlen=MOST_ARRIVED)
        """Poses and states that were added while the disk was busy."""
        self._idle = False
        """True if there was no run for a time, so that the next one is recorded from its begin."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be used for the record ({error.strerror})") from None

    def close(self) -> None:
        """Write what is pending, and close the files."""
        with self._lock:
            self._take_in()
            self._end_run()
        with self._past_lock:
            self._read = None
            self._reading.close()

    def _end_run(self) -> None:
        with self._lock:
            self._write()
            self._run = None
            self._open.close()

    def idle(self) -> None:
        """Note that there is no run, so that the next one is recorded from its begin."""
        self._idle = True

    def pose(self, report: PoseReport, *, began_ns: int, over: bool) -> None:
        """Add a pose of a run; of a run that is `over` only the first. It does not wait for the disk."""
        self._arrived.append(partial(self._take_pose, report, began_ns, over))

    def state(self, report: StateReport) -> None:
        """Add a state of the run that is recorded. It does not wait for the disk."""
        self._arrived.append(partial(self._take_state, report))

    def _take_in(self) -> None:
        """Take in what was added; whoever calls this has the lock."""
        while self._arrived:
            self._arrived.popleft()()

    def _take_pose(self, report: PoseReport, began_ns: int, over: bool) -> None:
        if report.run_id is None or (over and not self._is_of(report.run_id)):
            self._idle = True
            return
        with suppress(OSError):  # without the folder, or with a full disk, it is missing
            run = self._of(report.run_id)
            run.pose(report, began_ns=began_ns, over=over, seen=self._idle)
        self._idle = self._idle or over

    def _take_state(self, report: StateReport) -> None:
        if self._run is not None and report.run_id == self._run.run_id:
            self._run.state(report)

    def look(self, *, battery: float | None, robot_ns: int) -> Health | None:
        """Add the base's health, and return it if it has changed."""
        base = self.health()
        with self._lock:
            self._take_in()
            if self._run is None:
                return None
            health = Health(
                robot_ns=robot_ns, run_id=self._run.run_id, battery=reported_charge(battery),
                localisation=base.localisation, emergency_stop=base.emergency_stop,
                safety_field=base.safety_field,
            )  # fmt: skip
            return health if self._run.health(health) else None

    def write(self) -> None:
        """Write an entry with what was added; without disk space it is reported as missing."""
        with self._lock:
            self._take_in()
            self._write()

    def _write(self) -> None:
        if self._run is not None:
            self._run.write(self._shortage)

    @property
    def newest_ns(self) -> int:
        """Time of the newest pose in all records, 0 if there is none; clocks continue after it."""
        with self._lock:
            paths = self._paths()
            if not paths:
                return 0
            with read_record_file(paths[-1]) as file:
                return RunRecord(_run_in(paths[-1]), file).newest_ns

    def answer(self, request: Request) -> Reply:
        """Return the entries of the run that a request names, or the list of recorded runs."""
        parameters = request.parameters
        try:
            since = None if "time" in parameters else count_of(parameters.get("since", "0"))
            robot_ns = count_of(parameters.get("time", "0"), digits=19)
        except ValueError as error:
            return Malformed(message=f"since or time: {error}")
        run_id = parameters.get("run")
        try:
            return self.index() if run_id is None else self.page(run_id, since, robot_ns=robot_ns)
        except OSError as error:
            why = f"the robot's record cannot be read: {error.strerror}"
            return Rejected(reason="storage", messages=(why,)) if run_id is None else _nothing(run_id, why)

    def page(self, run_id: str, since: int | None = 0, *, robot_ns: int = 0) -> RecordPage:
        """Return the entries of a run above a number, or after a time."""
        with self._lock:
            self._take_in()
            if self._is_of(run_id) and self._run is not None:
                return _page(self._run, since, robot_ns)
        with self._past_lock:
            path = next((path for path in self._paths() if _run_in(path) == file_name(run_id)), None)
            if path is None:
                return RecordPage(run_id=run_id, since=0, entries=(), newest=0)
            if path.suffix == RETIRED_SUFFIX:
                return _nothing(run_id, RETIRED)
            return _page(self._past(run_id, path), since, robot_ns)

    def _past(self, run_id: str, path: Path) -> RunRecord:
        """Return the record of another run; it stays open for its next page unless it grows."""
        size = path.stat().st_size
        if self._read is None or (self._read.run_id, self._read_size) != (run_id, size):
            self._reading.close()
            self._read = RunRecord(run_id, self._reading.enter_context(read_record_file(path)))
            self._read_size = size
        return self._read

    def index(self) -> RecordIndex:
        """Return the list of recorded runs."""
        with self._lock:
            self._take_in()
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
        return RunKept(
            run_id=run_id, entries=self._counted[path][1], bytes=size, retired=path.suffix == RETIRED_SUFFIX
        )

    def _is_of(self, run_id: str) -> bool:
        return self._run is not None and self._run.run_id == run_id

    def _of(self, run_id: str) -> RunRecord:
        """Return the record of a run, opened; the record of the run before is closed."""
        if self._run is not None and self._run.run_id == run_id:
            return self._run
        self._end_run()
        paths = self._paths()
        number = int(paths[-1].name.partition("-")[0]) + 1 if paths else 1
        fresh = self._folder / f"{number:06}-{file_name(run_id)}{RECORD_SUFFIX}"
        path = next((path for path in paths if _run_in(path) == file_name(run_id)), fresh)
        self._older = {older: older.stat().st_size for older in paths if older != path}
        self._run = RunRecord(run_id, self._open.enter_context(open_record_file(path)))
        return self._run

    def _shortage(self, size: int) -> str:
        """Return why `size` bytes cannot be written; the oldest runs are deleted to keep the limit."""
        short = self._room(size)
        if short:
            return f"no room on the robot's disk: {short}"
        mine = 0 if self._run is None else self._run.file.size
        for path in tuple(self._older):
            if mine + sum(self._older.values()) + size <= self._limit_bytes:
                break
            if path.suffix == RECORD_SUFFIX:
                self._retire(path)
        for path in tuple(self._older)[:-MAX_RUNS]:
            path.unlink(missing_ok=True)
            del self._older[path]
        if mine + size > self._limit_bytes:
            return f"the record of this run has reached the limit of {self._limit_bytes / 1e6:g} MB"
        return ""

    def _retire(self, path: Path) -> None:
        """Delete the record of a run, except its name."""
        with path.open("wb"):
            retired = path.with_suffix(RETIRED_SUFFIX)
        path.rename(retired)
        older = {retired if one == path else one: size for one, size in self._older.items()}
        self._older = {**older, retired: 0}

    def _paths(self) -> list[Path]:
        """Return the files, oldest run first."""
        return sorted(path for path in self._folder.iterdir() if _NAME.fullmatch(path.name))


def _run_in(path: Path) -> str:
    """Return the run that a file records."""
    return path.stem.partition("-")[2]


def _nothing(run_id: str, why: str) -> RecordPage:
    missing = PosesMissing(run_id=run_id, robot_ns=0, until_ns=0, mission_time_s=0.0, reason=why)
    return RecordPage(run_id=run_id, since=0, entries=(), newest=0, missing=(missing,))


def _page(run: RunRecord, since: int | None, robot_ns: int) -> RecordPage:
    return run.page(run.before(robot_ns) if since is None else since)
