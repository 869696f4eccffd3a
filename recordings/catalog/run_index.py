"""Index of a folder of recordings: plans and runs; files that changed are read again."""

from __future__ import annotations

import datetime
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from stopgo.mission.comparing.run_verdict import judge
from stopgo.mission.console.table import duration, table
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import legible_name
from stopgo.mission.stages.figures import percent

if TYPE_CHECKING:
    from stopgo.mission.comparing.comparison import Comparison
    from stopgo.mission.document import Mission
    from stopgo.recordings.embedded.reading import Recording
    from stopgo.recordings.page.reviewed import RecordingReview

INDEX = ".stopgo-runs.json"
VERSION = 3
"""Version of the index; an index of another version is rebuilt."""
SUFFIX = ".rrd"
PART = 25
"""Files that are read before the index is written again."""
_one_reader = threading.Lock()
"""Held while a part is read, so that threads that want the same index share the work."""


class IndexedPlan(msgspec.Struct, frozen=True, kw_only=True):
    """Plan in a recording."""

    mission_id: str
    revision: int
    name: str
    stops: int
    coverage: float | None


class IndexedRun(msgspec.Struct, frozen=True, kw_only=True):
    """Run in a recording."""

    mission_id: str
    name: str
    revisions: tuple[int, ...]
    run_id: str
    robot: str
    began_ns: int
    driven_s: float | None
    ended: str | None
    scanned: int
    asked: int
    deviation_m: float | None
    coverage: float | None
    answer: str


class IndexedFile(msgspec.Struct, frozen=True, kw_only=True):
    """State of a file when it was read."""

    size: int
    changed_ns: int
    fault: str | None = None
    plans: tuple[IndexedPlan, ...] = ()
    runs: tuple[IndexedRun, ...] = ()


class RunIndex(msgspec.Struct, frozen=True):
    """Recordings of a folder, by their path relative to it."""

    version: int
    files: dict[str, IndexedFile]

    def runs(self) -> list[tuple[str, IndexedRun]]:
        """Return every run and its file, the newest first."""
        found = [(name, run) for name, file in self.files.items() for run in file.runs]
        return sorted(found, key=lambda pair: (-pair[1].began_ns, pair[0]))

    def plans(self) -> list[tuple[str, IndexedPlan]]:
        """Return every plan and its file, by name and revision."""
        found = [(name, plan) for name, file in self.files.items() for plan in file.plans]
        return sorted(found, key=lambda pair: (pair[1].name, pair[1].revision, pair[0]))

    def faults(self) -> list[str]:
        return [file.fault for _, file in sorted(self.files.items()) if file.fault]


def index_of(folder: Path, *, say: Callable[[str], None] = lambda line: None) -> RunIndex:
    """Return the index of a folder and its subfolders; new and changed files are read.

    Raises
    ------
    InputError
        When there is no such folder.
    """
    index = RunIndex(VERSION, {})
    for known, left in index_by_parts(folder, say=say):
        index = known
        if left:
            say(f"{folder}: {left} left")
    return index


