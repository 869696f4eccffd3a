"""Lines of the floor in a recording, in the drawing's metres: for pictures, not for planning."""

from __future__ import annotations

import numpy as np

from stopgo.mission.floor.polylines import FloorLines, Polylines
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.values import Values


def floor_lines(values: Values, origin: tuple[float, float]) -> FloorLines | None:
    """Return the lines of the floor in a recording; None if it contains no floor."""

    def lines(entity: str) -> Polylines:
        strips = [row["strips"] for row in values.rows(entity) if "strips" in row]
        return tuple(_polyline(strip) + origin for strip in strips[-1]) if strips else ()

    outline = lines(entities.OUTLINE)
    if not outline:
        return None
    kinds = {kind: lines(entities.child(entities.FLOOR, kind)) for kind in KINDS}
    return FloorLines(
        outline, lines(entities.ROOMS), kinds, lines(entities.OPENINGS), tuple(_names(values, origin))
    )


def _names(values: Values, origin: tuple[float, float]) -> list[tuple[str, float, float]]:
    found = []
    for row in values.rows(entities.ROOM_NAMES):
        for name, position in zip(row.get("labels", ()), row.get("positions", ()), strict=False):
            x, y = _polyline([position])[0] + origin
            found.append((str(name), float(x), float(y)))
    return found


def _polyline(strip: object) -> FloatArray:
    return np.array([np.asarray(point, dtype=np.float64) for point in strip], dtype=np.float64).reshape(-1, 2)  # type: ignore[attr-defined]
