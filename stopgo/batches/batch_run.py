"""One batch from its file to its results: entries, what is kept, what is planned, and the pages."""

from __future__ import annotations

import datetime
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.batches.batch_file import read_batch
from stopgo.batches.engine import worker_process
from stopgo.batches.entries import Entry, EntryFault, Expansion, ModelStorey, expand, files_of
from stopgo.batches.entry_content import differences, entry_content, read_content
from stopgo.batches.index_page import index_page
from stopgo.batches.record import (
    WAITING,
    BatchRecord,
    EntryRecord,
    entry_record,
    read_record,
    write_record,
)
from stopgo.batches.result_folder import take_result
from stopgo.batches.store import ResultStore
from stopgo.batches.work import PlanOutcome, PlanTask, known_key, present_content, survey
from stopgo.mission.console.running_step import running
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import is_text

MODELS = (".ifc", ".ifczip")


def expanded(file: Path, store: Path, *, workers: int) -> Expansion:
    """Return the entries of a batch's file; models are surveyed for their storeys.

    Raises
    ------
    InputError
        When the file itself cannot be read.
    """
    groups, faults = read_batch(file)
    models: dict[Path, None] = {}
    for group in groups:
        try:
            models.update({path: None for path in files_of(group) if path.suffix.lower() in MODELS})
        except InputError:  # `expand` reports it with its place
            continue
    with running(f"reading the models of {file}"):
        storeys = _surveys([path for path in models if is_text(str(path)) and path.is_file()], store, workers)
    found = expand(groups, storeys)
    problems = (*(EntryFault("", fault) for fault in faults), *found.problems)
    return Expansion(found.entries, problems, found.left_out)


def _surveys(
    models: Sequence[Path], store: Path, workers: int
) -> dict[Path, Sequence[ModelStorey] | InputError]:
    """Storeys of each model, or why it cannot be read."""
    if not models:
        return {}
    if workers == 1 or len(models) == 1:
        return {path: _survey_or_error(path, store) for path in models}
    with worker_process(min(workers, len(models))) as pool:
        return dict(zip(models, pool.map(_survey_or_error, models, [store] * len(models)), strict=True))


def _survey_or_error(model: Path, store: Path) -> Sequence[ModelStorey] | InputError:
    try:
        return survey(model, store)
    except InputError as error:
        return InputError(str(error))


@dataclass(frozen=True)
class Reasons:
    """Differences that make an entry be planned again, and those that made its last plan."""

    present: tuple[str, ...]
    past: tuple[str, ...]


@dataclass
class Batch:
    """A batch in progress."""

    file: Path
    out: Path
    entries: Sequence[Entry]
    store: Path
    left_out: Sequence[str] = ()
    all_parts: bool = False
    strict: bool = False
    _begun: float = field(default_factory=time.monotonic)
    _records: dict[str, EntryRecord] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._last = read_record(self.out)
        before = () if self._last is None else self._last.entries
        self._before = {item.name: item for item in before}
        self._named = {entry.name: entry for entry in self.entries}

    def tasks(self) -> list[PlanTask]:
        """Return the task of every entry."""
        return [
            PlanTask(
                name=entry.name,
                floor=entry.floor,
                settings=entry.settings,
                store=self.store,
                all_parts=self.all_parts,
                strict=self.strict,
            )
            for entry in self.entries
        ]

    def take_kept(self) -> list[PlanTask]:
        """Take the results that the store has for floors read before; return the other tasks."""
        store, left = ResultStore(self.store), []
        for task in self.tasks():
            key = known_key(task)
            found = None if key is None else store.find(key)
            if key is None or found is None:
                left.append(task)
                continue
            self.take(
                PlanOutcome(name=task.name, status="kept", exit_code=found.exit_code, key=key, result=found)
            )
        return left

    def reasons(self, name: str) -> Reasons:
        """Return what differs between an entry's floor now and its last plan, and why that was made.

        Raises
        ------
        InputError
            When there is no such entry, or its floor cannot be read.
        """
        task = next((item for item in self.tasks() if item.name == name), None)
        if task is None:
            known = ", ".join(entry.name for entry in self.entries[:10])
            raise InputError(f"--why {name}: no such entry; there are: {known} …")
        last = read_content(self.out / name)
        now = present_content(task)
        if last is not None and last.key == now.key:
            return Reasons((), tuple(last.reasons))
        return Reasons(tuple(differences(last, now)), ())

    def records(self) -> list[EntryRecord]:
        """Return the figures of the entries that are done."""
        return list(self._records.values())

    def take(self, outcome: PlanOutcome) -> EntryRecord:
        """Copy an outcome's files to the entry's folder, and note its figures."""
        entry = self._named[outcome.name]
        try:
            self._copy(outcome, self.out / entry.name)
        except (OSError, InputError) as error:
            outcome = PlanOutcome(name=entry.name, status="failed", exit_code=2, problem=str(error))
        before = self._before.get(entry.name)
        record = entry_record(outcome, str(entry.floor), entry.place, before)
        self._records[entry.name] = record
        return record

    def _copy(self, outcome: PlanOutcome, folder: Path) -> None:
        if outcome.result is None:
            return
        store = ResultStore(self.store)
        store.wait_until_there()
        content = entry_content(outcome.key, outcome.result, read_content(folder))
        take_result(store.result_folder(outcome.key), outcome.result, folder, content)

    def write(self) -> BatchRecord:
        """Write batch.json, batch.csv and index.html as far as the batch has come."""
        entries = [
            self._records.get(entry.name)
            or EntryRecord(name=entry.name, floor=str(entry.floor), place=entry.place, status=WAITING)
            for entry in self.entries
        ]
        record = BatchRecord(
            file=self.file.name,
            day=datetime.date.today().isoformat(),
            seconds=round(time.monotonic() - self._begun, 1),
            entries=entries,
            left_out=list(self.left_out),
            removed=[name for name in self._before if name not in self._named],
        )
        write_record(self.out, record)
        write_atomic(self.out / "index.html", index_page(record))
        return record
