"""Lines of a floor in the drawing's metres: for pictures, not for planning."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray, Polygon, outlines

Polylines = tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class FloorLines:
    """Lines of a floor, each a polyline (n, 2); the outline of a filled shape ends where it begins."""

    outline: Polylines
    rooms: Polylines
    kinds: Mapping[str, Polylines]
    """By kind of element."""
    openings: Polylines
    names: tuple[tuple[str, float, float], ...]
    """Room names with their label positions."""


def lines_of(floor: FloorPlan, name_point: Callable[[Polygon], Iterable[float]]) -> FloorLines:
    """Return the lines of a floor; a room's name is at the `name_point` of its largest polygon."""
    kinds: dict[str, list[FloatArray]] = {}
    for item in floor.elements:
        kinds.setdefault(item.kind, []).extend([*outlines(item.solids), *item.lines])
    names = []
    for room in floor.rooms:
        if room.polygons:
            x, y = name_point(max(room.polygons, key=lambda polygon: polygon.area))
            names.append((room.label, float(x), float(y)))
    return FloorLines(
        outline=tuple(outlines(floor.outline)),
        rooms=tuple(line for room in floor.rooms for line in outlines(room.polygons)),
        kinds={kind: tuple(lines) for kind, lines in kinds.items()},
        openings=tuple(item.line for item in floor.openings),
        names=tuple(names),
    )
