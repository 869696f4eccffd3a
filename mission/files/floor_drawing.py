"""The building and its coverage as drawn in the lower layers of plan.svg."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from stopgo.mission.files.sheet import PaperMap, PaperSheet
from stopgo.mission.files.svg import clean, group, lines_data, number, path
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, Polygon
from stopgo.mission.settings.element_kinds import kind_of
from stopgo.mission.stages import NavigableSpace, OpeningState, Selection, Targets
from stopgo.mission.stages.covered_intervals import lines_along, seen_units

FLOOR: dict[str, object] = {"fill": "#f3f0dc", "stroke": "#555", "stroke_width": 0.25}
ROOM: dict[str, object] = {"fill": "#ffffff", "stroke": "#b5b5b5", "stroke_width": 0.1}
SEEN: dict[str, Any] = {"stroke": "#1a8f3c", "stroke_width": 0.5}
UNSEEN: dict[str, Any] = {"stroke": "#d7191c", "stroke_width": 0.8}
HIDDEN: dict[str, Any] = {"stroke": "#ee9a7b", "stroke_width": 0.3}
THINNER = {50: 1.0, 100: 0.8, 200: 0.65}
"""Factors of stroke width: at small scales a wall is hardly wider than the stroke along its face."""
PASSABLE: dict[str, object] = {"stroke": "#0b63b0", "stroke_width": 0.4}
BLOCKED: dict[str, object] = {"stroke": "#e07b00", "stroke_width": 0.5}


def look_of(kind: str) -> dict[str, object]:
    """Return fill and stroke of an element kind; overhead kinds are dashed."""
    row = kind_of(kind)
    dashes = {"stroke_dasharray": "1.6 0.8"} if row.fill == "none" else {}
    return {"fill": row.fill, "stroke": row.colour, "stroke_width": 0.18, **dashes}


def building(space: NavigableSpace, sheet: PaperSheet) -> Iterator[str]:
    """Floor, rooms, elements by kind, and openings."""
    yield from floor_layers(space.floor, sheet)
    yield from _openings(space.openings, sheet)


def floor_layers(floor: FloorPlan, paper: PaperSheet | PaperMap, *, named: bool = False) -> Iterator[str]:
    """Yield floor, rooms, and elements by kind; `named` gives every element a tooltip, not only a model's."""
    yield group("floor", [path([_regions(floor.outline, paper)])], **FLOOR, **_EVEN_ODD)
    rooms = _regions((part for room in floor.rooms for part in room.polygons), paper)
    yield group("rooms", [path([rooms])], **ROOM, **_EVEN_ODD)
    for kind in kinds_of(floor):
        elements = [item for item in floor.elements if item.kind == kind]
        yield group(kind, _elements(elements, paper, named=named), **look_of(kind))


def outline(floor: FloorPlan, sheet: PaperSheet) -> str:
    """Return the floor's outline alone."""
    return path(
        [_regions(floor.outline, sheet)], fill="#e4e4e0", stroke="#888888", stroke_width=0.15, **_EVEN_ODD
    )


def targets(selection: Selection, sheet: PaperSheet) -> Iterator[str]:
    """Yield the targets' faces: hidden from every candidate, visible but not seen, and seen."""
    visibility = selection.visibility
    seen = seen_units(selection)
    layers = (
        ("hidden", ~visibility.visible, HIDDEN),
        ("seen", seen, SEEN),
        ("unseen", visibility.visible & ~seen, UNSEEN),
    )
    for name, units, look in layers:
        width = {"stroke_width": THINNER.get(sheet.scale, 0.5) * look["stroke_width"]}
        strokes = path([_strokes(visibility.targets, units, sheet)])
        yield group(name, [strokes], fill="none", **{**look, **width})


def kinds_of(floor: FloorPlan) -> list[str]:
    """Return the kinds on this floor in drawing order: overhead and thin elements come last."""
    there = {item.kind for item in floor.elements}
    known = [kind for kind in _ORDER if kind in there]
    return known + sorted(there - set(known))


