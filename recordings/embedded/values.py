"""Embedded values of a recording, gathered in one pass: rows by entity, columns as arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rerun.chunk import Chunk

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.recordings.drawing import entities

Cells = dict[str, Any]
"""Values by component, without the archetype's name: numbers as arrays, texts as tuples."""


@dataclass(frozen=True)
class Values:
    """Chunks of the entities with embedded values, by entity."""

    chunks: dict[str, list[Chunk]] = field(default_factory=dict)

    def take(self, chunk: Chunk) -> None:
        """Keep a chunk if values of its entity are read back."""
        entity = str(chunk.entity_path)
        if entities.is_embedded(entity):
            self.chunks.setdefault(entity, []).append(chunk)

    def below(self, parent: str) -> Iterator[Cells]:
        """Yield the rows of every entity right below `parent`."""
        for entity in sorted(self.chunks):
            if entity.rpartition("/")[0] == parent:
                yield from self.rows(entity)

    def rows(self, entity: str) -> Iterator[Cells]:
        """Yield every row of an entity, in the order of the file."""
        for chunk in self.chunks.get(entity, ()):
            batch = chunk.to_record_batch()
            columns = _components(batch)
            for row in range(batch.num_rows):
                cells = {name: column[row].values for name, column in columns.items()}
                yield {name: _array(cell) for name, cell in cells.items() if cell is not None}

    def columns(self, entity: str, *components: str) -> tuple[IntArray, FloatArray]:
        """Return the single numbers of all rows with these components: robot time (n,), and values (n, k)."""
        parts = [_columns(chunk.to_record_batch(), components) for chunk in self.chunks.get(entity, ())]
        times = np.concatenate([np.empty(0, np.int64), *(ns for ns, _ in parts)])
        return times, np.concatenate([np.empty((0, len(components))), *(table for _, table in parts)])

    def texts(self, entity: str, component: str, *beside: str) -> list[str]:
        """Return a text of each row that `columns` returns for `beside`; empty where a row has none."""
        found: list[str] = []
        for chunk in self.chunks.get(entity, ()):
            batch = chunk.to_record_batch()
            count, columns = len(_columns(batch, beside)[0]), _components(batch)
            cells = (
                columns[component].filter(_having(columns, beside)).to_pylist()
                if component in columns and count
                else []
            )
            found += [cell[0] if cell else "" for cell in cells] or [""] * count
        return found


def _components(batch: Any) -> dict[str, Any]:
    return {name.rpartition(":")[2]: batch.column(name) for name in batch.schema.names if ":" in name}


def _array(cell: Any) -> Any:
    values = cell.to_numpy(zero_copy_only=False)
    return tuple(values.tolist()) if values.dtype == object else values


def _columns(batch: Any, components: tuple[str, ...]) -> tuple[IntArray, FloatArray]:
    columns = _components(batch)
    if not set(components) <= set(columns) or entities.ROBOT_TIME not in batch.schema.names:
        return np.empty(0, np.int64), np.empty((0, len(components)))
    having = _having(columns, components)
    ns = batch.column(entities.ROBOT_TIME).cast("int64").to_numpy(zero_copy_only=False)[having]
    table = [columns[name].filter(having).flatten().to_numpy(zero_copy_only=False) for name in components]
    return ns, np.stack(table, axis=1).astype(np.float64)


def _having(columns: dict[str, Any], components: tuple[str, ...]) -> Any:
    """Return a mask of the rows with all these components."""
    return np.logical_and.reduce([columns[name].is_valid().to_numpy(False) for name in components])
