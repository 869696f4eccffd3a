"""Merge a plan and its runs into one recording, with a layout for exactly these runs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import replacing
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas, Sheet, layout_alone, mission_origin, open_canvas
from stopgo.recordings.embedded.checking import embed_end
from stopgo.recordings.embedded.plan import origin_in, planned_extent
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.embedded.same_mission import agreeing
from stopgo.recordings.page.reviewed import missions_of
from stopgo.recordings.plan.mission import mission_extent
from stopgo.recordings.rrd.read import chunks


def merge(recordings: Sequence[Recording], out: Path) -> None:
    """Write one recording of a mission's plan and runs; of a run in several files, the first counts.

    Raises
    ------
    InputError
        When they are of several missions or origins, or `out` is one of them or cannot be written.
    """
    ordered = _plans_first(agreeing(recordings))
    _check_same_mission(ordered, out)
    with replacing(out) as (temporary,), open_canvas(_sheet(ordered)) as canvas:
        _fill(canvas, ordered)
        temporary.write_bytes(canvas.drain())


def layout_of(recordings: Sequence[Recording]) -> bytes:
    """Return the layout of the recording that `merge` writes.

    A browser draws the data it has so far, and would make its own layout for a recording that comes before
    it.
    """
    return layout_alone(_sheet(_plans_first(agreeing(recordings))))


def _plans_first(recordings: Sequence[Recording]) -> list[Recording]:
    return sorted(recordings, key=lambda item: entities.PROPERTY_PLAN not in item.contents.properties)


def _sheet(recordings: Sequence[Recording]) -> Sheet:
    missions = missions_of(recordings)
    extents = (planned_extent(item) for item in recordings)
    runs = tuple(dict.fromkeys(str(log.run_id) for item in recordings for log in item.logs))
    return Sheet(
        recording_id=entities.recording_id(recordings[0].mission_id, _together(runs)),
        name=missions[-1].name,
        origin=mission_origin(missions[0]),
        extent=next((item for item in extents if item is not None), mission_extent(missions[-1])),
        runs=runs,
    )


def _together(runs: Sequence[str]) -> str:
    """Return a name for runs in one recording: that of the only one, else a digest of all."""
    return runs[0] if len(runs) == 1 else hashlib.sha256(" ".join(runs).encode()).hexdigest()[:16]


def _check_same_mission(recordings: Sequence[Recording], out: Path) -> None:
    ids = sorted({item.mission_id for item in recordings})
    if len(ids) > 1:
        raise InputError(f"{out}: a recording contains one mission, not {len(ids)}: {', '.join(ids)}")
    if len({origin_in(item) for item in recordings}) > 1:
        raise InputError(f"{out}: the recordings have different origins, as their missions start elsewhere")
    if not missions_of(recordings):
        raise InputError(f"{out}: no recording contains its mission; plan and record again")
    if any(out.resolve() == item.path.resolve() for item in recordings):
        raise InputError(f"{out}: is one of the recordings to be merged; give another name")


def _fill(canvas: Canvas, recordings: Iterable[Recording]) -> None:
    """Copy each entity once, from the first recording that contains it."""
    copied: set[str] = set(canvas.counts)
    for recording in recordings:
        new: set[str] = set()
        for chunk in chunks(recording.path):
            entity = str(chunk.entity_path)
            if entity.startswith(entities.PROPERTIES):
                continue
            if entity not in copied or entity == entities.LATEST_REPORT:
                new.add(entity)
                canvas.copy_chunk(chunk)
        copied |= new
        for name in (entities.PROPERTY_PLAN, entities.PROPERTY_PARAMETERS, entities.PROPERTY_RUN):
            values = recording.contents.properties.get(name)
            if values and f"{entities.PROPERTIES}/{name}" not in copied:
                copied.add(f"{entities.PROPERTIES}/{name}")
                canvas.describe(name, {key: _listed(value) for key, value in values.items()})
    embed_end(canvas)


def _listed(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value
