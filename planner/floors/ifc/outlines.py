"""Refusal of outlines with very many vertices, before a geometry kernel triangulates what they bound."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import ifcopenshell
import numpy as np

MOST_VERTICES = 20_000
"""Vertices of one outline, as of one line of a drawing."""
LEAST_BYTES = 2
"""A vertex is written in no fewer bytes: `1,`."""
_STATEMENT = re.compile(rb"#(\d+)\s*=\s*(\w+)")
_COUNTED = {
    b"IFCPOLYLINE": (b"#", 1),
    b"IFCPOLYLOOP": (b"#", 1),
    b"IFCCARTESIANPOINTLIST2D": (b"(", 2),
    b"IFCINDEXEDPOLYGONALFACE": (b",", -1),
}
"""Classes of outlines: a byte that each vertex is written with, and how often it stands elsewhere."""


def too_many_vertices(model: ifcopenshell.file, path: Path, entities: Iterable[Any]) -> str:
    """Return the fault of a shape with more vertices on one outline than any building's; empty if none has.

    Lines of shapes that are not made, such as those of a terrain, may have more.
    """
    shaped = {entity.id() for entity in entities}
    for number, count in _long_outlines(path.read_bytes()):
        for product in _products_with(model, number):
            if product.id() in shaped:
                return (
                    f"has an outline of {count} vertices, more than {MOST_VERTICES}, in {product.is_a()} "
                    f"{product.GlobalId}; simplify it, or leave the element out"
                )
    return ""


def _long_outlines(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the number of each outline with too many vertices, and how many it has."""
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord(";"))
    long = np.flatnonzero(np.diff(ends) > LEAST_BYTES * MOST_VERTICES)
    for begin, end in zip(ends[long].tolist(), ends[long + 1].tolist(), strict=True):
        statement = data[begin:end]
        named = _STATEMENT.search(statement)
        if named and named[2].upper() in _COUNTED:
            byte, elsewhere = _COUNTED[named[2].upper()]
            count = statement.count(byte) - elsewhere
            if count > MOST_VERTICES:
                yield int(named[1]), count


def _products_with(model: ifcopenshell.file, number: int) -> Iterator[Any]:
    """Yield the products that an entity is part of the shape of."""
    waiting, known = [model.by_id(number)], {number}
    while waiting:
        for entity in sorted(model.get_inverse(waiting.pop()), key=lambda item: item.id()):
            if entity.is_a("IfcProduct"):
                yield entity
            elif entity.id() not in known:
                known.add(entity.id())
                waiting.append(entity)
