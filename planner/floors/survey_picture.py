"""Picture of a survey: used shapes in their kind's colour, ignored shapes in grey."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from stopgo.mission.files.floor_drawing import LOOKS
from stopgo.mission.files.svg import attributes, group, line_data, path, rect, ring_data, text
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray, bounds
from stopgo.planner.floors.survey import SurveyLine

_SIZE = 280.0
"""The longer side of the picture, in millimetres."""
_EDGE = 8.0
_IGNORED = {"stroke": "#c9c9c9", "stroke_width": 0.15, "fill": "none"}
_OPENING = {"stroke": "#0b63b0", "stroke_width": 0.6, "fill": "none"}


def survey_svg(lines: Sequence[SurveyLine], floor: FloorPlan | None, *, title: str) -> bytes:
    """Return the picture as SVG; without a floor only the lines are drawn."""
    paper = _Paper(_everything(lines, floor))
    body = [
        rect(0.0, 0.0, paper.width, paper.height, fill="#ffffff"),
        *(_floor(floor, paper) if floor else ()),
        group("ignored", [path(_data(lines, paper, taken=False))], **_IGNORED),
        *_elements(floor, lines, paper),
        text(_EDGE, paper.height - 3.0, title, size=3.0, fill="#333"),
        text(
            paper.width - _EDGE, paper.height - 3.0, _legend(floor), size=2.4, fill="#333", text_anchor="end"
        ),
    ]
    size = {"width": f"{paper.width:.1f}mm", "height": f"{paper.height:.1f}mm"}
    view = {"viewBox": f"0 0 {paper.width:.2f} {paper.height:.2f}"}
    head = f'<svg xmlns="http://www.w3.org/2000/svg"{attributes(size)} viewBox="{view["viewBox"]}">'
    return "\n".join([head, *(item for item in body if item), "</svg>\n"]).encode("utf-8", errors="replace")


def _everything(lines: Sequence[SurveyLine], floor: FloorPlan | None) -> Iterator[FloatArray]:
    """Points that the picture must show: the floor, else all lines."""
    if floor is None:
        yield from (line.points for line in lines)
        return
    yield from (part.exterior for part in floor.outline)
    for item in floor.elements:
        yield from (*(solid.exterior for solid in item.solids), *item.lines)


class _Paper:
    """Position on the paper of a point of the floor."""

    def __init__(self, parts: Iterable[FloatArray]) -> None:
        x0, y0, x1, y1 = bounds(parts)
        self._low, self._top = np.array([x0, y0]), y1
        self._scale = _SIZE / max(x1 - x0, y1 - y0, 1e-3)
        self.width = (x1 - x0) * self._scale + 2 * _EDGE
        self.height = (y1 - y0) * self._scale + 3 * _EDGE

    def place(self, points: FloatArray) -> FloatArray:
        """Millimetres from the left and from the top."""
        x = (points[:, 0] - self._low[0]) * self._scale + _EDGE
        return np.column_stack((x, (self._top - points[:, 1]) * self._scale + _EDGE))


def _floor(floor: FloorPlan, paper: _Paper) -> Iterator[str]:
    outline = [ring_data(paper.place(ring)) for part in floor.outline for ring in part.rings]
    rooms = [
        ring_data(paper.place(ring)) for room in floor.rooms for part in room.polygons for ring in part.rings
    ]
    yield group(
        "floor", [path(outline)], fill="#f6e7c8", stroke="#b08a3c", stroke_width=0.3, fill_rule="evenodd"
    )
    yield group(
        "rooms", [path(rooms)], fill="#e6f2e4", stroke="#7da676", stroke_width=0.2, fill_rule="evenodd"
    )


def _elements(floor: FloorPlan | None, lines: Sequence[SurveyLine], paper: _Paper) -> Iterator[str]:
    if floor is None:
        yield group(
            "taken", [path(_data(lines, paper, taken=True))], stroke="#333", stroke_width=0.2, fill="none"
        )
        return
    for kind in dict.fromkeys(item.kind for item in floor.elements):
        own = [item for item in floor.elements if item.kind == kind]
        solids = [ring_data(paper.place(ring)) for item in own for part in item.solids for ring in part.rings]
        open_lines = [line_data(paper.place(line)) for item in own for line in item.lines]
        look = LOOKS.get(kind, LOOKS["other"])
        yield group(kind, [path(solids)], stroke_width=0.15, fill_rule="evenodd", **look)
        yield group(f"{kind}-lines", [path(open_lines)], stroke_width=0.25, **{**look, "fill": "none"})
    across = [line_data(paper.place(item.line)) for item in floor.openings]
    yield group("openings", [path(across)], **_OPENING)


def _data(lines: Iterable[SurveyLine], paper: _Paper, *, taken: bool) -> list[str]:
    own = [item for item in lines if item.taken == taken]
    return [(ring_data if item.closed else line_data)(paper.place(item.points)) for item in own]


def _legend(floor: FloorPlan | None) -> str:
    if floor is None:
        return "no floor was found; black: taken, light grey: ignored"
    kinds = ", ".join(dict.fromkeys(item.kind for item in floor.elements))
    return (
        f"green: rooms; sand: floor in no room; blue: doors and passages; light grey: ignored; kinds: {kinds}"
    )
