"""Drawings of floors as read, before planning: the recognised elements, and the ignored lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from stopgo.mission.console.table import counted
from stopgo.mission.files.floor_drawing import PASSABLE, floor_layers, kinds_of, look_of
from stopgo.mission.files.sheet import PaperMap
from stopgo.mission.files.svg import FONT, group, line_data, number, path, rect, text
from stopgo.mission.floor import FloorPlan, Room
from stopgo.mission.geometry import FloatArray, bounds

WIDTH = 400.0
"""Millimetres of paper that the largest floor takes …"""
MARGIN = 12.0
"""… with this margin around it, for its name."""
TAKEN: dict[str, object] = {"stroke": "#333333", "stroke_width": 0.2, "fill": "none"}
IGNORED: dict[str, object] = {"stroke": "#c9c9c9", "stroke_width": 0.2, "fill": "none"}
OPENINGS: dict[str, dict[str, object]] = {"door": {}, "passage": {"stroke_dasharray": "1.4 0.8"}}
NO_FLOOR = "no floor was found; dark: recognised lines, light grey: ignored lines"
Lines = Sequence[FloatArray]


def floor_svg(floors: Sequence[FloorPlan], *, taken: Lines = (), ignored: Lines = ()) -> bytes:
    """Return the floors below one another at one scale, with a legend of their kinds.

    `ignored` lines (n, 2) are drawn on every floor, beneath its elements. Without a floor, they and
    the `taken` ones are the picture.
    """
    boxes = [bounds(list(_points(floor))) for floor in floors] or [bounds([*taken, *ignored])]
    scale, top = WIDTH / (max(max(box[2] - box[0], box[3] - box[1]) for box in boxes) or 1.0), MARGIN
    drawn: list[str] = []
    for floor, box in zip(floors or (None,), boxes, strict=True):
        paper = PaperMap((box[0], box[3]), (MARGIN, top + MARGIN), scale)
        drawn.append(text(MARGIN, top + MARGIN / 2, _title(floor), size=5.0))
        beneath = group("ignored", [_lines(ignored, paper)], **IGNORED)
        drawn += [*_floor(floor, beneath, paper)] if floor else [beneath, _lines(taken, paper, **TAKEN)]
        top += (box[3] - box[1]) * scale + 2 * MARGIN
    kinds = dict.fromkeys(kind for floor in floors for kind in kinds_of(floor))
    return _document([*drawn, *_legend(list(kinds), top)], top + 2 * MARGIN)


def _document(drawn: Iterable[str], height: float) -> bytes:
    size = f'width="{number(WIDTH + 2 * MARGIN)}mm" height="{number(height)}mm"'
    box = f'viewBox="0 0 {number(WIDTH + 2 * MARGIN)} {number(height)}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box} font-family="{FONT}">'
    white = '<rect width="100%" height="100%" fill="#ffffff"/>'
    return "\n".join([head, white, *filter(None, drawn), "</svg>\n"]).encode("utf-8", errors="replace")


def _points(floor: FloorPlan) -> Iterator[FloatArray]:
    yield from (part.exterior for part in floor.outline)
    for item in floor.elements:
        yield from (*(part.exterior for part in item.solids), *item.lines)


def _title(floor: FloorPlan | None) -> str:
    if floor is None:
        return NO_FLOOR
    parts = f"{counted(len(floor.rooms), 'room')}, {counted(len(floor.openings), 'opening')}"
    return f"{floor.name}: {floor.area:.0f} m², {parts}"


def _floor(floor: FloorPlan, beneath: str, paper: PaperMap) -> Iterator[str]:
    area, rooms, *kinds = floor_layers(floor, paper, named=True)
    own = _lines([item.points for item in floor.ignored], paper, **IGNORED)
    yield from (area, rooms, beneath, own, *kinds)
    for kind, look in OPENINGS.items():
        lines = [item.line for item in floor.openings if item.kind == kind]
        yield _lines(lines, paper, fill="none", **{**PASSABLE, "stroke_width": 0.6, **look})
    yield from (_name(room, paper) for room in floor.rooms)


def _lines(lines: Lines, paper: PaperMap, **look: object) -> str:
    return path((line_data(paper.on_paper(line)) for line in lines), **look)


def _name(room: Room, paper: PaperMap) -> str:
    low, high = np.array(bounds([part.exterior for part in room.polygons])).reshape(2, 2)
    x, y = paper.on_paper((low + high) / 2).tolist()
    return text(x, y, room.label, size=2.5, text_anchor="middle", fill="#333333")


def _legend(kinds: Sequence[str], top: float) -> Iterator[str]:
    """Yield one swatch per kind, in a row."""
    for index, kind in enumerate(kinds):
        x = MARGIN + 40.0 * index
        yield rect(x, top, 6.0, 4.0, **look_of(kind))
        yield text(x + 8, top + 3.2, kind, size=3.5)
