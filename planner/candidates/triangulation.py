"""Triangulation candidates: middles of Delaunay triangles and Voronoi points of each room (paper, 3.2.2).

Seeds come from the drawing. Without rooms they are the floor's contour and the columns' centres. With rooms
they are each room's contour, the corners of the elements in it and the centres of round elements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import KEPT, SLIVER, TOO_SMALL, NavigableSpace
from stopgo.planner.geometry.room_grid import main_axes
from stopgo.planner.geometry.shapes import GRID, one_shape, polygon_parts, roughly_widened, segments_of
from stopgo.planner.space.stop_feasibility import StopFeasibility

LEAST_ANGLE = float(np.arcsin(1 / 6))
"""alpha_min in radians: sin alpha_min = l_min / (6 l_min) (paper, Eq. 2), 9.594° whatever l_min is."""
STEP = 1e-3
"""Seeds are rounded to this (m) in the room's own axes: float noise must not flip Delaunay's diagonals."""
SAME = 0.01
"""Seeds and candidates closer than this (m) are one."""
AT_ROOM = 1e-3
"""Elements this close to a room (m) are the room's own."""
ROUNDS = 4
"""Maximum number of repeated triangulations of a room that is not dense enough."""


def triangulation(space: NavigableSpace) -> tuple[FloatArray, IntArray, IntArray]:
    """Candidates of every room: position, room, and the reason for those of bad triangles."""
    feasibility = StopFeasibility(space)
    drawn = DrawnBoundary.of(feasibility)
    per_room = [room_candidates(feasibility, drawn, room) for room in range(len(space.rooms))]
    xy = np.concatenate([np.empty((0, 2)), *(points for points, _ in per_room)]) + feasibility.origin
    reason = np.concatenate([np.empty(0, np.int64), *(early for _, early in per_room)])
    room = np.repeat(np.arange(len(per_room)), [len(points) for points, _ in per_room])
    return xy, room.astype(np.int64), reason


@dataclass(frozen=True, eq=False)
class DrawnBoundary:
    """Sources of seeds in addition to the rooms' contours; local frame."""

    edges: FloatArray
    """Element edges as shapely lines (n,)."""
    centres: FloatArray
    """Centres of columns or round elements (n, 2)."""

    @classmethod
    def of(cls, feasibility: StopFeasibility) -> DrawnBoundary:
        """Columns' centres where the floor has no rooms; else the elements' outlines."""
        floor = feasibility.space.floor
        if not floor.rooms:
            columns = [solid for item in floor.elements if item.kind == "columns" for solid in item.solids]
            middles = [one_shape(column, feasibility.origin).centroid for column in columns]
            return cls(shapely.linestrings(np.empty((0, 2, 2))), shapely.get_coordinates(middles))
        parts = polygon_parts(feasibility.obstacles)
        cornered = shapely.MultiPolygon([part for part in parts if not is_round(part)])
        centres = shapely.get_coordinates([part.centroid for part in parts if is_round(part)])
        return cls(shapely.linestrings(segments_of(cornered)), centres)


def is_round(solid: shapely.Polygon) -> bool:
    """True if a solid's corners lie on a circle, like those of a discretised column (Eq. 1)."""
    corners = shapely.get_coordinates(solid)[:-1]
    radius = np.hypot(*(corners - corners.mean(axis=0)).T)
    return len(corners) >= 8 and float(np.ptp(radius)) < 0.01 * float(radius.max())


def room_candidates(
    feasibility: StopFeasibility, drawn: DrawnBoundary, room: int
) -> tuple[FloatArray, IntArray]:
    """Candidates (n, 2) of one room in the local frame, with TOO_SMALL, SLIVER or KEPT for each.

    While fewer than dens_min candidates per m² remain, they become seeds too, if this adds candidates.
    """
    settings, shape = feasibility.space.settings, feasibility.rooms[room]
    seeds = seeds_of(shape, drawn, d_max=settings.d_max)
    best = triangulated(seeds, shape, l_min=settings.l_min)
    allowed = _allowed_count(feasibility, room, *best)
    for _ in range(ROUNDS):
        if allowed >= settings.dens_min * shape.area:
            break
        points, early = best
        seeds = np.concatenate([seeds, points[early == KEPT]])
        finer = triangulated(seeds, shape, l_min=settings.l_min)
        if _allowed_count(feasibility, room, *finer) <= allowed:
            break
        best, allowed = finer, _allowed_count(feasibility, room, *finer)
    return best


