"""Record of a batch (`batch.json`): every entry with its result, and what changed since the last batch."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from stopgo.batches.store import Result
from stopgo.batches.work import NOTHING, PlanOutcome
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic

FILE = "batch.json"
VERSION = 1
WAITING = "waiting"


class EntryRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One entry of a batch, in figures."""

    name: str
    floor: str
    place: str
    status: str
    """`planned`, `kept`, `failed`, `nothing` to scan, or `waiting` if the batch was ended before."""
    exit_code: int | None = None
    stops: int | None = None
    coverage: float | None = None
    """Share from 0 to 1; the least of all parts."""
    route_m: float | None = None
    time_s: float | None = None
    """Duration of the missions, seconds."""
    findings: int | None = None
    problem: str = ""
    changed: str = ""
    """Difference to the last batch, in words; empty if there is none."""
    key: str = ""
    missions: list[str] = []
    """Ids of its missions."""


class BatchRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A batch."""

    version: int = VERSION
    file: str
    day: str
    seconds: float
    entries: list[EntryRecord]
    left_out: list[str] = []
    removed: list[str] = []
    """Entries of the last batch that this one does not have."""

    @property
    def exit_code(self) -> int:
        """Worst exit code of the entries; those that wait are unknown."""
        return max((3 if item.exit_code is None else item.exit_code for item in self.entries), default=0)

    def counts(self) -> dict[str, int]:
        """Number of entries by status."""
        names = ("planned", "kept", NOTHING, "failed", WAITING)
        return {name: sum(item.status == name for item in self.entries) for name in names}


def entry_record(outcome: PlanOutcome, floor: str, place: str, before: EntryRecord | None) -> EntryRecord:
    """Return the figures of an outcome, compared with those of the last batch."""
    record = EntryRecord(
        name=outcome.name,
        floor=floor,
        place=place,
        status=outcome.status,
        exit_code=outcome.exit_code,
        problem=outcome.problem,
        key=outcome.key,
        **({} if outcome.result is None else _figures(outcome.result)),
    )
    return msgspec.structs.replace(record, changed=_difference(before, record))


def _figures(result: Result) -> dict[str, Any]:
    """The figures of all parts of a floor; those of a part that is divided are of all its missions."""
    reports = result.reports
    missions = [one for part in reports for one in part.get("shared", {"missions": [part]})["missions"]]
    return {
        "missions": [one["mission"]["id"] for one in missions],
        "stops": sum(part["selection"]["stops"] for part in reports),
        "coverage": min(part["selection"]["coverage"] for part in reports),
        "route_m": round(sum(part["route"]["length_m"] for part in reports), 2),
        "time_s": round(sum(part["schedule"]["total_s"] for part in reports), 1),
        "findings": sum(len(part["floor"]["findings"]) for part in reports),
    }


def _difference(before: EntryRecord | None, now: EntryRecord) -> str:
    if before is None:
        return "new"
    if before.key == now.key and now.key:
        return ""
    if before.stops is None or now.stops is None:
        return "" if before.status == now.status else f"{before.status} before"
    parts = []
    if before.stops != now.stops:
        parts.append(f"{now.stops - before.stops:+d} stops")
    if before.coverage is not None and now.coverage is not None:
        points = 100 * (now.coverage - before.coverage)
        parts += [f"{points:+.1f} points of coverage"] if abs(points) >= 0.05 else []
    return ", ".join(parts) or "same figures, other content"


def read_record(out: Path) -> BatchRecord | None:
    """Return the record of the last batch in a folder; None if there is none.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    path = out / FILE
    try:
        return decoded(path.read_bytes(), BatchRecord)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it, or name another folder") from None


def write_record(out: Path, record: BatchRecord) -> None:
    """Write batch.json and batch.csv."""
    write_atomic(out / "batch.csv", _csv(record.entries).encode("utf-8"))
    write_atomic(out / FILE, msgspec.json.format(msgspec.json.encode(record), indent=1))


def _csv(entries: Iterable[EntryRecord]) -> str:
    text = io.StringIO()
    names = EntryRecord.__struct_fields__
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for entry in entries:
        writer.writerow([_cell(getattr(entry, name)) for name in names])
    return text.getvalue()


def _cell(value: object) -> object:
    """A cell that no spreadsheet takes for a formula."""
    if isinstance(value, list):
        return " ".join(value)
    if value is None:
        return ""
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@") else value
