"""Cells of a recording as plain values: what a test compares with numbers."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from stopgo.recordings.rrd.read import chunks

Cell = tuple[dict[str, int], Any]
"""Index values by timeline (nothing for a static cell), and the list of values."""


def cells(path: Path, entity: str, component: str) -> list[Cell]:
    """Every cell of one component of one entity, in the order of the file."""
    found: list[Cell] = []
    for chunk in _chunks(path, _version(path)):
        if str(chunk.entity_path) == entity:
            found += _cells(chunk, component)
    return found


def _version(path: Path) -> tuple[int, ...]:
    told = path.stat()
    return told.st_ino, told.st_size, told.st_mtime_ns


@lru_cache(maxsize=4)
def _chunks(path: Path, version: tuple[int, ...]) -> list[Any]:
    """Content of a file, read once for all questions of a test."""
    return list(chunks(path))


def static(path: Path, entity: str, component: str) -> Any:
    """The one static cell of a component."""
    values = [value for times, value in cells(path, entity, component) if not times]
    assert len(values) == 1, f"{entity} {component}: {len(values)} static cells"
    return values[0]


def on(path: Path, entity: str, component: str, timeline: str) -> dict[int, Any]:
    """Cells of one component by their time on one timeline; durations and timestamps in nanoseconds."""
    found = cells(path, entity, component)
    return {times[timeline]: value for times, value in found if timeline in times}


def components(path: Path) -> dict[str, tuple[set[str], set[str]]]:
    """For each entity, its static components and those with times."""
    found: dict[str, tuple[set[str], set[str]]] = {}
    for chunk in chunks(path):
        found.setdefault(str(chunk.entity_path), (set(), set()))[not chunk.is_static].update(names_of(chunk))
    return found


def names_of(chunk: Any) -> set[str]:
    """The components that a chunk has cells of."""
    names = set(chunk.to_record_batch().schema.names) - set(chunk.timeline_names)
    return {name for name in names if not name.startswith("rerun.")}


def everything(path: Path) -> list[str]:
    """Every cell of the recording as text, in an order of its own."""
    return sorted(
        f"{chunk.entity_path} {component} {cell}"
        for chunk in chunks(path)
        for component in names_of(chunk)
        for cell in _cells(chunk, component)
    )


def _cells(chunk: Any, component: str) -> list[Cell]:
    batch = chunk.to_record_batch()
    if component not in batch.schema.names:
        return []
    times = {name: batch.column(name).cast("int64").to_pylist() for name in chunk.timeline_names}
    values = batch.column(component).to_pylist()
    return [
        ({name: column[row] for name, column in times.items()}, value)
        for row, value in enumerate(values)
        if value is not None
    ]
