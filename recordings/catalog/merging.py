"""A plan and its runs -> one recording, laid out for exactly these runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import replacing
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas, Sheet, layout_alone, mission_origin, open_canvas
from stopgo.recordings.embedded.checking import carry_end
from stopgo.recordings.embedded.plan import origin_in, planned_extent
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.page.reviewed import missions_of
from stopgo.recordings.plan.mission import mission_extent
from stopgo.recordings.rrd.read import chunks


def merge(recordings: Sequence[Recording], out: Path) -> None:
    """Write one recording of a mission's plan and runs; of a run that several tell of, the first counts.

    Raises
    ------
    InputError
        When they are of several missions or origins, or `out` is one of them or cannot be written.
    """
    ordered = _plans_first(recordings)
    _must_fit(ordered, out)
    with replacing(out) as (temporary,), open_canvas(_sheet(ordered)) as canvas:
        _fill(canvas, ordered)
        temporary.write_bytes(canvas.taken())


def layout_of(recordings: Sequence[Recording]) -> bytes:
    """The layout of what `merge` writes: a browser draws what it has so far, and makes a layout of its own
    for a recording that comes before it.
    """
    return layout_alone(_sheet(_plans_first(recordings)))


def _plans_first(recordings: Sequence[Recording]) -> list[Recording]:
    return sorted(recordings, key=lambda item: entities.PROPERTY_PLAN not in item.contents.properties)


def _sheet(recordings: Sequence[Recording]) -> Sheet:
    missions = missions_of(recordings)
    extents = (planned_extent(item) for item in recordings)
    return Sheet(
        recording_id=recordings[0].mission_id,
        name=missions[-1].name,
        origin=mission_origin(missions[0]),
        extent=next((item for item in extents if item is not None), mission_extent(missions[-1])),
        runs=tuple(dict.fromkeys(str(log.run_id) for item in recordings for log in item.logs)),
    )


def _must_fit(recordings: Sequence[Recording], out: Path) -> None:
    ids = sorted({item.mission_id for item in recordings})
    if len(ids) > 1:
        raise InputError(f"{out}: one recording is of one mission; these are of {len(ids)}: {', '.join(ids)}")
    if len({origin_in(item) for item in recordings}) > 1:
        raise InputError(f"{out}: the recordings' origins differ: their missions begin at different places")
    if not missions_of(recordings):
        raise InputError(f"{out}: no recording carries its mission; plan and record again")
    if any(out.resolve() == item.path.resolve() for item in recordings):
        raise InputError(f"{out}: is one of the recordings to be merged; give another name")


def _fill(canvas: Canvas, recordings: Iterable[Recording]) -> None:
    """Take everything over once: what a recording has told, a later one does not tell again."""
    told: set[str] = set(canvas.counts)
    for recording in recordings:
        mine: set[str] = set()
        for chunk in chunks(recording.path):
            entity = str(chunk.entity_path)
            if entity.startswith(entities.PROPERTIES):
                continue
            if entity not in told or entity == entities.LATEST_REPORT:
                mine.add(entity)
                canvas.take(chunk)
        told |= mine
        for name in (entities.PROPERTY_PLAN, entities.PROPERTY_PARAMETERS, entities.PROPERTY_RUN):
            values = recording.contents.properties.get(name)
            if values and f"{entities.PROPERTIES}/{name}" not in told:
                told.add(f"{entities.PROPERTIES}/{name}")
                canvas.describe(name, {key: _listed(value) for key, value in values.items()})
    carry_end(canvas)


def _listed(value: object) -> object:
    return list(value) if isinstance(value, tuple) else value
