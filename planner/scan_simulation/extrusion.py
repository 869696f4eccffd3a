"""Floor -> extruded solids: every element by itself, as drawn, with the floor and a ceiling.

This shares nothing with the plan's own visibility geometry: no union, no grid, no mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, Polygon, frozen

BEAM_M = 0.3
"""Assumed height of a beam, from its underside to the ceiling."""
BEAM_WIDTH_M = 0.2
"""Assumed width of beams drawn as single lines."""
SEE_THROUGH_M = {"windows": (0.9, 2.1), "railings": (0.0, 1.0), "other": (0.0, 1.0)}
"""Assumed lower and upper height of targets that the laser passes, by kind."""
LEAST_M = 0.02
"""Elements lower than this have the assumed heights."""
NONE = -1
BEAM_KIND = "beams"
"""The kind that is fixed below the ceiling."""


@dataclass(frozen=True, eq=False)
class ExtrudedFloor:
    """Triangles in metres from `origin`, z up from the floor; each belongs to an upright or a level face."""

    origin: FloatArray
    """(2,), in the drawing's coordinates."""
    corners: FloatArray
    """(n, 3, 3)."""
    face: IntArray
    """Upright face of each triangle (n,), NONE of level ones."""
    under: IntArray
    """Element of which a level triangle is the underside (n,), else NONE."""
    a: FloatArray
    """Start of each upright face (m, 2)."""
    b: FloatArray
    low: FloatArray
    """(m,)."""
    high: FloatArray
    element: IntArray
    """Index of each upright face's element (m,), NONE of a closed door."""
    passed: BoolArray
    """True for triangles that the laser passes (n,): targets that hide nothing."""
    door: IntArray
    """Closed door of each triangle (n,), else NONE."""

    @cached_property
    def normal(self) -> FloatArray:
        """Unit normals (n, 3)."""
        across = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        return frozen(across / np.linalg.norm(across, axis=1, keepdims=True))

    @cached_property
    def level_edges(self) -> FloatArray:
        """Edges of the level triangles, each once (k, 2, 3)."""
        level = self.corners[2 * len(self.a) :]
        edges = np.stack([level, np.roll(level, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        turned = (edges[:, 0, 0] > edges[:, 1, 0]) | (
            (edges[:, 0, 0] == edges[:, 1, 0]) & (edges[:, 0, 1] > edges[:, 1, 1])
        )
        ordered = np.where(turned[:, None, None], edges[:, ::-1], edges)
        return frozen(np.unique(ordered.reshape(-1, 6), axis=0).reshape(-1, 2, 3))


class _Upright(NamedTuple):
    a: FloatArray
    b: FloatArray
    low: float
    high: float
    element: int = NONE
    passed: bool = False
    door: int = NONE


class _Level(NamedTuple):
    corners: FloatArray
    """(3, 3)."""
    under: int = NONE


def extruded(floor: FloorPlan, closed: Sequence[FloatArray], ceiling: float) -> ExtrudedFloor:
    """The floor raised to a ceiling; `closed` are doors that the laser does not pass, each a line (2, 2)."""
    upright = [face for index, item in enumerate(floor.elements) for face in _sides(item, index, ceiling)]
    upright += [_Upright(a, b, 0.0, ceiling, door=number) for number, (a, b) in enumerate(closed)]
    level = [flat for index, item in enumerate(floor.elements) for flat in _undersides(item, index, ceiling)]
    level += [_Level(flat) for part in floor.outline for z in (0.0, ceiling) for flat in _flat(part, z)]
    return _put_together([face for face in upright if not np.array_equal(face.a, face.b)], level, floor)


def heights_of(item: Element, ceiling: float) -> tuple[float, float]:
    """Lower and upper height of an element above the floor: as modelled, else as assumed."""
    if item.heights is not None:
        low, high = (min(max(height, 0.0), ceiling) for height in item.heights)
        if high - low >= LEAST_M:
            return low, high
    if item.kind == BEAM_KIND:
        return ceiling - BEAM_M, ceiling
    return (0.0, ceiling) if item.occludes else SEE_THROUGH_M.get(item.kind, SEE_THROUGH_M["other"])


def _sides(item: Element, index: int, ceiling: float) -> Iterator[_Upright]:
    if item.occludes or item.target:
        low, high = heights_of(item, ceiling)
        for a, b in _edges(item):
            yield _Upright(a, b, low, high, index, _is_passed(item))


def _undersides(item: Element, index: int, ceiling: float) -> Iterator[_Level]:
    if item.kind == BEAM_KIND and (item.occludes or item.target):
        low, _ = heights_of(item, ceiling)
        for solid in item.solids:
            yield from (_Level(flat, index) for flat in _flat(solid, low))
        for line in item.lines:
            yield from (_Level(flat, index) for a, b in pairwise(line) for flat in _strip(a, b, low))


def _is_passed(item: Element) -> bool:
    """True if the laser hits an element and passes it; beams stop the laser."""
    return not item.occludes and item.kind != BEAM_KIND


def _edges(item: Element) -> Iterator[tuple[FloatArray, FloatArray]]:
    for solid in item.solids:
        for ring in solid.rings:
            yield from zip(ring, np.roll(ring, -1, axis=0), strict=True)
    for line in item.lines:
        yield from pairwise(line)


def _strip(a: FloatArray, b: FloatArray, height: float) -> Iterator[FloatArray]:
    """The two triangles (3, 3) under a beam that is drawn as a single line."""
    along = b - a
    length = float(np.hypot(*along))
    if length > 0:
        aside = np.array([-along[1], along[0]]) * (BEAM_WIDTH_M / 2 / length)
        corners = np.column_stack(
            [np.array([a - aside, b - aside, b + aside, a + aside]), np.full(4, height)]
        )
        yield from (corners[[0, 1, 2]], corners[[0, 2, 3]])


def _flat(polygon: Polygon, height: float) -> Iterator[FloatArray]:
    """A polygon's triangles (3, 3) at a height."""
    shape = shapely.make_valid(shapely.Polygon(polygon.exterior, polygon.holes))
    for part in shapely.get_parts(shape):
        if part.geom_type == "Polygon":
            for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(part)):
                xy = shapely.get_coordinates(triangle)[:3]
                yield np.column_stack([xy, np.full(3, height)])


def _middle(floor: FloorPlan) -> FloatArray:
    """Centre of the floor in whole metres, so that Embree's single precision is a few micrometres."""
    rings = [ring for polygon in floor.outline for ring in polygon.rings]
    points = np.concatenate(rings)
    return np.round((points.min(axis=0) + points.max(axis=0)) / 2)


def _put_together(upright: Sequence[_Upright], level: Sequence[_Level], floor: FloorPlan) -> ExtrudedFloor:
    origin = _middle(floor)
    a, b = (np.array([face[k] for face in upright]).reshape(-1, 2) - origin for k in (0, 1))
    low, high = (np.array([face[k] for face in upright], dtype=np.float64) for k in (2, 3))
    quads = np.stack([_at(a, low), _at(b, low), _at(b, high), _at(a, high)], axis=1)
    flats = np.array([flat.corners for flat in level]).reshape(-1, 3, 3) - (*origin, 0.0)
    count, none = len(upright), [NONE] * len(level)
    return ExtrudedFloor(
        origin=frozen(origin),
        corners=frozen(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], flats])),
        face=frozen([*range(count), *range(count), *none], np.int64),
        under=frozen([*[NONE] * (2 * count), *(flat.under for flat in level)], np.int64),
        a=frozen(a),
        b=frozen(b),
        low=frozen(low),
        high=frozen(high),
        element=frozen([face.element for face in upright], np.int64),
        passed=frozen([*[f.passed for f in upright] * 2, *[False] * len(level)], np.bool_),
        door=frozen([*[face.door for face in upright] * 2, *none], np.int64),
    )


def _at(xy: FloatArray, z: FloatArray) -> FloatArray:
    return np.column_stack([xy, z])
