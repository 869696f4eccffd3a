"""Third-party floor readers: entry points of installed packages in `stopgo.floor`, each a `Reader`."""

from __future__ import annotations

from collections.abc import Iterator

from stopgo.mission.console.plugins import Variant, installed, variant
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.reader import Reader


def foreign_readers() -> Iterator[Variant[Reader]]:
    """Each reader of an installed third-party package."""
    for name in installed("floor"):
        found: Variant[Reader] = variant("floor", name, {}, said=f"floor reader {name}")
        found.of_kind(found.what, Reader)
        yield found


def sound(reader: Variant[Reader], given: object, digest: str) -> FloorPlan:
    """Return the result of a third-party reader, if it is a floor of this file with finite numbers only."""
    floor: FloorPlan = reader.of_kind(given, FloorPlan)
    if floor.source.digest != digest:
        raise reader.wrong("gave the floor of another file: its digest is not that of the bytes")
    if not floor.outline:
        raise reader.wrong("gave a floor without an outline")
    solids = [polygon for element in floor.elements for polygon in element.solids]
    rooms = [polygon for room in floor.rooms for polygon in room.polygons]
    for ring in (ring for polygon in (*floor.outline, *rooms, *solids) for ring in polygon.rings):
        reader.check_array(ring, "a ring", (None, 2))
    for line in (line for element in floor.elements for line in element.lines):
        reader.check_array(line, "a line", (None, 2))
    for opening in floor.openings:
        reader.check_array(opening.line, f"the line of {opening.id}", (2, 2))
    for element in floor.elements:
        if element.kind not in KINDS:
            raise reader.wrong(f"{element.id} is of kind '{element.kind}'; known: {', '.join(KINDS)}")
    return floor