def index_by_parts(
    folder: Path,
    *,
    kept: dict[str, IndexedFile] | None = None,
    announced: set[Version] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Iterator[tuple[RunIndex, int]]:
    """Yield the index after each part of the files that must be read, and the number of those left.

    A run is compared with its plan, so it is read again after a plan of its mission has come or gone. `kept`
    holds what is known of a folder in which no index can be written. `announced` holds the versions of files
    whose plans have come, for a reader of one part after the other.

    Raises
    ------
    InputError
        When there is no such folder.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder; give a folder of recordings")
    announced = set() if announced is None else announced
    kept = {} if kept is None else kept
    left = -1
    while left:
        with _one_reader:
            index, left = _next_part(folder, announced, kept, say)
        yield index, left


def _next_part(
    folder: Path, announced: set[Version], kept: dict[str, IndexedFile], say: Callable[[str], None]
) -> tuple[RunIndex, int]:
    """Read the next files, and return the index and the number of those left.

    `announced` are versions of files whose plans are known to the runs of their missions; those read are
    added. So each is announced once, and files with a plan and a run do not have each other read for ever.
    """
    known, stamps = kept or _known(folder / INDEX), dict(sorted(_stamps(folder)))
    files = {name: known[name] for name, stamp in stamps.items() if _is_unchanged(known.get(name), stamp)}
    gone = _planned(file for name, file in known.items() if name not in files)
    files = {name: file for name, file in files.items() if not _has_run_of(file, gone)}
    stale = sorted(stamps.keys() - files.keys(), key=lambda name: (stamps[name][1], name))  # plans are older
    if stale and not announced:
        say(f"{folder}: reading {len(stale)} of {len(stamps)} recordings")
    part = stale[:PART]
    files |= _read(folder, {name: stamps[name] for name in part}, files) if part else {}
    come = _planned(files[name] for name in part if (name, stamps[name]) not in announced)
    announced.update((name, stamps[name]) for name in part)
    outdated = {name for name in files if name not in part and _has_run_of(files[name], come)}
    files = {name: files[name] for name in sorted(files.keys() - outdated)}
    if part or len(files) != len(known):
        kept.clear()
        kept.update({} if _is_written(folder, files, say) else files)
    return RunIndex(VERSION, files), len(stale) - len(part) + len(outdated)


def _planned(files: Iterable[IndexedFile]) -> dict[str, int]:
    """Return the ids of missions that these files have plans of, each with the least revision."""
    plans = sorted((plan for file in files for plan in file.plans), key=lambda plan: -plan.revision)
    return {plan.mission_id: plan.revision for plan in plans}


def _has_run_of(file: IndexedFile, plans: Mapping[str, int]) -> bool:
    """Return True if a run followed one of these revisions or a later one: what its stops see is compared."""
    return any(
        run.mission_id in plans and plans[run.mission_id] <= max(run.revisions, default=0)
        for run in file.runs
    )


def _is_written(folder: Path, files: dict[str, IndexedFile], say: Callable[[str], None]) -> bool:
    """Write the index; False if the folder takes none, and the files are read again next time."""
    try:
        write_atomic(folder / INDEX, msgspec.json.encode(RunIndex(VERSION, files)))
    except InputError as error:
        say(str(error))
        return False
    return True


def _known(path: Path) -> dict[str, IndexedFile]:
    """Return the entries of the index; none if it is missing, damaged or of another version."""
    try:
        index = decoded(path.read_bytes(), RunIndex)
    except (OSError, msgspec.DecodeError):
        return {}
    return index.files if index.version == VERSION else {}


Stamp = tuple[int, int]
"""File size, and time of the last change in nanoseconds."""
Version = tuple[str, Stamp]
"""Name and stamp of a file."""


def _stamps(folder: Path) -> Iterator[tuple[str, Stamp]]:
    """Yield every recording below a folder; files of other types, and what is hidden, are ignored.

    A link to nothing and a pipe that are named as recordings are yielded, too, and so is a name that is no
    text: reading them gives the reason.
    The store of a batch is hidden: it holds each plan of the folder once more.
    """
    for folder_path, below, names in os.walk(folder):
        below[:] = [name for name in below if not name.startswith(".")]
        for name in names:
            path = Path(folder_path, name)
            if name.endswith(SUFFIX) and not name.startswith("."):
                try:
                    stamp = stamp_of(path)
                except FileNotFoundError:  # removed since it was listed
                    continue
                yield legible_name(str(path.relative_to(folder))), stamp


def stamp_of(path: Path) -> Stamp:
    """Return the stamp of a file, or of a link to nothing."""
    state = path.stat() if path.exists() else path.lstat()
    return state.st_size, state.st_mtime_ns


def _is_unchanged(file: IndexedFile | None, stamp: Stamp) -> bool:
    return file is not None and (file.size, file.changed_ns) == stamp


def _read(folder: Path, stale: dict[str, Stamp], others: dict[str, IndexedFile]) -> dict[str, IndexedFile]:
    """Read files, and compare their runs also with the plans in other files."""
    from stopgo.recordings.page.reviewed import reviewed

    read, faults = _opened(folder, sorted(stale))
    missions = {recording.mission_id for recording in read.values() if recording.logs}
    plans = [
        name for name, file in others.items() if name not in stale and missions & _planned([file]).keys()
    ]
    found = reviewed([*read.values(), *_opened(folder, plans)[0].values()])
    by_name = dict(zip(read, found.recordings, strict=False))
    return {
        name: _file(by_name[name], stamp) if name in by_name else _faulty(stamp, faults[name])
        for name, stamp in stale.items()
    }


def _opened(folder: Path, names: Iterable[str]) -> tuple[dict[str, Recording], dict[str, str]]:
    """Return recordings by name without their drawings, and the errors of unreadable files."""
    from stopgo.recordings.embedded.reading import read_each
    from stopgo.recordings.embedded.values import Values

    read: dict[str, Recording] = {}
    faults: dict[str, str] = {}
    wanted = list(names)
    for name, (_, found) in zip(wanted, read_each([folder / name for name in wanted]), strict=True):
        if isinstance(found, InputError):
            faults[name] = str(found)
        else:
            read[name] = replace(found, values=Values())
    return read, faults


def _faulty(stamp: Stamp, fault: str) -> IndexedFile:
    return IndexedFile(size=stamp[0], changed_ns=stamp[1], fault=fault)


def _file(item: RecordingReview, stamp: Stamp) -> IndexedFile:
    missions = item.recording.missions
    plans = () if item.plan is None or not missions else (_plan(item, missions[-1]),)
    runs = tuple(_run(comparison) for comparison in item.comparisons)
    return IndexedFile(size=stamp[0], changed_ns=stamp[1], plans=plans, runs=runs)


def _plan(item: RecordingReview, mission: Mission) -> IndexedPlan:
    coverage = (item.plan or {}).get("coverage")
    return IndexedPlan(
        mission_id=mission.id,
        revision=mission.revision,
        name=mission.name,
        stops=len(mission.stops),
        coverage=None if coverage is None else float(coverage),
    )


def _run(comparison: Comparison) -> IndexedRun:

    log, acquired = comparison.log, comparison.acquired
    return IndexedRun(
        mission_id=comparison.mission.id,
        name=comparison.mission.name,
        revisions=tuple(mission.revision for mission in comparison.missions),
        run_id=log.run_id or "",
        robot=log.robot,
        began_ns=log.began_ns or 0,
        driven_s=comparison.driven_s,
        ended=type(log.events[-1]).__name__ if log.ended else None,
        scanned=comparison.scanned,
        asked=len(comparison.asked),
        deviation_m=comparison.greatest_deviation_m,
        coverage=None if acquired is None else acquired.coverage.whole.coverage,
        answer=judge(comparison).answer,
    )


def index_text(index: RunIndex) -> str:
    """Return runs, the newest first, and plans, as tables."""
    runs = [{**run_cells(run), "file": name} for name, run in index.runs()]
    plans = [
        (plan.name, plan.mission_id[:12], str(plan.revision), str(plan.stops), percent(plan.coverage), name)
        for name, plan in index.plans()
    ]
    lines = [table(tuple(runs[0]), [tuple(run.values()) for run in runs])] if runs else ["no runs"]
    if plans:
        lines += ["", table(("plan", "mission id", "revision", "stops", "coverage", "file"), plans)]
    return "\n".join(lines)


def run_cells(run: IndexedRun) -> dict[str, str]:
    """Return the cells of a run in a table, by column."""
    moment = datetime.datetime.fromtimestamp(run.began_ns / 1e9, tz=datetime.UTC)
    return {
        "began (UTC)": f"{moment:%Y-%m-%d %H:%M}",
        "mission": run.name,
        "revision": " ".join(map(str, run.revisions)),
        "run": run.run_id,
        "robot": run.robot,
        "ended": run.ended or "not ended",
        "took": "-" if run.driven_s is None else duration(run.driven_s),
        "stops": f"{run.scanned}/{run.asked}",
        "worst mm": "-" if run.deviation_m is None else f"{1000 * run.deviation_m:.1f}",
        "coverage": percent(run.coverage),
        "acquired": run.answer,
    }


def index_json(index: RunIndex) -> dict[str, Any]:
    """Return the index for programs."""
    return {
        "runs": [{"file": name, **msgspec.to_builtins(run)} for name, run in index.runs()],
        "plans": [{"file": name, **msgspec.to_builtins(plan)} for name, plan in index.plans()],
        "faults": index.faults(),
    }
