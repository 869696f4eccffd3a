"""Solid walls from line work: the area between two lines of a wall is filled, the rest stays lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.planner.floors.rings import Region, polygons_of
from stopgo.planner.geometry.shapes import noded_lines

THICK = 0.6
"""A strip between wall lines that is nowhere wider than this, in metres, is a wall's inside."""
THICKEST = 1.0
"""So is one up to this wide that is many times as long."""
_LONG = 5.0
_FILLED = 1.6
"""A hatched or filled area on a wall's layer is a wall up to this thickness in metres."""
_BY_WALLS = 0.55
"""A wall's inside is bounded by wall lines along at least this share; an opening is not."""
_MEETS = 0.05
"""Wall lines that end this close (m) to another meet it."""
_GRID = 1e-4
_ON = 2e-3
_CELL = 2.5
"""A space smaller than this, in m², is no room."""
_SHORTEST = 0.03
"""Remains of lines shorter than this, in metres, are no walls."""


@dataclass(frozen=True, eq=False)
class SolidWalls:
    """Walls in metres."""

    solids: tuple[shapely.Polygon, ...] = ()
    lines: tuple[shapely.LineString, ...] = ()
    """Walls drawn as one line, and lines that enclose no solid."""
    joined: int = 0
    """Ends that were joined over a small gap."""
    cells: int = 0
    """Small spaces that the lines enclose and that are no wall's inside: many of them are a pattern."""
    too_thick: tuple[shapely.Polygon, ...] = ()
    """Filled areas on walls' layers that are no walls."""

    @cached_property
    def shape(self) -> Region:
        """All of it as one region; lines have the width of a hair."""
        return shapely.union_all([*self.solids, *shapely.buffer(list(self.lines), _ON, cap_style="square")])

    def without(self, places: Sequence[shapely.Polygon]) -> SolidWalls:
        """Return the walls without the areas in `places`."""
        if not places:
            return self
        gone = shapely.union_all(list(places))
        touched = shapely.intersects(gone, self.solids) if self.solids else []
        solids = [
            part
            for solid, cut in zip(self.solids, touched, strict=True)
            for part in (polygons_of(solid.difference(gone)) if cut else [solid])
        ]
        lines = _pieces(shapely.difference(list(self.lines), gone))
        return replace(self, solids=tuple(solids), lines=tuple(lines))


def walls_of(
    lines: Sequence[FloatArray], fills: Sequence[shapely.Polygon], *, beside: Sequence[FloatArray]
) -> SolidWalls:
    """Walls of polylines (n, 2) and filled areas.

    Parameters
    ----------
    beside
        Lines of doors and windows: they end walls that are not closed by lines of their own.
    """
    sound = [fill for fill in fills if shapely.buffer(fill, -_FILLED / 2).is_empty]
    drawn = _segments(lines)
    if not len(drawn):
        return SolidWalls(tuple(sound), too_thick=_others(fills, sound))
    bridges = _bridges(drawn)
    own = noded_lines(shapely.linestrings(np.concatenate([drawn, bridges])), grid_size=_GRID)
    other = _segments([line for line in beside if len(line)])
    other = other[np.hypot(*(other[:, 1] - other[:, 0]).T) <= THICKEST]
    noded = noded_lines([own, *shapely.linestrings(other)], grid_size=_GRID)
    faces = np.array(shapely.get_parts(shapely.polygonize([noded])), dtype=object)
    inside = _is_inside(faces, own)
    solids = faces[inside].tolist()
    cells = int(np.count_nonzero(~inside & (shapely.area(faces) < _CELL)))
    lines_left = _beside(own, [*solids, *sound])
    return SolidWalls((*solids, *sound), lines_left, len(bridges), cells, _others(fills, sound))


def _beside(own: Region, solids: Sequence[shapely.Polygon]) -> tuple[shapely.LineString, ...]:
    """Wall lines that neither bound a solid nor lie in one."""
    pieces = shapely.get_parts(own)
    middles = shapely.line_interpolate_point(pieces, 0.5, normalized=True)
    covered = np.zeros(len(pieces), dtype=bool)
    covered[shapely.STRtree(list(solids)).query(middles, predicate="dwithin", distance=_ON)[0]] = True
    return tuple(_pieces([shapely.line_merge(shapely.MultiLineString(pieces[~covered].tolist()))]))


def _others(
    fills: Sequence[shapely.Polygon], sound: Sequence[shapely.Polygon]
) -> tuple[shapely.Polygon, ...]:
    kept = {id(fill) for fill in sound}
    return tuple(fill for fill in fills if id(fill) not in kept)


def _segments(lines: Sequence[FloatArray]) -> FloatArray:
    """All segments (n, 2, 2) that have a length."""
    pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    if not pieces:
        return np.empty((0, 2, 2))
    every = np.concatenate(pieces)
    return every[np.hypot(*(every[:, 1] - every[:, 0]).T) > _GRID]


def _bridges(drawn: FloatArray) -> FloatArray:
    """Segments (n, 2, 2) from free ends to what they nearly meet, and across open ends of double lines."""
    ends, direction = _free_ends(drawn)
    if not len(ends):
        return np.empty((0, 2, 2))
    met, near = _to_lines(ends, drawn)
    caps = _caps(ends[~met], direction[~met])
    return np.concatenate([near, caps])


