"""Work on one entry of a batch, in any process of any machine: read, look in the store, plan, store."""

from __future__ import annotations

import contextlib
import datetime
import io
import os
import time
from pathlib import Path
from typing import Any

import msgspec

from stopgo.batches.content import (
    TARGETS,
    ContentParts,
    computed_by,
    floor_parts,
    plan_key,
    reading_key,
    survey_key,
)
from stopgo.batches.entries import ModelStorey
from stopgo.batches.entry_content import EntryContent
from stopgo.batches.store import Result, ResultStore
from stopgo.mission.errors import StopgoError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.settings import Settings, recorded_values

LOG = "plan.log"
NOTHING = "nothing"
"""Status of an entry without anything that was finished since the last visit."""


BASE_BYTES = 350e6
"""Memory of a process that plans a small floor."""
BYTES_PER_BYTE = 12.0
"""Memory per byte of the floor's file."""


class PlanTask(msgspec.Struct, frozen=True, kw_only=True):
    """One plan to be made."""

    name: str
    floor: Path
    settings: Settings
    store: Path
    all_parts: bool = False
    strict: bool = False

    @property
    def memory(self) -> float:
        """Estimated memory, bytes."""
        try:
            return BASE_BYTES + BYTES_PER_BYTE * os.path.getsize(self.floor)
        except OSError:
            return BASE_BYTES


class PlanOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """PlanOutcome of one entry."""

    name: str
    status: str
    """`planned` now, `kept` from the store, or `failed`."""
    exit_code: int
    key: str = ""
    problem: str = ""
    result: Result | None = None


def survey(floor: Path, store: Path) -> list[ModelStorey]:
    """Return the storeys of a model, as `stopgo floors` lists them; of other files none.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    from stopgo.planner.floors import survey_floor

    if floor.suffix.lower() not in (".ifc", ".ifczip"):
        return []
    kept, key = ResultStore(store), survey_key(floor)
    fact = kept.read_fact("surveys", key)
    if fact is not None:
        return [ModelStorey(*item) for item in fact]
    with contextlib.redirect_stderr(io.StringIO()):
        found = survey_floor(floor).floors
    storeys = [ModelStorey(item.name, not item.aside, item.reason) for item in found if item.option]
    kept.write_fact("surveys", key, [(item.name, item.planned, item.reason) for item in storeys])
    return storeys


def known_key(task: PlanTask) -> str | None:
    """Return the key of an entry's plan if its floor was read before, without reading it."""
    key = reading_key(task.floor, task.settings)
    parts = None if key is None else ResultStore(task.store).read_fact("readings", key)
    return None if parts is None else _key_of(task, parts)


def read_parts(task: PlanTask) -> ContentParts:
    """Return the hashes of an entry's floor; the floor is read only if it was not read before.

    Raises
    ------
    InputError
        When the floor cannot be read.
    """
    from stopgo.planner.floors import options_of, read_floor, standing_bodies

    store, key = ResultStore(task.store), reading_key(task.floor, task.settings)
    fact = None if key is None else store.read_fact("readings", key)
    if fact is not None:
        return dict(fact)
    options = options_of(task.settings)
    floor, kinds = read_floor(task.floor, options), task.settings.targets
    floor = floor if kinds is None else floor.with_targets(kinds)
    parts = floor_parts(floor, standing_bodies(task.floor, options))
    if key is not None:
        store.write_fact("readings", key, parts)
    return parts


def work(task: PlanTask) -> PlanOutcome:
    """Return the entry's outcome; its plan is in the store then, unless it failed."""
    try:
        try:
            return _work(task)
        except (OSError, StopgoError):
            store = ResultStore(task.store)
            if store.is_there() or not store.wait_until_there():
                raise
            return _work(task)
    except StopgoError as error:
        return PlanOutcome(name=task.name, status="failed", exit_code=error.exit_code, problem=str(error))
    except OSError as error:
        problem = f"{error.filename or task.store}: {error.strerror or error}"
        return PlanOutcome(name=task.name, status="failed", exit_code=2, problem=problem)


def present_content(task: PlanTask) -> EntryContent:
    """Return the content that an entry's plan would be made of now."""
    parts = read_parts(task)
    return EntryContent(
        key=_key_of(task, parts),
        parts=parts,
        settings=recorded_values(task.settings),
        computed_by=computed_by(),
        reasons=[],
    )


def _key_of(task: PlanTask, parts: ContentParts) -> str:
    return plan_key(parts, task.settings, all_parts=task.all_parts, strict=task.strict)


def _work(task: PlanTask) -> PlanOutcome:
    log = io.StringIO()
    with contextlib.redirect_stderr(log):
        return _found_or_planned(task, log)


def _found_or_planned(task: PlanTask, log: io.StringIO) -> PlanOutcome:
    store, parts = ResultStore(task.store), read_parts(task)
    key = _key_of(task, parts)
    if task.settings.since and parts[TARGETS] == "0":
        return PlanOutcome(name=task.name, status=NOTHING, exit_code=0)
    found, status = store.find(key), "kept"
    if found is None:
        with store.claimed(key):
            found = store.find(key)  # made by another process in the meantime
            if found is None:
                found, status = _planned(task, store, key, parts, log), "planned"
    return PlanOutcome(name=task.name, status=status, exit_code=found.exit_code, key=key, result=found)


def _planned(task: PlanTask, store: ResultStore, key: str, parts: ContentParts, log: io.StringIO) -> Result:
    """Plan an entry into the store."""
    from stopgo.plan_files import plan_files

    begun = time.monotonic()
    with store.filling() as folder:
        reports = plan_files(task.floor, folder, task.settings, all_parts=task.all_parts)
        text = "\n".join(report.as_text() for report in reports).replace(f"{folder}/", "")
        (folder / LOG).write_text(f"{log.getvalue()}{text}\n", encoding="utf-8")
        codes = [item.strict_exit_code if task.strict else item.exit_code for item in reports]
        result = Result(
            exit_code=max(codes),
            text=text,
            reports=[_with_names(report.as_json()) for report in reports],
            parts=parts,
            settings=recorded_values(task.settings),
            computed_by=computed_by(),
            floor=task.floor.name,
            floor_digest=file_digest(task.floor),
            planned=datetime.date.today().isoformat(),
            seconds=time.monotonic() - begun,
            files={},
        )
        return store.publish(key, folder, result)


def _with_names(report: dict[str, Any]) -> dict[str, Any]:
    """The report of one mission, or of several that divide a floor, with names of files in place of paths."""
    if "shared" in report:
        shared = report["shared"]
        return {**report, "shared": {**shared, "missions": [_with_names(one) for one in shared["missions"]]}}
    return {**report, "files": {key: Path(path).name for key, path in report["files"].items()}}
