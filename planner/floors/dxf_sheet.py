"""Interpretation of a DXF before it becomes a floor: layers, unit, drawings, and strokes of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity, Insert

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.planner.floors.drawings import DrawingBox, DrawingFound, chosen_of, drawings_in, is_in
from stopgo.planner.floors.drawn_shapes import Shape, shapes_of
from stopgo.planner.floors.layers import BY_GEOMETRY, Layers, is_layered, missing_in
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.lines_and_texts import Stroke, Word
from stopgo.planner.floors.reader import FloorOptions
from stopgo.planner.floors.strokes import strokes_of
from stopgo.planner.floors.units import unit_of
from stopgo.planner.geometry.instance_cache import instance_cached

_MARGIN = 1.0
"""A stroke this near to a drawing, in metres, belongs to it."""


@dataclass(frozen=True, eq=False)
class DxfSheet:
    """A drawing as interpreted: its strokes and words in metres, and the basis of the interpretation."""

    layers: Layers
    shapes: Sequence[Shape]
    scale: float
    """Metres per drawing unit."""
    strokes: list[Stroke]
    words: list[Word]
    findings: list[Finding]
    layered: bool
    """True if layers with stopgo's own names show all of the floor."""
    outlined: bool
    """True if the layer FLOOR shows the floor."""
    drawings: tuple[DrawingFound, ...] = ()
    """All drawings in the model space, if they were searched."""
    chosen: DrawingFound | None = None
    """The drawing used; None if the user has to choose, or there is none."""


def sheet_of(drawing: Drawing, options: FloorOptions, *, source: Path) -> DxfSheet:
    """Return the sheet of a drawing for these options.

    Raises
    ------
    InputError
        When the given unit makes no building, or the given drawing or region does not exist.
    """
    seen = layers_of(drawing, options, source=source)
    scale, odd_units = unit_of(drawing, seen.shapes, options.units, outlined=seen.outlined, source=source)
    strokes, words, odd_strokes = strokes_of(seen.shapes, scale=scale, chord=options.d_dis)
    sheet = DxfSheet(
        *(seen.layers, seen.shapes, scale, strokes, words, [*odd_units, *seen.findings, *odd_strokes]),
        *(seen.layered, seen.outlined),
    )
    return _one_drawing(_in_region(sheet, options, source), options, source)


@dataclass(frozen=True, eq=False)
class LayersSeen:
    """The shapes of a drawing with the meanings of their layers, before its unit is known."""

    layers: Layers
    shapes: Sequence[Shape]
    findings: list[Finding]
    layered: bool
    """True if layers with stopgo's own names show all of the floor."""
    outlined: bool
    """True if the layer FLOOR shows the floor."""


def layers_of(drawing: Drawing, options: FloorOptions, *, source: Path) -> LayersSeen:
    """Return the shapes of a drawing with the meanings of their layers for these options.

    Raises
    ------
    InputError
        When nothing is drawn in the model space, or far too much.
    """
    meanings = (options.layers, options.layer_map, options.found_layers)
    key = tuple(tuple(sorted(names.items())) for names in meanings)
    known = _last_seen(drawing)
    if key not in known:
        known.clear()
        known[key] = _layers_seen(drawing, options, source)
    return known[key]


@instance_cached
def _last_seen(drawing: Drawing) -> dict[tuple, LayersSeen]:
    """The shapes by the meanings of layers of the last request."""
    return {}


def _layers_seen(drawing: Drawing, options: FloorOptions, source: Path) -> LayersSeen:
    layers = Layers(options.layers, found=options.found_layers)
    shapes, odd = shapes_of(drawing, source=source, layers=layers)
    _check_model_space(drawing, source)
    own = frozenset(shape.role for shape in shapes if not shape.is_text)
    layered = is_layered(own)
    by_name = frozenset[str]() if layered else missing_in(own)
    layers = Layers(options.layers, options.layer_map, options.found_layers, by_name)
    if by_name or options.layer_map:
        shapes, odd = shapes_of(drawing, source=source, layers=layers)
        odd = [*odd, *_by_name(shapes)]
    return LayersSeen(layers, shapes, odd, layered, "floor" in own)


