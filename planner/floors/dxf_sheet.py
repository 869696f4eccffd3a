"""Interpretation of a DXF before it becomes a floor: layers, unit, drawings, and strokes of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from ezdxf.document import Drawing

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawing import given_unit, metres_per_unit
from stopgo.planner.floors.drawings import DrawingBox, DrawingFound, chosen_of, drawings_in, is_in
from stopgo.planner.floors.drawn_shapes import Shape, shapes_of
from stopgo.planner.floors.layers import Layers, is_layered, missing_in
from stopgo.planner.floors.linework.swings import radii_in
from stopgo.planner.floors.reader import FloorOptions
from stopgo.planner.floors.strokes import Stroke, Word, sketch, strokes_of

_MARGIN = 1.0
"""A stroke this near to a drawing, in metres, belongs to it."""
_HOUSE = 30.0


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
    shapes, odd = shapes_of(drawing, source=source, layers=Layers(options.layers))
    own = frozenset(shape.role for shape in shapes if not shape.is_text)
    layered = is_layered(own)
    by_name = frozenset[str]() if layered else missing_in(own)
    layers = Layers(options.layers, options.layer_map, by_name)
    if by_name or options.layer_map:
        shapes, odd = shapes_of(drawing, source=source, layers=layers)
        odd = [*odd, *_by_name(shapes)]
    outlined = "floor" in own
    scale, odd_units = scale_of(drawing, shapes, options, outlined=outlined, source=source)
    strokes, words, odd_strokes = strokes_of(shapes, scale=scale, chord=options.d_dis)
    sheet = DxfSheet(
        layers, shapes, scale, strokes, words, [*odd_units, *odd, *odd_strokes], layered, outlined
    )
    return _one_drawing(_in_region(sheet, options, source), options, source)


def _by_name(shapes: Sequence[Shape]) -> list[Finding]:
    """Findings on layers whose meaning comes from other names than stopgo's own."""
    taken = {(shape.layer, shape.role, shape.why) for shape in shapes if shape.role != "other"}
    return [
        Finding(
            "layer_by_name", f"layer {layer} is taken for {role}: {why} (--layer {layer}=KIND corrects it)"
        )
        for layer, role, why in sorted(taken)
        if why not in ("its name", "as given", "by the map")
    ]


def scale_of(
    drawing: Drawing, shapes: Sequence[Shape], options: FloorOptions, *, outlined: bool, source: Path
) -> tuple[float, list[Finding]]:
    """Metres per drawing unit: as given, else by the header, the floor's size and the doors' widths."""
    points = _extent(shapes, "floor" if outlined else "walls")
    if options.units is not None:
        return given_unit(options.units, points, source=source)
    widths = _door_widths(shapes, outlined=outlined)
    return metres_per_unit(drawing, floor=points, doors=widths, leaves=not outlined)


def _extent(shapes: Sequence[Shape], role: str) -> FloatArray:
    drawn = [shape for shape in shapes if not shape.is_text]
    sketched = sketch(shape for shape in drawn if shape.role == role)
    if not sketched and role == "walls":
        sketched = sketch(drawn)
    return np.vstack(sketched) if sketched else np.empty((0, 2))


def _door_widths(shapes: Sequence[Shape], *, outlined: bool) -> list[float]:
    """Lengths of lines across doors, or of swinging leaves, in drawing units."""
    if outlined:
        lines = sketch(
            shape for shape in shapes if shape.role == "doors" and shape.entity.dxftype() == "LINE"
        )
        widths = [float(np.hypot(*(line[-1] - line[0]))) for line in lines]
        return [width for width in widths if width > 0]
    for roles in (("doors", "openings"), ("walls", "other")):
        own = [shape for shape in shapes if shape.role in roles and not (shape.is_text or shape.is_note)]
        radii = _radii(own)
        if radii:
            return radii
    return []


def _radii(shapes: Sequence[Shape]) -> list[float]:
    """Radii of quarter arcs in drawing units; searched as if the drawing had the size of a house."""
    sketched = sketch(shapes)
    size = float(np.ptp(np.vstack(sketched), axis=0).max()) if sketched else 0.0
    if not size:
        return []
    scale = _HOUSE / size
    strokes, _, _ = strokes_of(shapes, scale=scale, chord=1e9)
    return [radius / scale for radius in radii_in(stroke.points for stroke in strokes)]


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


def drawings_text(drawings: Sequence[DrawingFound]) -> str:
    """The drawings by number, each with its size and contents, in words."""
    if not drawings:
        return ""
    return ": " + "; ".join(f"{k} is {item.description}" for k, item in enumerate(drawings, start=1))
