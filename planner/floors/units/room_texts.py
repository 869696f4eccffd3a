"""Areas and sides that texts give for rooms, against those of the rooms as drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawing import BROKEN_INPUT
from stopgo.planner.floors.drawn_shapes import Shape
from stopgo.planner.floors.strokes import sketch, word_of
from stopgo.planner.floors.written_measures import area_in, sides_in

T = TypeVar("T")
_ROOM_ROLES = ("rooms", "walls", "floor", "names", "other")
_LABELS = 3
"""So many written areas must lie in different faces of lines to say something."""
MOST_LABELS = 2000
"""Texts that are compared with what is drawn around them: of more, that many spread over all of them."""
_MOST = 3000
"""Lines between which faces are searched, at most …"""
_POINTS = 64
"""… each with fewer points than this."""


@dataclass(frozen=True)
class RoomSides:
    """Two sides of a room, the longer one first."""

    written: tuple[float, float]
    """In metres, as a text in the room says."""
    drawn: tuple[float, float]
    """In drawing units, from wall to wall through the text, along x and y."""


def sides_of(shapes: Sequence[Shape], written: Sequence[Shape]) -> list[RoomSides]:
    """Return the sides that texts name, each pair with the distances between the lines around the text."""
    texts = [word for shape in written if shape.is_text for word in _words(shape)]
    labels = [(sides, at) for text, at in texts if (sides := sides_in(text)) is not None]
    if not labels:
        return []
    segments = _segments(shapes)
    found = []
    for sides, at in some_of(labels):
        spans = [_span(segments[..., [axis, 1 - axis]], at[axis], at[1 - axis]) for axis in (0, 1)]
        if np.isfinite(spans).all() and min(spans) > 0:
            longer, shorter = max(sides), min(sides)
            found.append(RoomSides((longer, shorter), (max(spans), min(spans))))
    return found


def some_of(labels: Sequence[T]) -> Sequence[T]:
    """All labels, or of very many some: each is compared with all lines of the drawing."""
    return labels[:: -(-len(labels) // MOST_LABELS)] if labels else labels


def _segments(shapes: Sequence[Shape]) -> FloatArray:
    """Straight pieces (n, 2, 2) of the lines that may be walls; of all lines if no name shows walls."""
    for roles in (("walls", "rooms"), ("other",)):
        lines = [line for shape in shapes if shape.role in roles for line in _lines(shape)]
        if lines:
            return np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
    return np.empty((0, 2, 2))


def _span(segments: FloatArray, x: float, y: float) -> float:
    """Distance between the next lines (n, 2, 2) on both sides of a point along the first axis."""
    (x0, y0), (x1, y1) = segments[:, 0].T, segments[:, 1].T
    crossed = (np.minimum(y0, y1) <= y) & (y < np.maximum(y0, y1))
    at = x0[crossed] + (y - y0[crossed]) / (y1 - y0)[crossed] * (x1 - x0)[crossed]
    before, after = at[at < x], at[at > x]
    return float(after.min() - before.max()) if len(before) and len(after) else np.inf


def _lines(shape: Shape) -> list[FloatArray]:
    """Polylines (n, 2) of a shape in drawing units; closed ones come back to their start."""
    if shape.is_text or shape.is_note:
        return []
    lines = [line for line in sketch([shape]) if len(line) > 1]
    return [np.vstack((line, line[:1])) for line in lines] if _is_closed(shape) else lines


def _is_closed(shape: Shape) -> bool:
    return shape.kind in ("LWPOLYLINE", "POLYLINE") and bool(shape.entity.is_closed)  # type: ignore[attr-defined]


def _words(shape: Shape) -> Iterator[tuple[str, tuple[float, float]]]:
    """The text of a shape with its place in drawing units."""
    try:
        word = word_of(shape, scale=1.0)
    except BROKEN_INPUT:
        return
    if word.at:
        yield word.text, word.at[0]


def areas_in(shapes: Sequence[Shape], written: Sequence[Shape]) -> list[tuple[float, float]]:
    """Return areas that texts name, each with the area of the smallest closed shape around the text.

    If few lie in closed shapes of their own, the faces that lines enclose count, if several texts do.
    """
    texts = [word for shape in written if shape.is_text for word in _words(shape)]
    labels = [(area, at) for text, at in texts if (area := area_in(text))]
    if not labels:
        return []
    labels = some_of(labels)
    found = _around(labels, _faces(_closed(shapes)))
    if len({face for face, _, _ in found}) < _LABELS <= len(labels):
        between = _around(labels, _enclosed(shapes))
        found = between if len({face for face, _, _ in between}) >= _LABELS else found
    return [(said, drawn) for _, said, drawn in found]


def _around(
    labels: Sequence[tuple[float, tuple[float, float]]], faces: Sequence[shapely.Polygon]
) -> list[tuple[int, float, float]]:
    """For each label in a face: the smallest face, the area in the text, and the face's."""
    tree = shapely.STRtree(faces)
    found = []
    for area, at in labels:
        around = tree.query(shapely.Point(at), predicate="within").tolist()
        if around:
            face = min(around, key=lambda k: faces[k].area)
            found.append((face, area, faces[face].area))
    return found


def _faces(rings: Iterable[FloatArray]) -> list[shapely.Polygon]:
    faces = [shapely.Polygon(ring) for ring in rings if len(ring) > 3]
    return [face for face in faces if face.is_valid and face.area > 0]


def _enclosed(shapes: Sequence[Shape]) -> list[shapely.Polygon]:
    """Faces between the lines that may be walls; none of a drawing with very many lines."""
    own = [shape for shape in shapes if shape.role in _ROOM_ROLES and not (shape.is_text or shape.is_note)]
    lines = [shapely.LineString(line) for line in sketch(own) if 1 < len(line) < _POINTS]
    if not 0 < len(lines) <= _MOST:
        return []
    noded = shapely.union_all(lines)
    return [face for face in shapely.get_parts(shapely.polygonize([noded])) if face.area > 0]


def _closed(shapes: Sequence[Shape]) -> Iterator[FloatArray]:
    """Closed outlines that may be rooms."""
    for shape in shapes:
        if shape.role in _ROOM_ROLES and _is_closed(shape):
            yield from _lines(shape)