def _check_model_space(drawing: Drawing, source: Path) -> None:
    """Refuse a drawing that is not in the model space but in a paper space or in another file."""
    drawn = [item for item in drawing.modelspace() if item.dxftype() != "VIEWPORT"]
    absent = [name for item in drawn if (name := _absent_block(item)) is not None]
    if len(absent) < len(drawn):
        return
    if absent:
        named = ", ".join(sorted(set(absent))[:5])
        raise InputError(
            f"{source}: holds only external references ({named}), which are other files; bind them "
            "(XREF, Bind) and save it again, or name the file that is referenced"
        )
    paper = {
        legible(layout.name): sum(item.dxftype() != "VIEWPORT" for item in layout)
        for layout in drawing.layouts
        if not layout.is_modelspace
    }
    found = [f"{count} entities are in the paper space '{name}'" for name, count in paper.items() if count]
    if found:
        raise InputError(
            f"{source}: nothing is drawn in the model space; {', '.join(found)}: move them to "
            "the model space (CHSPACE)"
        )


def _absent_block(entity: DXFEntity) -> str | None:
    """Return the name of a block that is not in the file; None for other entities."""
    if not isinstance(entity, Insert):
        return None
    block = entity.block()
    is_absent = block is None or block.block is None or block.block.is_xref
    return legible(str(entity.dxf.get("name"))) if is_absent else None


def _by_name(shapes: Sequence[Shape]) -> list[Finding]:
    """Findings on layers whose meaning comes from other names than stopgo's own."""
    taken = {(shape.layer, shape.role, shape.why) for shape in shapes if shape.role != "other"}
    return [
        Finding(
            "layer_by_name", f"layer {layer} is taken for {role}: {why} ({layer_option(layer)} corrects it)"
        )
        for layer, role, why in sorted(taken)
        if why not in ("its name", "as given", "by the map", BY_GEOMETRY)
    ]


def _in_region(sheet: DxfSheet, options: FloorOptions, source: Path) -> DxfSheet:
    if options.region is None:
        return sheet
    x0, y0, x1, y1 = (value * sheet.scale for value in options.region)
    kept = _within(sheet, (x0, y0, x1, y1), margin=0.0)
    if not kept.strokes:
        raise InputError(
            f"{source}: nothing is drawn in the region {','.join(f'{v:g}' for v in options.region)}; "
            f"the drawing reaches from {_corner(sheet, np.min)} to {_corner(sheet, np.max)} in its own unit"
        )
    return kept


def _corner(sheet: DxfSheet, which: object) -> str:
    points = np.concatenate([item.points for item in sheet.strokes]) / sheet.scale
    corner = points.min(axis=0) if which is np.min else points.max(axis=0)
    return f"{corner[0]:g},{corner[1]:g}"


def _within(sheet: DxfSheet, box: DrawingBox, *, margin: float) -> DxfSheet:
    strokes = [item for item in sheet.strokes if is_in(item.points, box, margin=margin)]
    words = [item for item in sheet.words if item.at and is_in(np.array(item.at[:1]), box, margin=margin)]
    return replace(sheet, strokes=strokes, words=words)


def _one_drawing(sheet: DxfSheet, options: FloorOptions, source: Path) -> DxfSheet:
    """Choose one of several drawings: the one given by the user, else the one that is clearly a plan."""
    if sheet.layered and options.drawing is not None:
        raise InputError(
            f"{source}: --drawing {options.drawing} does not apply: the layers FLOOR, WALLS and so on show "
            "one floor; remove it, or choose a part with --region"
        )
    if sheet.layered or (sheet.outlined and options.drawing is None):
        return sheet
    drawings = tuple(drawings_in(sheet.strokes))
    sheet = replace(sheet, drawings=drawings)
    if options.drawing is not None and not 1 <= options.drawing <= len(drawings):
        raise InputError(
            f"{source}: --drawing {options.drawing}: found are {len(drawings)}{drawings_text(drawings)}"
        )
    chosen = chosen_of(drawings) if options.drawing is None else drawings[options.drawing - 1]
    if chosen is None:
        return sheet
    if len(drawings) == 1:
        return replace(sheet, chosen=chosen)
    number = drawings.index(chosen) + 1
    why = (
        "as given"
        if options.drawing
        else "the only one with door swings"
        if chosen.swings
        else "the largest by far"
    )
    found = Finding(
        "drawings_found",
        f"{len(drawings)} drawings side by side: number {number} is taken, {why}{drawings_text(drawings)}",
    )
    return replace(
        _within(sheet, chosen.box, margin=_MARGIN), chosen=chosen, findings=[*sheet.findings, found]
    )


def drawings_text(drawings: Sequence[DrawingFound], *, most: int = 20) -> str:
    """The drawings by number, each with its size and contents, in words; of very many the first."""
    if not drawings:
        return ""
    more = f"; and {len(drawings) - most} more" if len(drawings) > most else ""
    return ": " + "; ".join(f"{k} is {item.description}" for k, item in enumerate(drawings[:most], 1)) + more
