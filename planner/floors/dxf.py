"""Reads a layered DXF: one floor, its layers named FLOOR, ROOMS, WALLS and so on.

The bytes become a drawing, the drawing shapes on layers, these strokes in metres, the strokes a floor plan.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from ezdxf.document import Drawing

from mission.floor import Finding, FloorPlan
from mission.floor_source import FloorSource
from mission.geometry import bounds
from planner.floors.drawing import metres_per_unit, open_drawing
from planner.floors.drawn_shapes import Shape, shapes_of
from planner.floors.parts import in_order, parts_of
from planner.floors.reader import FloorFile, FloorOptions
from planner.floors.strokes import sketch, strokes_of
from planner.floors.survey import FloorChoice, LayerUse, Survey


def read(file: FloorFile, options: FloorOptions) -> FloorPlan:
    """The floor that a DXF holds.

    Raises
    ------
    InputError
        When the bytes are no complete DXF, or no closed outline lies on layer FLOOR.
    """
    drawing, odd_file = open_drawing(file.data, source=file.path)
    floor = floor_in(
        drawing, source=file.path, digest=file.digest, d_dis=options.d_dis, layers=options.layers
    )
    return replace(floor, findings=in_order((*odd_file, *floor.findings)))


def survey(file: FloorFile, options: FloorOptions) -> Survey:
    """What a layered DXF holds: one floor, and what each of its layers stands for."""
    drawing, _ = open_drawing(file.data, source=file.path)
    floor = read(file, options)
    return Survey(
        file=file.path.name,
        kind=f"DXF drawing, {drawing.dxfversion}",
        digest=file.digest,
        floors=(_choice(floor),),
        layers=_layers(drawing, source=file.path, told=options.layers),
        findings=floor.findings,
    )


def _choice(floor: FloorPlan) -> FloorChoice:
    kinds = (*(item.kind for item in floor.elements), *(f"{item.kind}s" for item in floor.openings))
    return FloorChoice(
        name=floor.name,
        option="",
        area_m2=floor.area,
        bounds=bounds([part.exterior for part in floor.outline]),
        elements={"rooms": len(floor.rooms), **Counter(kinds)},
        chosen=True,
    )


def _layers(drawing: Drawing, *, source: Path, told: Mapping[str, str]) -> tuple[LayerUse, ...]:
    """What each layer that holds anything was taken for."""
    shapes, _ = shapes_of(drawing, source=source, layers=told)
    counts = Counter((shape.layer, shape.role) for shape in shapes)
    return tuple(
        LayerUse(layer, role, "as told" if layer.upper() in told else "its name", taken=count)
        if role != "other"
        else LayerUse(layer, role, "no known name", ignored=count)
        for (layer, role), count in sorted(counts.items())
    )


def floor_in(
    drawing: Drawing, *, source: Path, digest: str, d_dis: float, layers: Mapping[str, str] | None = None
) -> FloorPlan:
    """The floor drawn in the model space of a drawing, whatever file it is from."""
    shapes, odd_shapes = shapes_of(drawing, source=source, layers=layers or {})
    scale, odd_units = _scale(drawing, shapes)
    strokes, words, odd_strokes = strokes_of(shapes, scale=scale, chord=d_dis)
    present = [shape.layer for shape in shapes]
    parts = parts_of(strokes, words, source=source, layers=present, skipped=_skipped(odd_strokes))
    return FloorPlan(
        name=source.stem,
        source=FloorSource(source.name, digest),
        outline=parts.outline,
        rooms=parts.rooms,
        openings=parts.openings,
        elements=parts.elements,
        ignored=parts.ignored,
        findings=in_order((*odd_units, *odd_shapes, *odd_strokes, *parts.findings)),
    )


def metres_in(drawing: Drawing, *, source: Path) -> float:
    """Length of one drawing unit in metres, as `read` takes it: what is drawn over a floor needs it."""
    shapes, _ = shapes_of(drawing, source=source)
    return _scale(drawing, shapes)[0]


def _scale(drawing: Drawing, shapes: Sequence[Shape]) -> tuple[float, list[Finding]]:
    floor = sketch(shape for shape in shapes if shape.role == "floor" and not shape.is_text)
    doors = sketch(shape for shape in shapes if shape.role == "doors" and shape.entity.dxftype() == "LINE")
    widths = [float(np.hypot(*(line[-1] - line[0]))) for line in doors]
    points = np.vstack(floor) if floor else np.empty((0, 2))
    return metres_per_unit(drawing, floor=points, doors=[width for width in widths if width > 0])


def _skipped(findings: Sequence[Finding]) -> str:
    """The first damaged shape on FLOOR, for the error about an outline that is missing because of it."""
    damaged = [finding.message for finding in findings if "on FLOOR is skipped" in finding.message]
    return f" ({damaged[0]})" if damaged else ""
