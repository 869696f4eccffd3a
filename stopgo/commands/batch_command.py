"""`stopgo batch`: plan many floors, storeys, dates and variants; each again only if it changed."""

from __future__ import annotations

import datetime
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.mission.console.notice import notice
from stopgo.mission.console.running_step import RunningStep, running
from stopgo.mission.console.table import counted, duration, printable, printable_lines, table
from stopgo.mission.errors import InputError
from stopgo.result_files import result_folder

if TYPE_CHECKING:
    from stopgo.batches.batch_run import Batch
    from stopgo.batches.entries import Entry, Expansion
    from stopgo.batches.record import BatchRecord, EntryRecord
    from stopgo.batches.store import ResultStore

EXAMPLE = "Example: stopgo batch plans.toml -o campus"
UNITS = {"h": 3600.0, "d": 86400.0, "w": 7 * 86400.0}

FileArgument = Annotated[Path, typer.Argument(metavar="PLANS.toml", help="Floors, storeys, dates, options.")]
OutOption = Annotated[Path, typer.Option("-o", "--out", help="Folder for the results and the index page.")]
StoreOption = Annotated[
    Path | None,
    typer.Option(help="Folder of finished plans; several machines may share it.  [default: OUT/.store]"),
]
WorkersOption = Annotated[int, typer.Option(help="Plans at the same time on this machine.", min=1, max=1024)]
SchedulerOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Plan on the workers of this dask scheduler.")
]
WhyOption = Annotated[str | None, typer.Option(metavar="ENTRY", help="Only print the changes of an entry.")]
GcOption = Annotated[bool, typer.Option("--gc", help="Only remove old results from the store.")]
AgeOption = Annotated[
    str | None,
    typer.Option(metavar="TIME", help="With --gc: also results not used for 12h, 30d, 2w."),
]
SizeOption = Annotated[
    float,
    typer.Option(
        "--store-gb", min=0, max=1e6, help="Largest size of the store; the longest unused results go first."
    ),
]


SinceOption = Annotated[
    str | None,
    typer.Option(metavar="DAY|last", help="Only elements finished after DAY; last: a floor's last run."),
]
RunsOption = Annotated[Path | None, typer.Option(metavar="DIR", help="Recordings of earlier runs.")]
DayOption = Annotated[
    str | None, typer.Option(metavar="DAY", help="Allocate this day's missions to the robots of [day].")
]
SkipFaultyOption = Annotated[bool, typer.Option(help="Plan the sound entries even if others have faults.")]
BatchAllPartsOption = Annotated[bool, typer.Option(help="Also plan parts not connected with the first.")]
BatchStrictOption = Annotated[bool, typer.Option(help="Exit 1 if floor is left out or a plan is doubtful.")]


def add_commands(app: typer.Typer) -> None:
    """Add `batch` to the app."""
    app.command(name="batch", epilog=EXAMPLE)(batch_command)


