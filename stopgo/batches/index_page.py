"""Index page of a batch: every entry with status, figures and changes, as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from urllib.parse import quote

from stopgo.batches.record import BatchRecord, EntryRecord
from stopgo.mission.console.table import duration
from stopgo.recordings.page import whole_page
from stopgo.recordings.page.words import grid, row, shown, tag

COLUMNS = ("entry", "status", "stops", "coverage %", "route m", "time", "findings", "changes", "files")
FILES = {"plan": "plan.svg", "mission": "mission.json", "log": "plan.log"}
WORDS = {
    "planned": "planned now",
    "kept": "unchanged",
    "nothing": "nothing to scan",
    "failed": "failed",
    "waiting": "not planned yet",
}


def index_page(record: BatchRecord) -> bytes:
    """Return the page; the same record gives the same bytes."""
    counts = record.counts()
    summary = ", ".join(f"{counts[key]} {word}" for key, word in WORDS.items() if counts[key])
    parts = [
        tag("h1", f"{shown(record.file)} {tag('small', shown(record.day))}"),
        tag("p", f"{len(record.entries)} plans: {shown(summary or 'none')}. {_totals(record)}"),
    ]
    failed = [item for item in record.entries if item.status == "failed"]
    if failed:
        parts += [tag("h2", "Failed"), tag("ul", "".join(_failures(failed)))]
    parts += [tag("h2", "Plans"), tag("div", entries_table(record.entries), class_="scroll")]
    for title, lines in (("Storeys left out", record.left_out), ("No longer planned", record.removed)):
        if lines:
            parts += [tag("h2", title), tag("ul", "".join(tag("li", shown(line)) for line in lines))]
    return whole_page(f"{record.file} {record.day}", "".join(parts))


def entries_table(entries: Iterable[EntryRecord]) -> str:
    """Return the table of entries."""
    return grid(COLUMNS, (row(_cells(entry)) for entry in entries))


def _totals(record: BatchRecord) -> str:
    stops = sum(item.stops or 0 for item in record.entries)
    seconds = sum(item.time_s or 0.0 for item in record.entries)
    return f"{stops} stops, {shown(duration(seconds))} of driving and scanning."


def _failures(failed: Iterable[EntryRecord]) -> Iterator[str]:
    """Each problem once, with all entries that it stops."""
    by_problem: dict[str, list[EntryRecord]] = {}
    for entry in failed:
        by_problem.setdefault(f"{entry.problem} ({entry.place})", []).append(entry)
    for problem, entries in by_problem.items():
        names = ", ".join(entry.name for entry in entries)
        yield tag("li", f"{tag('b', shown(problem))}: {shown(names)}")


def _cells(entry: EntryRecord) -> Iterator[str]:
    yield shown(entry.name)
    doubtful = entry.status != "failed" and entry.exit_code == 1
    yield shown(f"{WORDS[entry.status]}{'; with objections' if doubtful else ''}")
    yield "" if entry.stops is None else str(entry.stops)
    yield "" if entry.coverage is None else f"{100 * entry.coverage:.1f}"
    yield "" if entry.route_m is None else f"{entry.route_m:.1f}"
    yield "" if entry.time_s is None else shown(duration(entry.time_s))
    yield "" if entry.findings is None else str(entry.findings)
    yield shown(entry.changed)
    yield "" if entry.stops is None else " ".join(_link(entry, *item) for item in FILES.items())


def _link(entry: EntryRecord, word: str, file: str) -> str:
    return tag("a", word, href=quote(f"{entry.name}/{file}"))
