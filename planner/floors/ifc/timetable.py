"""A separate schedule of the model: a CSV of GlobalIds with the start and the finish of their tasks."""

from __future__ import annotations

import hashlib
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Literal, get_args

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
DAYS = ("start", "finish")
Order = Literal["day/month/year", "month/day/year", "year/month/day"]
ORDERS: tuple[Order, ...] = get_args(Order)
"""Orders of the parts of a day without a year of four digits in front, the likeliest first."""
USUAL: Mapping[str, tuple[Order, ...]] = {
    "/": ORDERS,
    "-": ORDERS,
    ".": ("day/month/year",),
}
"""Orders that a separator leaves open, where no day of the file shows which it is."""
YEAR_FIRST = re.compile(r"(\d{4})([-./])(\d{1,2})\2(\d{1,2})(?:[ T].*)?")
YEAR_LAST = re.compile(r"(\d{1,2})([-./])(\d{1,2})\2(\d{4}|\d{1,2})(?:[ T].*)?")
"""Days whose year has four digits, or two digits at either end."""


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
    order = _order_of(((f"{path}: line {line}: {key}", cell(row, key)) for line, row in used for key in DAYS))
    found: dict[str, list[Task]] = defaultdict(list)
    for line, row in used:
        start, finish = (_day(cell(row, key), order, f"{path}: line {line}: {key}") for key in DAYS)
        if start or finish:
            found[cell(row, "guid")].append(Task(cell(row, "task"), start, finish, source=path.name))
    return {guid: tuple(tasks) for guid, tasks in found.items()}


def _order_of(cells: Iterable[tuple[str, str]]) -> Order:
    """The order in which days are written: shown by the days themselves, else by the separator.

    `cells` are the places of the texts, and the texts. A year of four digits in front needs no order.

    Raises
    ------
    InputError
        Naming the first day that can be read in two orders.
    """
    written = [(where, match) for where, cell in cells if (match := YEAR_LAST.fullmatch(cell))]
    fitting = [order for order in ORDERS if all(_read(match, order) for _, match in written)]
    for where, match in written:
        likely = [order for order in fitting if order in USUAL[match[2]]]
        if len({_read(match, order) for order in likely}) > 1:
            orders = " or ".join(order if len(match[4]) == 2 else order[: -len("/year")] for order in likely)
            raise InputError(f"{where} = '{legible(match[0])}' may be {orders}; write days as YYYY-MM-DD")
    return fitting[0] if fitting else ORDERS[0]


def _read(match: re.Match[str], order: Order) -> date | None:
    """A day whose parts are in this order; None if that is no day. Years of two digits begin with 20."""
    parts = dict(zip(order.split("/"), (match[1], match[3], match[4]), strict=True))
    year = parts["year"]
    if len(year) not in (2, 4):
        return None
    try:
        return date(int(year) + (2000 if len(year) == 2 else 0), int(parts["month"]), int(parts["day"]))
    except ValueError:
        return None


def _day(text: str, order: Order, what: str) -> str | None:
    """A day as YYYY-MM-DD; None for an empty cell."""
    if not text:
        return None
    last, first = YEAR_LAST.fullmatch(text), YEAR_FIRST.fullmatch(text)
    day = _read(last, order) if last else _read(first, "year/month/day") if first else None
    if day is None:
        raise InputError(f"{what} = '{legible(text)}' is no day; write days as YYYY-MM-DD")
    return day.isoformat()