def batch_command(
    file: FileArgument,
    out: OutOption = Path(),
    *,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only list the entries.")] = False,
    why: WhyOption = None,
    store: StoreOption = None,
    workers: WorkersOption = 2,
    scheduler: SchedulerOption = None,
    since: SinceOption = None,
    runs: RunsOption = None,
    day: DayOption = None,
    skip_faulty: SkipFaultyOption = False,
    all_parts: BatchAllPartsOption = False,
    strict: BatchStrictOption = False,
    gc: GcOption = False,
    unused_for: AgeOption = None,
    store_gb: SizeOption = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """Plan every entry of a file of floors, storeys, dates and variants, each into its folder.

    Unchanged plans come from the store. The exit code is the worst of all. After Ctrl-C, call it again.
    """
    return _run_command(BatchCall(**locals()))


@dataclass(frozen=True)
class BatchCall:
    """The options of a call; each as `batch_command` declares it."""

    file: Path
    out: Path
    dry_run: bool
    why: str | None
    store: Path | None
    workers: int
    scheduler: str | None
    since: str | None
    runs: Path | None
    day: str | None
    skip_faulty: bool
    all_parts: bool
    strict: bool
    gc: bool
    unused_for: str | None
    store_gb: float
    as_json: bool

    def __post_init__(self) -> None:
        for option, day in (("--since", self.since), ("--day", self.day)):
            if day is not None and not _is_day(day) and (option, day) != ("--since", "last"):
                raise InputError(f"{option} {day}: give a day as YYYY-MM-DD")
        if self.since == "last" and self.runs is None:
            raise InputError("--since last: needs the recordings of earlier runs; give --runs DIR")


def _is_day(text: str) -> bool:
    try:
        return datetime.date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False


def _run_command(call: BatchCall) -> int:
    from stopgo.batches.batch_run import Batch, ResultStore, expanded
    from stopgo.batches.day import read_team, write_day_of
    from stopgo.batches.visits import note_missions, read_visits, with_since

    out = result_folder(call.out)
    store = ResultStore.at(out / ".store" if call.store is None else call.store)
    if call.gc:
        return _collect(store, call.unused_for, call.store_gb)
    team = None if call.day is None else read_team(call.file)
    found = expanded(call.file, store.folder, workers=call.workers)
    visits = read_visits(out, call.runs)
    entries, visited = with_since(found.entries, call.since, visits)
    left_out = (*found.left_out, *visited)
    batch = Batch(call.file, out, entries, store.folder, left_out, call.all_parts, call.strict)
    if call.why is not None:
        return _print_why(batch, call.why)
    faults = _print_problems(found)
    if faults and not call.skip_faulty:
        return faults
    if call.dry_run:
        _print_entries(entries, as_json=call.as_json)
        return faults
    record = _run(batch, call.workers, call.scheduler, call.store_gb)
    note_missions(out, visits, entries, record.entries)
    if call.day is not None and team is not None:
        overview, notes = write_day_of(team, out, call.day, batch, record, visits)
        for line in (*notes, overview):
            notice(f"{call.day}: {line}")
    _print_record(record, out, as_json=call.as_json)
    return max(record.exit_code, faults)


def _collect(store: ResultStore, unused_for: str | None, store_gb: float) -> int:
    oldest = None if unused_for is None else _seconds(unused_for)
    removed, freed = store.collect_garbage(most_bytes=int(store_gb * 1e9), oldest_s=oldest)
    results = counted(removed, "result", "results")
    typer.echo(f"{printable(str(store.folder))}: removed {results}, {freed / 1e6:.1f} MB")
    return 0


def _seconds(text: str) -> float:
    unit = UNITS.get(text[-1:])
    if unit is None or not text[:-1].replace(".", "", 1).isdecimal():
        raise InputError(f"--unused-for {text}: give hours, days or weeks, such as 12h, 30d or 2w")
    return float(text[:-1]) * unit


def _print_why(batch: Batch, name: str) -> int:
    """Print what differs between an entry's floor now and its last plan."""
    reasons = batch.reasons(name)
    for line in reasons.present:
        typer.echo(printable(f"{name}: would be planned again: {line}"))
    if reasons.present:
        return 0
    typer.echo(printable(f"{name}: unchanged; its plan is of this floor and these options"))
    for line in reasons.past:
        typer.echo(printable(f"{name}: was planned because: {line}"))
    return 0


def _print_problems(found: Expansion) -> int:
    """Print the faults of a batch's file; returns their exit code."""
    for problem in found.problems:
        notice(str(problem))
    if found.problems:
        sound = f"{counted(len(found.entries), 'sound entry', 'sound entries')}; correct the file"
        notice(f"{counted(len(found.problems), 'fault', 'faults')}, {sound}")
    return 2 if found.problems else 0


def _print_entries(entries: Sequence[Entry], *, as_json: bool) -> None:
    rows = [(entry.name, str(entry.floor), *(value for _, value in entry.axes[1:])) for entry in entries]
    header = ("entry", "file", "storey", "date", "variant")
    if as_json:
        listed = [dict(zip(header, cells, strict=True)) for cells in rows]
        typer.echo(json.dumps({"entries": listed}, ensure_ascii=False))
        return
    typer.echo(table(header, rows))
    typer.echo(counted(len(entries), "entry", "entries"))


def _run(batch: Batch, workers: int, scheduler: str | None, store_gb: float) -> BatchRecord:
    """Plan what the store does not have; the record is written also if that is ended."""
    from stopgo.batches.engine import Running, engine_for
    from stopgo.batches.store import ResultStore

    with running(f"looking up {counted(len(batch.entries), 'plan', 'plans')}") as step:
        try:
            left = batch.take_kept()
            if left:
                progress = BatchProgress(step, total=len(left))
                engine = engine_for(workers=workers, scheduler=scheduler)
                work = Running(engine, left, progress.begun, progress.show)
                with work:
                    for outcome in work.outcomes():
                        progress.ended(batch.take(outcome))
        finally:
            record = batch.write()
        ResultStore(batch.store).collect_garbage(most_bytes=int(store_gb * 1e9))
    return record


class BatchProgress:
    """Entries in progress, and the time that is left with its spread."""

    def __init__(self, step: RunningStep, *, total: int) -> None:
        self._step, self._total = step, total
        self._begun: dict[str, float] = {}
        self._spans: list[float] = []
        self._first = time.monotonic()
        self._failed = 0

    def begun(self, name: str) -> None:
        """Note that an entry begins."""
        self._begun[name] = time.monotonic()

    def ended(self, record: EntryRecord) -> None:
        """Note that an entry has ended; a failure is reported at once."""
        self._spans.append(time.monotonic() - self._begun.pop(record.name))
        if record.status == "failed":
            self._failed += 1
            notice(f"{record.name}: {record.problem}")

    def show(self) -> None:
        """Name what runs, and the time that is left."""
        done = f"{len(self._spans) - self._failed} of {self._total} planned"
        failed = f", {self._failed} failed" if self._failed else ""
        now = time.monotonic()
        names = ", ".join(f"{name} {duration(now - begun)}" for name, begun in self._begun.items())
        self._step.progress(f"{done}{failed}; {self._left()}; {names}")

    def _left(self) -> str:
        """The time that is left as a range of two standard deviations, by the entries so far."""
        count = len(self._spans)
        if count < 2:
            return "time left: not known yet"
        mean = sum(self._spans) / count
        variance = sum((span - mean) ** 2 for span in self._spans) / (count - 1)
        rest = self._total - count
        pace = (time.monotonic() - self._first) / sum(self._spans)
        spread = 2 * (variance * rest * (1 + rest / count)) ** 0.5 * pace
        least, most = max(0.0, rest * mean * pace - spread), rest * mean * pace + spread
        return f"{duration(least)} to {duration(most)} left"


def _print_record(record: BatchRecord, out: Path, *, as_json: bool) -> None:
    import msgspec

    if as_json:
        typer.echo(msgspec.json.encode(record).decode())
        return
    rows = [_cells(item) for item in record.entries]
    typer.echo(table(("entry", "status", "stops", "coverage %", "route m", "changes"), rows))
    for line in record.left_out:
        typer.echo(printable_lines(f"left out: {line}"))
    counts = ", ".join(f"{count} {name}" for name, count in record.counts().items() if count)
    typer.echo(printable_lines(f"{counts}; {duration(record.seconds)}; {out / 'index.html'}"))


def _cells(item: EntryRecord) -> tuple[str, ...]:
    if item.stops is None or item.coverage is None or item.route_m is None:
        return item.name, item.status, "-", "-", "-", item.problem or item.changed
    coverage, route = f"{100 * item.coverage:.1f}", f"{item.route_m:.1f}"
    return item.name, item.status, str(item.stops), coverage, route, item.changed