def _free_ends(drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends (n, 2) that touch no other segment, and the directions (n, 2) in which their lines end there."""
    ends = np.concatenate([drawn[:, 1], drawn[:, 0]])
    direction = np.concatenate([drawn[:, 1] - drawn[:, 0], drawn[:, 0] - drawn[:, 1]])
    direction = direction / np.hypot(*direction.T)[:, None]
    tree = shapely.STRtree(shapely.linestrings(drawn))
    point, _ = tree.query(shapely.points(ends), predicate="dwithin", distance=_GRID)
    free = np.bincount(point, minlength=len(ends)) <= 1
    return ends[free], direction[free]


def _to_lines(ends: FloatArray, drawn: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Ends that nearly meet another line, and the segments over those gaps."""
    lines = shapely.linestrings(drawn)
    points = shapely.points(ends)
    point, line = shapely.STRtree(lines).query(points, predicate="dwithin", distance=_MEETS)
    away = shapely.distance(points[point], lines[line])
    point, line, away = (values[away > _GRID] for values in (point, line, away))
    order = np.lexsort((line, away, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    met = np.zeros(len(ends), dtype=bool)
    met[point[first]] = True
    across = shapely.shortest_line(points[point[first]], lines[line[first]])
    return met, shapely.get_coordinates(across).reshape(-1, 2, 2)


def _caps(ends: FloatArray, direction: FloatArray) -> FloatArray:
    """Segments that close double lines which simply end, side by side, such as at a door."""
    from scipy.spatial import cKDTree

    if len(ends) < 2:
        return np.empty((0, 2, 2))
    pairs = cKDTree(ends).query_pairs(THICK, output_type="ndarray")
    if not len(pairs):
        return np.empty((0, 2, 2))
    one, other = pairs.T
    across = ends[other] - ends[one]
    width = np.hypot(*across.T)
    along = np.abs(np.einsum("ij,ij->i", across, direction[one])) / width
    alike = np.einsum("ij,ij->i", direction[one], direction[other]) > 0.99
    good = alike & (along < 0.1) & (width > 0.03)
    best: dict[int, int] = {}
    for k in np.flatnonzero(good)[np.argsort(width[good], kind="stable")].tolist():
        if int(one[k]) not in best and int(other[k]) not in best:
            best[int(one[k])] = best[int(other[k])] = k
    chosen = sorted(set(best.values()))
    return np.stack([ends[one[chosen]], ends[other[chosen]]], axis=1)


def _is_inside(faces: NDArray[np.object_], own: Region) -> BoolArray:
    """True for each face that is the inside of a wall: narrow, and almost surrounded by wall lines."""
    narrow = shapely.is_empty(shapely.buffer(faces, -THICK / 2, quad_segs=2))
    length = shapely.length(faces) / 2
    long = (length > _LONG * THICKEST) & shapely.is_empty(shapely.buffer(faces, -THICKEST / 2, quad_segs=2))
    inside = narrow | (long & (shapely.area(faces) < THICKEST * length))
    chosen = np.flatnonzero(inside)
    if not len(chosen):
        return inside
    inside[chosen[_share(faces[chosen], own) < _BY_WALLS]] = False
    return inside


def _share(faces: NDArray[np.object_], own: Region) -> FloatArray:
    """Fraction of each face's outline that is a wall's line (n,)."""
    rings, face = shapely.get_parts(shapely.boundary(faces), return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    inner = ring[:-1] == ring[1:]
    middles, lengths = (xy[:-1] + xy[1:])[inner] / 2, np.hypot(*(xy[1:] - xy[:-1])[inner].T)
    owner = face[ring[:-1][inner]]
    drawn = np.zeros(len(middles), dtype=bool)
    lines = shapely.STRtree(shapely.get_parts(own))
    drawn[lines.query(shapely.points(middles), predicate="dwithin", distance=_ON)[0]] = True
    whole = np.bincount(owner, weights=lengths, minlength=len(faces))
    return np.asarray(np.bincount(owner, weights=lengths * drawn, minlength=len(faces)) / whole)


def _pieces(shapes: Sequence[Region] | NDArray[np.object_]) -> list[shapely.LineString]:
    """The lines in any geometries, without crumbs."""
    parts = shapely.get_parts(shapely.get_parts(np.asarray(shapes, dtype=object)))
    return [part for part in parts if isinstance(part, shapely.LineString) and part.length > _SHORTEST]


def caps_of(shape: Region) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ends of walls: the middle (n, 2), outward direction (n, 2) and width (n,) of each short edge.

    A wall's end is an edge as short as walls are thick with a right angle on both sides.
    """
    found = [_caps_of_ring(ring) for part in polygons_of(shape) for ring in _rings(part)]
    if not found:
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0)
    middles, directions, widths = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return middles, directions, widths


def _rings(part: shapely.Polygon) -> list[FloatArray]:
    turned = shapely.orient_polygons(part).simplify(0.005)
    return [shapely.get_coordinates(ring)[:-1] for ring in (turned.exterior, *turned.interiors)]


def _caps_of_ring(ring: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    edge = np.roll(ring, -1, axis=0) - ring
    length = np.hypot(*edge.T)
    direction = edge / length[:, None]
    before, after = np.roll(direction, 1, axis=0), np.roll(direction, -1, axis=0)
    # Solid lies to the left: an end turns left on both sides.
    left = (_cross(before, direction) > 0.7) & (_cross(direction, after) > 0.7)
    end = left & (length > 0.03) & (length <= THICKEST)
    middles = ring[end] + edge[end] / 2
    return middles, np.stack([direction[end][:, 1], -direction[end][:, 0]], axis=1), length[end]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
