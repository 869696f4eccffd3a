"""Read a recording back to its end: what it holds, or one line that says why it cannot be read."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rerun.chunk import Chunk, RrdReader

from mission.errors import InputError
from recordings import entities


@dataclass(frozen=True)
class Contents:
    """What a recording holds."""

    application: str
    recording_id: str
    complete: bool
    """False when the writer was killed before it closed the file."""
    rows: dict[str, int]
    """Rows per entity, static ones included."""
    timelines: tuple[str, ...]
    properties: dict[str, dict[str, Any]]
    """Values of each property, by the property's name."""

    @property
    def total_rows(self) -> int:
        return sum(self.rows.values())


def check(path: Path) -> Contents:
    """Read every chunk of the file.

    Raises
    ------
    InputError
        When the file is missing, empty, no recording, cut off, or damaged anywhere.
    """
    reader = _open(path)
    stores = reader.recordings()
    if len(stores) != 1:
        raise InputError(f"{path}: holds {len(stores)} recordings, expected one")
    rows: Counter[str] = Counter()
    timelines: set[str] = set()
    properties: dict[str, dict[str, Any]] = {}
    for chunk in chunks(path, reader):
        entity = str(chunk.entity_path)
        rows[entity] += chunk.num_rows
        timelines.update(chunk.timeline_names)
        if entity.startswith(entities.PROPERTIES + "/"):
            properties.setdefault(entity.rpartition("/")[2], {}).update(_values(chunk))
    return Contents(
        application=stores[0].application_id,
        recording_id=stores[0].recording_id,
        complete=_has_footer(reader),
        rows=dict(sorted(rows.items())),
        timelines=tuple(sorted(timelines)),
        properties=properties,
    )


def chunks(path: Path, reader: RrdReader | None = None) -> Iterator[Chunk]:
    """Every chunk of the recording, to the end; damage is found only when its chunk is read."""
    reader = reader or _open(path)
    try:
        yield from reader.stream()
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{path}: damaged ({_reason(error)})") from None


def column(path: Path, entity: str, component: str) -> list[tuple[float, Any]]:
    """(Seconds of mission time, value) of one component of one entity, in the order of time."""
    found = []
    for chunk in chunks(path):
        batch = chunk.to_record_batch() if str(chunk.entity_path) == entity else None
        if batch is None or component not in batch.schema.names or chunk.is_static:
            continue
        if entities.MISSION_TIME not in batch.schema.names:
            continue
        times = batch.column(entities.MISSION_TIME).to_pylist()
        values = batch.column(component).to_pylist()
        pairs = zip(times, values, strict=True)
        found += [(time.total_seconds(), value[0]) for time, value in pairs if value]
    return sorted(found, key=lambda pair: pair[0])


def _open(path: Path) -> RrdReader:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if os.path.getsize(path) == 0:
        raise InputError(f"{path}: is empty")
    try:
        with warnings.catch_warnings():
            # A file without a footer is told by `Contents.complete`.
            warnings.simplefilter("ignore")
            return RrdReader(path)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{path}: {_fault(path, error)}") from None


def _fault(path: Path, error: Exception) -> str:
    if "Not an RRD file" in str(error) or "too small" in str(error):
        return "is not a Rerun recording"
    return f"is cut off; what is left can be saved with: rerun rrd optimize {path.name} -o repaired.rrd"


def _reason(error: Exception) -> str:
    return str(error).partition("\n")[0][:120]


def _has_footer(reader: RrdReader) -> bool:
    try:
        reader.store()
    except RuntimeError:
        return False
    return True


def _values(chunk: Chunk) -> dict[str, Any]:
    batch = chunk.to_record_batch()
    values = {}
    for name in batch.schema.names:
        if not name.startswith("rerun."):
            cell = batch.column(name).to_pylist()[-1]
            values[name.partition(":")[2] or name] = cell[0] if cell and len(cell) == 1 else cell
    return values
