"""Gaps in the floor that separate the robot from drivable floor: their width and position."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import SLACK, local_origin, polygon_parts, segments_of
from stopgo.planner.space.local_shapes import ground_of, obstacles_of
from stopgo.planner.space.reach import INSIDE, reach_of

APART = 0.1
"""Spacing in metres of the points on floor edges from which a gap is measured."""
WIDEST = 10.0
"""Floor farther apart than this (m) is not called a gap."""


@dataclass(frozen=True, eq=False)
class FloorGaps:
    """Straight lines from floor edges over a gap to other floor, clear of everything except the edges."""

    begin: FloatArray
    """Points where the floor ends (n, 2), local."""
    end: FloatArray
    """Points where other floor begins (n, 2)."""
    here: IntArray
    """Part of the floor before the gap (n,), -1 where the robot may not be."""
    there: IntArray
    """Part of the floor behind the gap (n,)."""


def gap_before(space: NavigableSpace, shape: BaseGeometry, parts: Set[int]) -> str:
    """Describe the narrowest gap at the edge of a shape's floor outside the parts; "" if there is none.

    A gap that leads to the parts comes before a gap that leads to other floor.
    """
    gaps = _gaps_of(space)
    apart = (gaps.here != gaps.there) & (gaps.there >= 0) & ~np.isin(gaps.here, sorted(parts))
    at = np.flatnonzero(apart)
    at = at[shapely.dwithin(shape, shapely.points(gaps.begin[at]), INSIDE)]
    if not len(at):
        return ""
    there = np.isin(gaps.there[at], sorted(parts))
    at = at[there] if there.any() else at
    width = np.hypot(*(gaps.end[at] - gaps.begin[at]).T)
    narrowest = at[np.lexsort((*gaps.begin[at].T, np.round(width, 6)))[0]]
    x, y = (gaps.begin[narrowest] + gaps.end[narrowest]) / 2 + local_origin(space.floor)
    return f"a gap of {width.min():.3f} m in the floor at ({x:.2f}, {y:.2f})"


@instance_cached
def _gaps_of(space: NavigableSpace) -> FloorGaps:
    """Every gap of a space, measured at each point of its edges."""
    ground = ground_of(space)
    shapely.prepare(ground)
    begin, out = _edge_points(ground)
    unblocked = ~_blocked(space, shapely.points(begin))
    begin, out = begin[unblocked], out[unblocked]
    rays = shapely.linestrings(np.stack([begin + INSIDE * out, begin + WIDEST * out], axis=1))
    across = shapely.distance(shapely.points(begin), shapely.intersection(rays, ground))
    begin, out, across = (values[np.isfinite(across)] for values in (begin, out, across))
    end = begin + across[:, None] * out
    step = (space.settings.edge + reach_of(space).site.slop + INSIDE) * out
    clear = ~_blocked(space, shapely.linestrings(np.stack([begin - step, end + step], axis=1)))
    here, there = (reach_of(space).part_at(points[clear]) for points in (begin - step, end + step))
    return FloorGaps(begin[clear], end[clear], here, there)


def _edge_points(ground: BaseGeometry) -> tuple[FloatArray, FloatArray]:
    """Points on the edges of the floor (n, 2), and unit vectors that point off the floor (n, 2)."""
    edges = segments_of(shapely.orient_polygons(shapely.MultiPolygon(polygon_parts(ground))))
    along = edges[:, 1] - edges[:, 0]
    length = np.hypot(*along.T)
    count = np.ceil(length / APART).astype(int)
    edge = np.repeat(np.arange(len(edges)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    begin = edges[edge, 0] + ((number + 0.5) / count[edge])[:, None] * along[edge]
    return begin, np.stack([along[:, 1], -along[:, 0]], axis=1)[edge] / length[edge, None]


def _blocked(space: NavigableSpace, shapes: NDArray[np.object_]) -> BoolArray:
    """True for each shape that an obstacle or a closed opening is nearer to than the robot's radius."""
    origin = local_origin(space.floor)
    solid = np.concatenate([segments_of(obstacles_of(space)), space.barriers - origin])
    radius = space.settings.radius - SLACK
    near, _ = shapely.STRtree(shapely.linestrings(solid)).query(shapes, predicate="dwithin", distance=radius)
    found = np.zeros(len(shapes), dtype=bool)
    found[near] = True
    return found
