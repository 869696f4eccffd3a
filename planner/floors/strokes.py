"""Strokes and words from placed shapes: polylines in metres and texts; damaged shapes are left out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from ezdxf.entities import LWPolyline
from ezdxf.math import OCS, Z_AXIS, Matrix44, Vec3

from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray, frozen, ring_area
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.curves import LARGEST, Curve, Fineness, curves_of
from stopgo.planner.floors.drawing import BROKEN_INPUT
from stopgo.planner.floors.drawn_shapes import Shape
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.lines_and_texts import Stroke, Word
from stopgo.planner.floors.rings import depths

SAGITTA = 0.001
"""Greatest distance in metres between a curve and its chords."""
SMALLEST = 1e-12
"""A coordinate nearer to 0 than this, in any unit, is 0: so small a number cannot be divided by."""
_COARSE = Fineness(chord=LARGEST, sagitta=LARGEST)


def sketch(shapes: Iterable[Shape]) -> list[FloatArray]:
    """Coarse points (n, 2) of each shape in drawing units, enough to measure its size."""
    sketches: list[FloatArray] = []
    for shape in shapes:
        if "sketch" not in shape.memo:
            shape.memo["sketch"] = _sketch(shape)
        sketches += shape.memo["sketch"]
    return sketches


def _sketch(shape: Shape) -> list[FloatArray]:
    try:
        placed = _placed if _is_straight(shape) else _placed_curves
        return [points for points, _ in placed(shape, _COARSE)]
    except BROKEN_INPUT:
        return []  # strokes_of meets it again and reports it


def strokes_of(
    shapes: Sequence[Shape], *, scale: float, chord: float
) -> tuple[list[Stroke], list[Word], list[Finding]]:
    """Strokes and words in metres, and findings about shapes that could not be used.

    Parameters
    ----------
    scale
        Metres per drawing unit.
    chord
        Greatest length in metres of a chord of a curve.
    """
    strokes: list[Stroke] = []
    words: list[Word] = []
    odd: list[Finding] = []
    solid: Counter[tuple[str, str]] = Counter()
    for shape in shapes:
        try:
            if shape.is_text or shape.is_note:
                words.append(word_of(shape, scale=scale))
            else:
                strokes += _strokes(shape, scale=scale, chord=chord)
                odd += _width(shape, scale=scale)
        except TypeError:
            solid[shape.layer, shape.kind] += 1
        except BROKEN_INPUT as error:
            odd.append(_damage(shape, error, scale=scale))
    return strokes, words, [*odd, *_without_outline(solid)]


def _strokes(shape: Shape, *, scale: float, chord: float) -> list[Stroke]:
    stretch = scale * stretch_of(shape.matrix)
    outside = shape.role in KINDS
    fineness = Fineness(chord=chord / stretch, sagitta=SAGITTA / stretch, outside=outside)
    strokes = [
        Stroke(
            frozen(points * scale),
            shape.layer,
            shape.role,
            closed=curve.closed,
            curved=curve.curved,
            global_id=shape.global_id,
        )
        for points, curve in _placed(shape, fineness)
    ]
    return _filled(strokes) if shape.kind in ("HATCH", "MPOLYGON") else strokes


def _filled(boundaries: Sequence[Stroke]) -> list[Stroke]:
    """Boundaries of a hatch, oriented by their nesting depth: every second one is a hole."""
    rings = [item for item in boundaries if len(item.points) >= 3]
    drawn = [shapely.Polygon(item.points) for item in rings]
    nested = depths(shapely.make_valid(drawn, method="structure", keep_collapsed=False).tolist())
    return [
        replace(item, points=_turned(item.points, depth), fill=True)
        for item, depth in zip(rings, nested, strict=True)
    ]


def _turned(ring: FloatArray, depth: int) -> FloatArray:
    clockwise = ring_area(ring) < 0
    return frozen(ring[::-1]) if clockwise != bool(depth % 2) else ring


def _width(shape: Shape, *, scale: float) -> list[Finding]:
    """A polyline that is drawn as a band: its width is lost, and with it clearance."""
    if shape.role == "other" or not isinstance(shape.entity, LWPolyline) or not shape.entity.has_width:
        return []
    widest = max(width for *_, start, end in shape.entity.get_points("xyse") for width in (start, end))
    width = max(float(shape.entity.dxf.const_width), widest) * scale
    message = f"{shape.name} is drawn {width:.3g} m wide and read as its middle line"
    return [Finding("wide_line", message, at=_place(shape, scale=scale))]


def _placed(shape: Shape, fineness: Fineness) -> list[tuple[FloatArray, Curve]]:
    """Each curve with its points (n, 2) in the world, in drawing units; trials of layers compute it once."""
    known = shape.memo.get("placed")
    if known is None or (known[0] != fineness and not _is_straight(shape)):
        known = shape.memo["placed"] = (fineness, _placed_curves(shape, fineness))
    placed: list[tuple[FloatArray, Curve]] = known[1]
    return placed


def _is_straight(shape: Shape) -> bool:
    """True if no point depends on the fineness of curves."""
    if isinstance(shape.entity, LWPolyline):
        return not np.any(shape.entity.lwpoints.values[:, 4])  # its bulges
    return shape.kind in ("LINE", "SOLID", "3DFACE")


def _placed_curves(shape: Shape, fineness: Fineness) -> list[tuple[FloatArray, Curve]]:
    # Numbers too large to calculate with are damage too, and reported as such.
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        placed = [(_flat(curve.points, shape.matrix), curve) for curve in curves_of(shape.entity, fineness)]
    for points, _ in placed:
        if not (np.isfinite(points).all() and (np.abs(points) <= LARGEST).all()):
            raise ValueError("a coordinate is not a number or beyond any building")
    return [(np.where(np.abs(points) < SMALLEST, 0.0, points), curve) for points, curve in placed]


def _flat(points: FloatArray, matrix: Matrix44 | None) -> FloatArray:
    if matrix is None:
        return points[:, :2]
    moved = [point.xyz for point in matrix.transform_vertices([Vec3(*point) for point in points])]
    return np.array(moved, dtype=np.float64).reshape(-1, 3)[:, :2]


def stretch_of(matrix: Matrix44 | None) -> float:
    """Return the greatest factor by which a placement lengthens anything in plan."""
    if matrix is None:
        return 1.0
    axes = (Vec3(1, 0, 0), Vec3(0, 1, 0))
    stretch = max(matrix.transform_direction(axis).magnitude for axis in axes)
    if not 1e-9 < stretch < LARGEST:
        raise ValueError(f"its block is scaled by {stretch:g}")
    return stretch


def word_of(shape: Shape, *, scale: float) -> Word:
    """The text of a shape, in metres; without text for a note. It is decoded once, in drawing units."""
    if shape.is_note:
        return Word("", shape.layer, shape.role)
    if "word" not in shape.memo:
        shape.memo["word"] = _written(shape)
    text, places = shape.memo["word"]
    return Word(text, shape.layer, shape.role, tuple((x * scale, y * scale) for x, y in places))


def _written(shape: Shape) -> tuple[str, list[tuple[float, float]]]:
    """The text of a shape, and its places in drawing units."""
    entity = shape.entity
    text = entity.plain_text() if hasattr(entity, "plain_text") else str(entity.dxf.text)
    values = entity.dxf.all_existing_dxf_attribs()
    points = [values[key] for key in ("insert", "align_point") if key in values]
    # MTEXT is placed in the world, TEXT in a plane of its own.
    plane = OCS(values.get("extrusion", Z_AXIS)) if shape.kind != "MTEXT" else OCS()
    world = np.array([plane.to_wcs(Vec3(point)).xyz for point in points]).reshape(-1, 3)
    sound = [point for point in _flat(world, shape.matrix) if (np.abs(point) <= LARGEST).all()]
    return legible(text), [(float(x), float(y)) for x, y in sound]


def _damage(shape: Shape, error: Exception, *, scale: float) -> Finding:
    message = f"{shape.name} is skipped: {legible(str(error)) or type(error).__name__}"
    return Finding("bad_coordinates", message, at=_place(shape, scale=scale))


def _place(shape: Shape, *, scale: float) -> tuple[float, float] | None:
    """The first finite point of a damaged shape, in its block's coordinates."""
    values = shape.entity.dxf.all_existing_dxf_attribs()
    named = [values.get(key) for key in ("start", "end", "center", "insert", "vtx0", "vtx1")]
    listed = shape.entity.get_points("xy") if isinstance(shape.entity, LWPolyline) else []
    for point in [Vec3(item) for item in (*named, *listed) if item is not None]:
        if abs(point.x) <= LARGEST and abs(point.y) <= LARGEST:
            return (point.x * scale, point.y * scale)
    return None


def _without_outline(solid: Counter[tuple[str, str]]) -> list[Finding]:
    """Findings on solids, meshes and proxies, whose outlines the file does not contain."""
    return [
        Finding("no_outline", f"layer {layer}: {count} {kind} have no outline to read; explode them to lines")
        for (layer, kind), count in sorted(solid.items())
    ]
