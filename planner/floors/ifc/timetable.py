"""A separate schedule of the model: a CSV of GlobalIds with the start and the finish of their tasks."""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import bytes_of, rows_of
from stopgo.planner.floors.ifc.model import Task
from stopgo.planner.floors.legible_text import legible

KNOWN = {
    "guid": ("guid", "globalid", "global id", "ifcguid", "ifc guid", "element guid", "id"),
    "task": ("taskname", "task name", "task", "activity", "activity name", "name", "taskid"),
    "start": ("actualstart", "actual start", "taskstart", "task start", "start", "start date", "startdate"),
    "finish": (
        *("actualfinish", "actual finish", "taskfinish", "task finish", "finish", "finish date"),
        *("finishdate", "end", "end date", "enddate", "completion"),
    ),
}
"""Known column names for the GlobalId, a task's name and its days; the first match counts."""
PARTS = re.compile(r"(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})(?:[ T].*)?")


@dataclass(frozen=True)
class Timetable:
    """Tasks of each GlobalId, and the sha256 of the file they are from."""

    tasks: Mapping[str, tuple[Task, ...]]
    digest: str


def read_timetable(path: Path, columns: Mapping[str, str]) -> Timetable:
    """The tasks in a CSV; `columns` says which column is guid, task, start and finish, where it is not plain.

    Raises
    ------
    InputError
        Naming the file, the line and the column that cannot be used.
    """
    data = bytes_of(path, "give the schedule's CSV")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    rows = rows_of(text, str(path))
    if not rows:
        raise InputError(f"{path}: is empty; give a CSV of GlobalIds with start and finish")
    where = _columns(rows[0][1], columns, path)
    return Timetable(_tasks(rows, where, path), hashlib.sha256(data).hexdigest())


def _columns(header: Sequence[str], given: Mapping[str, str], path: Path) -> dict[str, int]:
    names = [name.strip().casefold() for name in header]
    found: dict[str, int] = {}
    for what, known in KNOWN.items():
        wanted = (given[what].strip().casefold(),) if what in given else known
        at = next((names.index(name) for name in wanted if name in names), None)
        if at is not None:
            found[what] = at
        elif what in given or what == "guid":
            raise _no_column(what, header, path)
    if "start" not in found and "finish" not in found:
        raise _no_column("finish", header, path)
    return found


def _no_column(what: str, header: Sequence[str], path: Path) -> InputError:
    names = legible(", ".join(header), most=300)
    return InputError(
        f"{path}: no column for the {what}; say which with --schedule-column {what}=NAME ({names})"
    )


def _tasks(
    rows: Sequence[tuple[int, list[str]]], where: Mapping[str, int], path: Path
) -> dict[str, tuple[Task, ...]]:
    """Tasks by GlobalId; rows without one are left out."""

    def cell(row: Sequence[str], what: str) -> str:
        return row[where[what]].strip() if what in where and where[what] < len(row) else ""

    used = [(line, row) for line, row in rows[1:] if cell(row, "guid")]
    if not used:
        raise InputError(
            f"{path}: no row has a GlobalId; say which column it is: --schedule-column guid=NAME"
        )
    day_first = _day_first((cell(row, key) for _, row in used for key in ("start", "finish")), path)
    found: dict[str, list[Task]] = defaultdict(list)
    for line, row in used:
        start, finish = (
            _day(cell(row, key), day_first, f"{path}: line {line}: {key}") for key in ("start", "finish")
        )
        if start or finish:
            found[cell(row, "guid")].append(Task(cell(row, "task"), start, finish, source=path.name))
    return {guid: tuple(tasks) for guid, tasks in found.items()}


def _day_first(cells: Iterable[str], path: Path) -> bool:
    """True if days are written before months: shown by days over 12, else by the separator."""
    written = [match for cell in cells if (match := PARTS.fullmatch(cell)) and len(match[1]) < 3]
    if any(int(match[1]) > 12 for match in written):
        return True
    if any(int(match[3]) > 12 for match in written):
        return False
    if any(match[2] == "/" and match[1] != match[3] for match in written):
        raise InputError(f"{path}: '{written[0][0]}' may be day/month or month/day; write days as YYYY-MM-DD")
    return True


def _day(text: str, day_first: bool, what: str) -> str | None:
    """A day as YYYY-MM-DD; None for an empty cell."""
    if not text:
        return None
    match = PARTS.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        first, second, third = int(match[1]), int(match[3]), int(match[4])
        if len(match[1]) == 4:
            return date(first, second, third).isoformat()
        year = third if third > 99 else 2000 + third
        return (date(year, second, first) if day_first else date(year, first, second)).isoformat()
    except ValueError:
        raise InputError(f"{what} = '{legible(text)}' is no day; write days as YYYY-MM-DD") from None