_ORDER = ("stairs", "other", "objects", "walls", "windows", "columns", "railings", "beams")
_EVEN_ODD: dict[str, object] = {"fill_rule": "evenodd"}


def cross(at: FloatArray, *, size: float) -> str:
    """Return the path data of an ×."""
    x, y = at.tolist()
    return f"M{number(x - size)} {number(y - size)}l{number(2 * size)} {number(2 * size)}" + (
        f"M{number(x - size)} {number(y + size)}l{number(2 * size)} {number(-2 * size)}"
    )


def _regions(parts: Iterable[Polygon], sheet: PaperSheet | PaperMap) -> str:
    return _lines_on(sheet, (ring for part in parts for ring in part.rings), end="Z")


def _lines_on(sheet: PaperSheet | PaperMap, lines: Iterable[FloatArray], *, end: str = "") -> str:
    """Return the path data of polylines (n, 2), which are put on paper together."""
    drawn = [line for line in lines if len(line)]
    return lines_data(sheet.on_paper(np.concatenate(drawn)), map(len, drawn), end=end) if drawn else ""


def _elements(elements: list[Element], sheet: PaperSheet | PaperMap, *, named: bool) -> Iterator[str]:
    """Yield the elements; those of a model are separate shapes with a tooltip."""
    yield from (_named(item, sheet) for item in elements if named or item.global_id)
    elements = [] if named else [item for item in elements if not item.global_id]
    yield path([_regions((part for item in elements for part in item.solids), sheet)], **_EVEN_ODD)
    yield path([_lines_on(sheet, (line for item in elements for line in item.lines))], fill="none")


def _named(item: Element, sheet: PaperSheet | PaperMap) -> str:
    solids = path([_regions(item.solids, sheet)], **_EVEN_ODD)
    lines = path([_lines_on(sheet, item.lines)], fill="none")
    name = " ".join(filter(None, (item.id, item.global_id)))
    return f"<g><title>{clean(name)}</title>{solids}{lines}</g>"


def _openings(openings: tuple[OpeningState, ...], sheet: PaperSheet) -> Iterator[str]:
    """Yield the openings: passable ones as a line from jamb to jamb, others with an ×; passages dashed."""
    for name, passable, look in (("passable", True, PASSABLE), ("blocked", False, BLOCKED)):
        chosen = [state for state in openings if state.passable == passable]
        marks = [] if passable else [cross(_middle(state, sheet), size=1.1) for state in chosen]
        yield group(
            name,
            (_lines(chosen, "door", sheet), _lines(chosen, "passage", sheet), path(marks)),
            fill="none",
            **look,
        )


def _lines(openings: list[OpeningState], kind: str, sheet: PaperSheet) -> str:
    data = _lines_on(sheet, (item.opening.line for item in openings if item.opening.kind == kind))
    return path([data], **({"stroke_dasharray": "1.2 0.7"} if kind == "passage" else {}))


def _middle(state: OpeningState, sheet: PaperSheet) -> FloatArray:
    return sheet.on_paper(state.opening.line.mean(axis=0))


def _strokes(targets: Targets, units: BoolArray, sheet: PaperSheet) -> str:
    """Return the path data of the units of a mask; adjoining stretches become one polyline."""
    lines = lines_along(targets, units)
    begins, ends = sheet.on_paper(lines[:, 0]), sheet.on_paper(lines[:, 1])
    apart = np.abs(begins[1:] - ends[:-1]).max(axis=1, initial=0.0) > 0.005
    first = np.flatnonzero(np.concatenate([np.ones(len(begins[:1]), dtype=bool), apart]))
    lengths = np.diff(first, append=len(begins)) + 1
    return lines_data(np.insert(ends, first, begins[first], axis=0), lengths.tolist())