def _allowed_count(feasibility: StopFeasibility, room: int, points: FloatArray, early: IntArray) -> int:
    """Number of the candidates at which a stop is allowed."""
    usable = points[early == KEPT]
    reason = feasibility.reasons(usable + feasibility.origin, np.full(len(usable), room))
    return int(np.count_nonzero(reason == KEPT))


def seeds_of(shape: BaseGeometry, drawn: DrawnBoundary, *, d_max: float) -> FloatArray:
    """Seeds (n, 2) of a room: segments longer than `d_max` metres are split evenly."""
    around = roughly_widened(shape, AT_ROOM, join_style="mitre")
    near = drawn.edges[shapely.intersects(drawn.edges, around)]
    drawn_lines = [*shapely.linestrings(segments_of(shape)), *shapely.intersection(near, around)]
    lines = [line for line in drawn_lines if line.length > GRID or line.geom_type == "Point"]
    centres = drawn.centres[shapely.intersects(shapely.points(drawn.centres), shape)]
    return np.concatenate([shapely.get_coordinates(shapely.segmentize(lines, d_max)), centres])


def triangulated(seeds: FloatArray, shape: BaseGeometry, *, l_min: float) -> tuple[FloatArray, IntArray]:
    """Middles of all triangles, then the Voronoi points inside, and the reason against each bad triangle.

    Points are taken in the room's own axes, rounded and sorted, so that the result depends on neither
    the drawing's angle nor the order of its entities.
    """
    axes = main_axes(shape)
    corner = (shapely.get_coordinates(shape) @ axes.T).min(axis=0)
    outer = distinct(seeds @ axes.T - corner)
    inner = distinct(voronoi_points(outer))
    inner = inner[shapely.intersects(shape, shapely.points((inner + corner) @ axes))]
    both = distinct(np.concatenate([outer, inner]))
    triangles = both[delaunay(both)]
    points = np.concatenate([triangles.mean(axis=1), inner])
    reason = np.concatenate([triangle_reasons(triangles, l_min=l_min), np.full(len(inner), KEPT)])
    return (points + corner) @ axes, reason


def distinct(points: FloatArray) -> FloatArray:
    """The points (n, 2), rounded to STEP, in a canonical order; of those closer than SAME the first."""
    from scipy.spatial import cKDTree

    points = np.unique(np.rint(points / STEP), axis=0) * STEP
    keep = np.ones(len(points), dtype=bool)
    if len(points) > 1:
        for first, second in sorted(cKDTree(points).query_pairs(SAME)):
            keep[second] &= not keep[first]
    return points[keep]


def voronoi_points(points: FloatArray) -> FloatArray:
    """Corners of the Voronoi cells of `points` (n, 2); none if all lie on a line."""
    from scipy.spatial import Voronoi

    found = _by_qhull(Voronoi, points)
    return np.empty((0, 2)) if found is None else found.vertices


def delaunay(points: FloatArray) -> IntArray:
    """Corners (t, 3) of the Delaunay triangles of `points` (n, 2); none if all lie on a line."""
    from scipy.spatial import Delaunay

    found = _by_qhull(Delaunay, points)
    return np.empty((0, 3), dtype=np.int64) if found is None else found.simplices.astype(np.int64)


def _by_qhull(diagram: Callable[[FloatArray], Any], points: FloatArray) -> Any:
    """The diagram of points that span an area, else None: Qhull refuses points on a line."""
    from scipy.spatial import QhullError

    if len(points) < 3:
        return None
    try:
        return diagram(points)
    except QhullError:
        return None


def triangle_reasons(triangles: FloatArray, *, l_min: float) -> IntArray:
    """TOO_SMALL where a side is below `l_min` metres, SLIVER where an angle is below alpha_min (Eq. 2)."""
    sides = np.hypot(*np.moveaxis(triangles - np.roll(triangles, -1, axis=1), -1, 0))
    a, b, c = np.sort(sides, axis=1).T
    least = np.arccos(np.clip((b**2 + c**2 - a**2) / (2 * b * c), -1.0, 1.0))
    return np.select([a < l_min, least < LEAST_ANGLE], [TOO_SMALL, SLIVER], KEPT).astype(np.int64)
