"""Turns placed shapes into strokes, polylines in metres, and texts into words; leaves out what is damaged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from ezdxf.entities import LWPolyline
from ezdxf.math import OCS, Z_AXIS, Matrix44, Vec3

from mission.floor import KINDS, Finding
from mission.geometry import FloatArray, frozen
from planner.floors.curves import LARGEST, Curve, Fineness, curves_of
from planner.floors.drawing import BROKEN_INPUT
from planner.floors.shapes import Shape

SAGITTA = 0.001
"""Greatest distance in metres between a curve and its chords."""
_COARSE = Fineness(chord=LARGEST, sagitta=LARGEST)


@dataclass(frozen=True, eq=False)
class Stroke:
    """A polyline (n, 2) in metres on a layer; `closed` strokes do not repeat their first point."""

    points: FloatArray
    layer: str
    role: str
    closed: bool = False
    curved: bool = False
    fill: bool = False
    """One boundary of a hatch."""
    global_id: str | None = None


@dataclass(frozen=True, eq=False)
class Word:
    """A text and the points that may stand for it: where it is inserted, where it is aligned."""

    text: str
    layer: str
    role: str
    at: tuple[tuple[float, float], ...]


def sketch(shapes: Iterable[Shape]) -> list[FloatArray]:
    """The points (n, 2) of each shape in drawing units, coarsely: enough to see how large it is."""
    sketches = []
    for shape in shapes:
        try:
            sketches += [points for points, _ in _placed(shape, _COARSE)]
        except BROKEN_INPUT:
            continue  # strokes_of meets it again and reports it
    return sketches


def strokes_of(
    shapes: Sequence[Shape], *, scale: float, chord: float
) -> tuple[list[Stroke], list[Word], list[Finding]]:
    """Strokes and words in metres, and a finding for each shape that could not be used.

    Parameters
    ----------
    scale
        Metres per drawing unit.
    chord
        Greatest length in metres of a chord of a curve.
    """
    strokes: list[Stroke] = []
    words: list[Word] = []
    findings: list[Finding] = []
    for shape in shapes:
        try:
            if shape.is_text:
                words.append(_word(shape, scale=scale))
            elif not shape.is_note:
                strokes += _strokes(shape, scale=scale, chord=chord)
        except TypeError as error:
            findings.append(Finding("unreadable_entity", f"{shape.name}: has no outline to read ({error})"))
        except BROKEN_INPUT as error:
            findings.append(_damage(shape, error, scale=scale))
    return strokes, words, findings


def _strokes(shape: Shape, *, scale: float, chord: float) -> list[Stroke]:
    stretch = scale * _stretch(shape.matrix)
    outside = shape.role in KINDS
    fineness = Fineness(chord=chord / stretch, sagitta=SAGITTA / stretch, outside=outside)
    return [
        Stroke(
            frozen(points * scale),
            shape.layer,
            shape.role,
            closed=curve.closed,
            curved=curve.curved,
            fill=shape.entity.dxftype() in ("HATCH", "MPOLYGON"),
            global_id=shape.global_id,
        )
        for points, curve in _placed(shape, fineness)
    ]


def _placed(shape: Shape, fineness: Fineness) -> list[tuple[FloatArray, Curve]]:
    """Each curve with its points (n, 2) in the world, in drawing units."""
    placed = [(_flat(curve.points, shape.matrix), curve) for curve in curves_of(shape.entity, fineness)]
    for points, _ in placed:
        if not (np.isfinite(points).all() and (np.abs(points) <= LARGEST).all()):
            raise ValueError("a coordinate is not a number or beyond any building")
    return placed


def _flat(points: FloatArray, matrix: Matrix44 | None) -> FloatArray:
    if matrix is None:
        return points[:, :2]
    moved = [point.xyz for point in matrix.transform_vertices([Vec3(*point) for point in points])]
    return np.array(moved, dtype=np.float64).reshape(-1, 3)[:, :2]


def _stretch(matrix: Matrix44 | None) -> float:
    """The greatest factor by which a placement lengthens anything in plan."""
    if matrix is None:
        return 1.0
    lengths = [matrix.transform_direction(axis).magnitude for axis in (Vec3(1, 0, 0), Vec3(0, 1, 0))]
    stretch = max(lengths)
    if not 1e-9 < stretch < LARGEST:
        raise ValueError(f"its block is scaled by {stretch:g}")
    return stretch


def _word(shape: Shape, *, scale: float) -> Word:
    entity = shape.entity
    text = entity.plain_text() if hasattr(entity, "plain_text") else str(entity.dxf.text)
    values = entity.dxf.all_existing_dxf_attribs()
    points = [values[key] for key in ("insert", "align_point") if key in values]
    # MTEXT is placed in the world, TEXT in a plane of its own.
    plane = OCS(values.get("extrusion", Z_AXIS)) if entity.dxftype() != "MTEXT" else OCS()
    world = [plane.to_wcs(Vec3(point)).xyz for point in points]
    placed = _flat(np.array(world).reshape(-1, 3), shape.matrix) * scale
    at = tuple((float(x), float(y)) for x, y in placed)
    return Word(" ".join(text.split()), shape.layer, shape.role, at)


def _damage(shape: Shape, error: Exception, *, scale: float) -> Finding:
    message = f"{shape.name}: skipped, {' '.join(str(error).split()) or type(error).__name__}"
    return Finding("bad_coordinates", message, at=_place(shape, scale=scale))


def _place(shape: Shape, *, scale: float) -> tuple[float, float] | None:
    """The first sound point of a damaged shape, where its block is drawn."""
    values = shape.entity.dxf.all_existing_dxf_attribs()
    named = [values.get(key) for key in ("start", "end", "center", "insert", "vtx0", "vtx1")]
    listed = shape.entity.get_points("xy") if isinstance(shape.entity, LWPolyline) else []
    for point in [Vec3(item) for item in (*named, *listed) if item is not None]:
        x, y = point.x * scale, point.y * scale
        if abs(x) <= LARGEST and abs(y) <= LARGEST:
            return (x, y)
    return None
