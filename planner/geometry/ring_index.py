"""A polygonal shape with a spatial index of its rings, from which small pieces are cut exactly.

A part, or a hole, whose bounds miss a box does not change the shape's piece in this box. So a cut takes
only the rings around the box. Its result is the same as that of a cut of the whole shape.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import floor

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.shapes import polygon_parts

FEW = 300
"""Vertices of a shape that is cut as a whole."""
LONG = 20_000
"""Vertices of a polygon that is triangulated as a whole: the drive area of some 17 000 m²."""
CUT = 20.0
"""Side in metres of the squares into which a large shape is cut."""
TILE = 10.0
"""Metres: small shapes that begin in one square of this side are intersected with the same cut."""


class RingIndex:
    """A polygonal shape, prepared for many cuts of small boxes; bounds are (low x, low y, high x, high y)."""

    def __init__(self, shape: BaseGeometry) -> None:
        self._shape = shape
        self._parts = np.array(polygon_parts(shape), dtype=object)
        self._is_small = shapely.get_num_coordinates(shape) <= FEW
        if self._is_small:
            return
        self._part_tree = shapely.STRtree(self._parts)
        rings = [part.interiors for part in self._parts]
        self._hole_part = np.repeat(np.arange(len(rings)), [len(some) for some in rings])
        self._holes = np.array([hole for some in rings for hole in some], dtype=object)
        self._hole_tree = shapely.STRtree(self._holes)
        self._hole_count = np.bincount(self._hole_part, minlength=len(rings))

    def within(self, bounds: Sequence[float]) -> BaseGeometry:
        """The polygons of the shape in a box."""
        # Not clip_by_rect: it fails where it leaves less than a triangle of a shape.
        return shapely.MultiPolygon(polygon_parts(self.around(bounds).intersection(shapely.box(*bounds))))

    def around(self, bounds: Sequence[float]) -> BaseGeometry:
        """A shape that is the same in a box: the parts around it, with the holes around it."""
        if self._is_small:
            return self._shape
        box = shapely.box(*bounds)
        parts, holes = np.sort(self._part_tree.query(box)), np.sort(self._hole_tree.query(box))
        return shapely.MultiPolygon([self._with_holes(int(k), holes) for k in parts])

    def _with_holes(self, part: int, holes: IntArray) -> shapely.Polygon:
        """A part with those of its holes that are among these."""
        own = holes[self._hole_part[holes] == part]
        if len(own) == self._hole_count[part]:
            return self._parts[part]
        return shapely.Polygon(self._parts[part].exterior, list(self._holes[own]))


def triangles_of(shape: BaseGeometry) -> NDArray[np.object_]:
    """Triangles that cover a polygon; one with very many vertices is cut into squares first.

    The time of a triangulation grows faster than its vertices.
    """
    if shapely.get_num_coordinates(shape) <= LONG:
        return shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    index, bounds = RingIndex(shape), shape.bounds
    x, y = (np.arange(floor(bounds[k] / CUT), floor(bounds[k + 2] / CUT) + 1) for k in range(2))
    boxes = [(a * CUT, b * CUT, (a + 1) * CUT, (b + 1) * CUT) for a in x.tolist() for b in y.tolist()]
    parts = np.array([part for box in boxes for part in polygon_parts(index.within(box))], dtype=object)
    return shapely.get_parts(shapely.constrained_delaunay_triangles(parts))


def areas_within(cells: NDArray[np.object_], shape: BaseGeometry) -> FloatArray:
    """Area of the part of each small shape (n,) that lies in a large one."""
    sizes = np.zeros(len(cells))
    for group, piece in _pieces_around(cells, shape):
        sizes[group] = _areas_within(cells[group], piece)
    return sizes


def parts_within(cells: NDArray[np.object_], shape: BaseGeometry) -> NDArray[np.object_]:
    """The part of each small shape (n,) that lies in a large one."""
    parts = np.full(len(cells), shapely.MultiPolygon(), dtype=object)
    for group, piece in _pieces_around(cells, shape):
        parts[group] = shapely.intersection(cells[group], piece)
    return parts


def _pieces_around(
    cells: NDArray[np.object_], shape: BaseGeometry
) -> Iterator[tuple[IntArray, BaseGeometry]]:
    """Indices of shapes near one another, without empty ones, and the piece of a large shape round them."""
    if not len(cells) or shapely.get_num_coordinates(shape) <= FEW:
        yield np.arange(len(cells)), shape
        return
    index, bounds = RingIndex(shape), shapely.bounds(cells)
    real = np.flatnonzero(~shapely.is_empty(cells))
    _, tile = np.unique(np.floor(bounds[real, :2] / TILE), axis=0, return_inverse=True)
    order = real[np.argsort(tile.reshape(-1), kind="stable")]
    for group in np.split(order, np.cumsum(np.bincount(tile.reshape(-1)))[:-1]) if len(real) else ():
        low, high = bounds[group, :2].min(axis=0), bounds[group, 2:].max(axis=0)
        yield group, index.within((*low.tolist(), *high.tolist()))


def _areas_within(cells: NDArray[np.object_], shape: BaseGeometry) -> FloatArray:
    """The same, where the shape has few vertices; only what crosses its edge is intersected with it."""
    shapely.prepare(shape)
    sizes = np.where(shapely.contains_properly(shape, cells), shapely.area(cells), 0.0)
    crossing = np.flatnonzero((sizes == 0) & shapely.intersects(shape, cells))
    sizes[crossing] = shapely.area(shapely.intersection(cells[crossing], shape))
    return sizes
