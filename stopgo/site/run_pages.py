"""Looking back: missions of the folder with their runs, reports, recordings for the viewer, and downloads."""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import file_name
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.files.mission_json import read
from stopgo.recordings.catalog.run_index import (
    IndexedFile,
    RunIndex,
    Version,
    index_by_parts,
    index_of,
    run_cells,
    stamp_of,
)
from stopgo.recordings.page import report_html
from stopgo.site.planning import WorkLane
from stopgo.site.planning_work import CommandTask
from stopgo.site.site_folder import SiteFiles

if TYPE_CHECKING:
    from stopgo.recordings.page.reviewed import Review

T = TypeVar("T")
MergedFiles = tuple[tuple[str, int, int], ...]
"""Files, with the size and the last change of each."""
SECRET_S = 600.0
"""Time in which a recording's address for the viewer is valid."""
DOWNLOADS = {
    "json": ("mission.json", "application/json"),
    "pdf": ("plan.pdf", "application/pdf"),
    "svg": ("plan.svg", "image/svg+xml"),
}
"""Downloads that lie beside the mission: file and content type."""
EXPORTS = {"dxf": "image/vnd.dxf", "csv": "text/csv"}
"""Downloads that are made on request."""


@dataclass(frozen=True)
class PageDownload:
    """A file for the browser."""

    name: str
    kind: str
    body: bytes


class RunRoom:
    """Missions and runs of a folder; everything is read on request."""

    def __init__(self, folder: SiteFiles, merged: Path, lane: WorkLane) -> None:
        self._folder = folder
        self._merged_folder = merged
        self._lane = lane
        self._one_at_a_time = threading.Lock()
        self._known: dict[str, IndexedFile] = {}
        """State of the files of a folder that takes no index."""
        self._announced: set[Version] = set()
        """Versions of files whose plans have come."""
        self._merged: dict[str, MergedFiles] = {}
        self._secrets: dict[str, tuple[str, float]] = {}

    def listed(self) -> dict[str, Any]:
        """Return the missions with plans and runs, the newest run's first, and the recordings left to read.

        Each call reads a part of those that are new or changed, so that a large folder shows its progress.
        """
        with self._one_at_a_time:
            index, left = self._next_part()
            if _has_gone(self._folder.root, index):
                index, left = self._next_part()
        return {"missions": self._missions(index), "faults": index.faults(), "left": left}

    def _next_part(self) -> tuple[RunIndex, int]:
        parts = index_by_parts(self._folder.root, kept=self._known, announced=self._announced)
        return next(parts)

    def _missions(self, whole: RunIndex) -> list[dict[str, Any]]:
        index = without_repeats(whole)
        plans = {plan.mission_id: (name, plan) for name, plan in index.plans()}
        missions = []
        for mission_id in files_of(index):
            runs = [(name, run) for name, run in index.runs() if run.mission_id == mission_id]
            file, plan = plans.get(mission_id, (None, None))
            beside = None if file is None else str(Path(file).with_name("mission.json"))
            has_file = beside is not None and (self._folder.root / beside).is_file()
            missions.append({
                "name": plan.name if plan is not None else runs[0][1].name,
                "key": name_of(mission_id), "id": mission_id, "file": beside if has_file else None,
                "stops": None if plan is None else plan.stops,
                "coverage": None if plan is None else plan.coverage,
                "runs": [{"file": name, "answer": run.answer, **run_cells(run)} for name, run in runs],
            })  # fmt: skip
        return missions

    def report(self, key: str) -> bytes:
        """Return the report of a mission's plan and runs together, as one page."""
        from stopgo.recordings.page.from_recordings import subject_of

        with self._one_at_a_time:
            return report_html(subject_of(self._read(key, _reviewed)))

    def open_recording(self, key: str) -> str:
        """Return the secret name under which a mission's recording can be read for some minutes."""
        self.recording(key)
        secret = secrets.token_urlsafe(24)
        now = time.monotonic()
        self._secrets = {name: one for name, one in self._secrets.items() if one[1] > now}
        self._secrets[secret] = (key, now + SECRET_S)
        return secret

    def recording_of_secret(self, secret: str) -> bytes:
        """Return the recording of a secret name; raises `InputError` if it is none, or too old."""
        key, until = self._secrets.get(secret, ("", 0.0))
        if until <= time.monotonic():
            raise InputError("this recording's address is too old; open it again from the page")
        return self.recording(key).read_bytes()

    def recording(self, key: str) -> Path:
        """Return a mission's plan and runs as one recording; merged again if a file has changed."""
        from stopgo.recordings.catalog.merging import layout_of, merge

        out = self._merged_folder / f"{key}.rrd"

        def read(paths: list[Path]) -> None:
            stamps = tuple((str(path), *stamp_of(path)) for path in paths)
            if self._merged.get(key) != stamps:
                read_ones = [item.recording for item in _reviewed(paths).recordings]
                merge(read_ones, out)
                write_atomic(out, layout_of(read_ones) + out.read_bytes())
                self._merged[key] = stamps

        with self._one_at_a_time:
            self._read(key, read)
        return out

    def download(self, name: str, form: str) -> PageDownload:
        """Return a mission of the folder in a form; raises `InputError` if it cannot be had."""
        path = self._folder.file(name)
        mission = read(path)
        plain = file_name(f"{mission.name}-r{mission.revision}")
        if form in DOWNLOADS:
            file, kind = DOWNLOADS[form]
            beside = path if form == "json" else path.with_name(file)
            if not beside.is_file():
                raise InputError(f"{name}: has no {file}; plan it on this page, or with --sheets")
            return PageDownload(f"{plain}.{form}", kind, beside.read_bytes())
        if form not in EXPORTS:
            raise InputError(f"{form[:20]}: no such form; known: {', '.join((*DOWNLOADS, *EXPORTS))}")
        out = self._merged_folder / f"{secrets.token_hex(8)}.{form}"
        floor = self._floor_of(mission) if form == "dxf" else None
        self._run(["export", str(path), *(["--floor", str(floor)] if floor else []), "-o", str(out)])
        body = out.read_bytes()
        out.unlink()
        return PageDownload(f"{plain}.{form}", EXPORTS[form], body)

    def follow_up(self, key: str) -> dict[str, Any]:
        """Plan one mission for what the runs of a mission left out, and return its file.

        Raises
        ------
        InputError
            If the folder has no floor or no mission file of it.
        NegativeResult
            If nothing is left, or it is not known what is.
        """
        with self._one_at_a_time:
            index = self._index()
        listed = next((one for one in self._missions(index) if one["key"] == key), None)
        if listed is None or listed["file"] is None:
            raise InputError("the folder has no mission.json next to the plan of these runs")
        path = self._folder.file(listed["file"])
        mission = read(path)
        floor = self._floor_of(mission)
        if floor is None:
            raise InputError(f"the folder has no floor {mission.origin.floor} as this mission was planned on")
        out = path.parent / "follow-up" / "mission.json"
        out.parent.mkdir(exist_ok=True)
        runs = [str(self._folder.root / run["file"]) for run in listed["runs"]]
        log = self._run(
            ["replay", *runs, "--mission", str(path), "--floor", str(floor), "--top-up", str(out)]
        )
        lines = (line.partition(" not written: ")[2] for line in log.splitlines())
        reasons = [line for line in lines if line]
        if reasons or not out.is_file():
            raise NegativeResult(f"no follow-up mission was planned: {'; '.join(reasons) or 'no file'}")
        made = read(out)
        return {"file": self._folder.name_of(out), "stops": len(made.stops)}

    def _run(self, arguments: list[str]) -> str:
        """Run a command in a process, and return what it reported; no and undecided are answers, too."""
        answer = self._lane.answer(CommandTask(arguments))
        lines = answer["log"].strip().splitlines()
        if answer["code"] not in (0, 1, 3):
            raise InputError((lines or ["the command failed"])[-1].removeprefix("stopgo: "))
        return "\n".join(lines)

    def _floor_of(self, mission: Mission) -> Path | None:
        """Return the file of the folder that a mission was planned on, by its digest."""
        for name in self._folder.floors():
            path = self._folder.root / name
            try:
                if file_digest(path) == mission.origin.floor_digest:
                    return path
            except OSError:
                continue
        return None

    def _index(self) -> RunIndex:
        index = index_of(self._folder.root)
        return index_of(self._folder.root) if _has_gone(self._folder.root, index) else index

    def _read(self, key: str, read: Callable[[list[Path]], T]) -> T:
        """Read a mission's files, once more if one was renamed meanwhile, as at the end of a run."""
        paths = self._paths(key)
        try:
            return read(paths)
        except (InputError, OSError):
            if all(path.exists() for path in paths):
                raise
        return read(self._paths(key))

    def _paths(self, key: str) -> list[Path]:
        return [self._folder.root / name for name in self._files(key)]

    def _files(self, key: str) -> list[str]:
        found = files_of(without_repeats(self._index()))
        files = next((files for mission, files in found.items() if name_of(mission) == key), None)
        if files is None:
            raise InputError("no such mission in the folder any more")
        return files


