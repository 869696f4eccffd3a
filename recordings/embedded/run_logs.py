"""Runs inside a recording, read back as run logs with their events and poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.run.boots import joined_boots
from stopgo.mission.run.events import AnyEvent, event_of
from stopgo.mission.run.health_text import HealthWords
from stopgo.mission.run.run_log import LogSource, RunLog, Track
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.values import Values
from stopgo.recordings.rrd.read import Contents


def logs_in(values: Values, contents: Contents, path: Path) -> tuple[RunLog, ...]:
    """Return every run in a recording, the earliest first.

    Raises
    ------
    InputError
        When an embedded event cannot be read.
    """
    runs = [run for run in map(entities.run_of_events, values.chunks) if run is not None]
    if not runs:
        return ()
    source = _source(path, contents)
    logs = [_log(run, values, source) for run in runs]
    return tuple(sorted((log for log in logs if log.events), key=lambda log: (log.began_ns, log.run_id)))


def _source(path: Path, contents: Contents) -> LogSource:
    notes = () if contents.complete else ("the recording was not closed: its end may be missing",)
    return LogSource(path.name, "rrd", file_digest(path), messages=contents.total_rows, notes=notes)


def _log(run_id: str, values: Values, source: LogSource) -> RunLog:
    names = entities.RunEntities(run_id)
    events = {event.number: event for event in _events(values, names.events, source.name)}
    joined = joined_boots([events[number] for number in sorted(events)], _poses(values, names))
    ordered = joined.events
    last = ordered[-1] if ordered else None
    return RunLog(
        robot="" if last is None else last.robot,
        run_id=run_id,
        mission_id=None if last is None else last.mission_id,
        revision=None if last is None else last.revision,
        source=replace(source, notes=(*source.notes, *joined.notes)),
        poses=joined.poses,
        events=ordered,
        health=_health(values, names),
    )


def _health(values: Values, names: entities.RunEntities) -> tuple[HealthWords, ...]:
    """Return the vehicle's health in words; older recordings hold none."""
    entity = names.vehicle_health
    ns, _ = values.columns(entity, "charge")
    words = (values.texts(entity, name, "charge") for name in ("battery", "position_estimate", "geofence"))
    rows = zip(ns.tolist(), *words, strict=True)
    return tuple(HealthWords(*row) for row in sorted(rows, key=lambda row: row[0]))


def _poses(values: Values, names: entities.RunEntities) -> dict[str, Track]:
    """Return the poses of each boot of the robot; recordings of older versions do not name the boot."""
    entity = names.flat(entities.ROBOT)
    ns, poses = values.columns(entity, "x", "y", "heading")
    boots = np.array(values.texts(entity, "boot_id", "x", "y", "heading"), dtype=np.str_)
    mine = {str(boot): boots == boot for boot in np.unique(boots)}
    return {boot: Track.of(ns[rows], poses[rows, :2], poses[rows, 2]) for boot, rows in mine.items()}


def _events(values: Values, entity: str, name: str) -> list[AnyEvent]:
    try:
        return [event_of(row["body"][0]) for row in values.rows(entity) if "body" in row]
    except msgspec.DecodeError as error:
        raise InputError(f"{name}: embedded event cannot be read ({error})") from None
