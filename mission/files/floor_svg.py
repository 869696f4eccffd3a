"""Drawings of floors as read, before planning: the recognised elements, and the ignored lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.files.floor_drawing import LOOKS, kinds_of
from stopgo.mission.files.svg import FONT, clean, group, line_data, number, path, ring_data, text
from stopgo.mission.floor import Element, FloorPlan, Room
from stopgo.mission.geometry import FloatArray, Polygon, bounds

WIDTH = 400.0
"""Millimetres of paper that the largest floor takes …"""
MARGIN = 12.0
"""… with this margin around it, for its name."""
ROOM: dict[str, object] = {"fill": "#ffffff", "stroke": "#b5b5b5", "stroke_width": 0.15}
FLOOR: dict[str, object] = {"fill": "#f3f0dc", "stroke": "#b09a30", "stroke_width": 0.3}
OPENINGS: dict[str, dict[str, object]] = {
    "door": {"stroke": "#0b63b0", "stroke_width": 0.6},
    "passage": {"stroke": "#0b63b0", "stroke_width": 0.5, "stroke_dasharray": "1.4 0.8"},
}
IGNORED: dict[str, object] = {"stroke": "#c2185b", "stroke_width": 0.2, "stroke_dasharray": "0.8 0.8"}
_EVEN_ODD: dict[str, object] = {"fill_rule": "evenodd"}


@dataclass(frozen=True)
class _LabelSpot:
    """Position of a floor on the paper: its lower left corner in metres, its top on paper, and the scale."""

    x: float
    y: float
    height: float
    top: float
    scale: float

    def on_paper(self, points: FloatArray) -> FloatArray:
        """Return points (n, 2) in millimetres, y down."""
        local = (np.asarray(points) - (self.x, self.y)) * self.scale
        return np.column_stack([local[:, 0] + MARGIN, self.top + self.height - local[:, 1]])


def floor_svg(floors: Sequence[FloorPlan]) -> bytes:
    """Return the floors below one another at one scale, with a legend of their kinds."""
    boxes = [bounds(list(_points(floor))) for floor in floors]
    widest = max((max(box[2] - box[0], box[3] - box[1]) for box in boxes), default=1.0) or 1.0
    scale, top, drawn = WIDTH / widest, MARGIN, []
    for floor, box in zip(floors, boxes, strict=True):
        height = (box[3] - box[1]) * scale
        place = _LabelSpot(box[0], box[1], height, top + MARGIN, scale)
        drawn += [text(MARGIN, top + MARGIN / 2, _title(floor), size=5.0), *_floor(floor, place)]
        top += height + 2 * MARGIN
    drawn += _legend([kind for kind in LOOKS if any(kind in kinds_of(floor) for floor in floors)], top)
    size = f'width="{number(WIDTH + 2 * MARGIN)}mm" height="{number(top + 2 * MARGIN)}mm"'
    box_ = f'viewBox="0 0 {number(WIDTH + 2 * MARGIN)} {number(top + 2 * MARGIN)}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box_} font-family="{FONT}">'
    white = '<rect width="100%" height="100%" fill="#ffffff"/>'
    return "\n".join([head, white, *(item for item in drawn if item), "</svg>\n"]).encode()


def _points(floor: FloorPlan) -> Iterator[FloatArray]:
    yield from (part.exterior for part in floor.outline)
    yield from (part.exterior for item in floor.elements for part in item.solids)


def _title(floor: FloorPlan) -> str:
    return f"{floor.name}: {floor.area:.0f} m², {len(floor.rooms)} rooms, {len(floor.openings)} openings"


def _floor(floor: FloorPlan, place: _LabelSpot) -> Iterator[str]:
    yield path(["".join(_region(part, place) for part in floor.outline)], **FLOOR, **_EVEN_ODD)
    yield from (_room(room, place) for room in floor.rooms)
    for kind in kinds_of(floor):
        shown = (_element(item, place) for item in floor.elements if item.kind == kind)
        yield group(kind, shown, stroke_width=0.18, **LOOKS.get(kind, LOOKS["other"]))
    for kind, look in OPENINGS.items():
        lines = (line_data(place.on_paper(item.line)) for item in floor.openings if item.kind == kind)
        yield path(lines, fill="none", **look)
    yield path((line_data(place.on_paper(item.points)) for item in floor.ignored), fill="none", **IGNORED)
    yield from (_name(room, place) for room in floor.rooms)


def _region(part: Polygon, place: _LabelSpot) -> str:
    return "".join(ring_data(place.on_paper(ring)) for ring in part.rings)


def _room(room: Room, place: _LabelSpot) -> str:
    return path((_region(part, place) for part in room.polygons), **ROOM, **_EVEN_ODD)


def _element(item: Element, place: _LabelSpot) -> str:
    solids = path((_region(part, place) for part in item.solids), **_EVEN_ODD)
    lines = path((line_data(place.on_paper(line)) for line in item.lines), fill="none")
    return f"<g><title>{clean(' '.join(filter(None, (item.id, item.global_id))))}</title>{solids}{lines}</g>"


def _name(room: Room, place: _LabelSpot) -> str:
    low, high = np.array(bounds([part.exterior for part in room.polygons])).reshape(2, 2)
    x, y = place.on_paper(((low + high) / 2)[None])[0].tolist()
    return text(x, y, room.label, size=2.5, text_anchor="middle", fill="#333333")


def _legend(kinds: Sequence[str], top: float) -> Iterator[str]:
    """Yield one swatch per kind, in a row."""
    for index, kind in enumerate(kinds):
        x = MARGIN + 40.0 * index
        corners = np.array([[x, top], [x + 6, top], [x + 6, top + 4], [x, top + 4]])
        yield path([ring_data(corners)], stroke_width=0.18, **LOOKS[kind])
        yield text(x + 8, top + 3.2, kind, size=3.5)