def _reviewed(paths: list[Path]) -> Review:
    """Return the review of files; raises `InputError` if one cannot be read: a run would be left out."""
    from stopgo.recordings.page.reviewed import review

    found = review(paths)
    if found.faults:
        raise InputError("; ".join(found.faults))
    return found


def _has_gone(root: Path, index: RunIndex) -> bool:
    """Return True if a file was renamed while the folder was read, as at the end of a run."""
    return any(file.fault and not (root / name).exists() for name, file in index.files.items())


def without_repeats(index: RunIndex) -> RunIndex:
    """Return the index without files whose runs are in another file too, at least as far.

    A site that was killed leaves what it had recorded; started again, it records the run from its beginning.
    """
    best: dict[tuple[str, str], tuple[int, str]] = {}
    for name, run in index.runs():
        key = (run.robot, run.run_id)
        best[key] = max(best.get(key, (-1, "")), (run.scanned + 1000 * (run.ended is not None), name))
    kept = {name for _, name in best.values()}
    files = {name: file for name, file in index.files.items() if not file.runs or name in kept}
    return RunIndex(index.version, files)


def name_of(mission_id: str) -> str:
    """Return the name of a mission's pages: its id may be any text."""
    return hashlib.sha256(mission_id.encode()).hexdigest()[:32]


def files_of(index: RunIndex) -> dict[str, list[str]]:
    """Return the recordings of each mission, the newest run's mission first; plans before runs."""
    found: dict[str, list[str]] = {run.mission_id: [] for _, run in index.runs()}
    for name, plan in index.plans():
        found.setdefault(plan.mission_id, []).append(name)
    for name, run in index.runs():
        if name not in found[run.mission_id]:
            found[run.mission_id].append(name)
    return found
