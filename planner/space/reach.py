"""Reachability: the part of the floor that a point belongs to, and its anchor in the drive area.

The drive area is drawn a little too small, so a point that keeps every clearance exactly may lie just
outside it. Such a point has an anchor: a point of the drive area, to which the straight drive is checked.
"""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import GRID, boundary_lines, local_origin, segments_of
from stopgo.planner.space.gaps import Site, Walls
from stopgo.planner.space.local_shapes import (
    drive_area_of,
    drive_parts_of,
    ground_of,
    obstacles_of,
    room_shapes,
)

INSIDE = 3 * GRID
"""Points nearer than this (m) to the drive area's edge are anchored, since the mesh is snapped."""
SIDES = 8


class Reach:
    """A navigable space, prepared for reachability queries; points are local (n, 2)."""

    def __init__(self, space: NavigableSpace) -> None:
        drive_area = drive_area_of(space)
        self.parts = drive_parts_of(space)
        self.site = Site(walls_of(space), drive_area, ground_of(space))
        self._rim = boundary_lines(drive_area)
        self._rim_tree = shapely.STRtree(self._rim)

    def part_at(self, xy: FloatArray) -> IntArray:
        """Part of each point, -1 where the robot cannot reach it."""
        anchors = self.anchors(xy)
        found = np.full(len(xy), -1, dtype=np.int64)
        anchored = np.isfinite(anchors[:, 0])
        found[anchored] = self.parts.part_at(anchors[anchored])
        return found

    def anchors(self, xy: FloatArray) -> FloatArray:
        """Anchor of each point: itself if it is well inside the drive area; NaN if there is none."""
        found = np.array(xy, dtype=np.float64)
        for k in np.flatnonzero(~self._well_inside(xy)):
            if not self._on_crossing(found[k]):
                found[k] = self._anchor(xy[k])
        return found

    def _well_inside(self, xy: FloatArray) -> BoolArray:
        inside: BoolArray = self.parts.part_at(xy) >= 0
        near, _ = self._rim_tree.query(shapely.points(xy), predicate="dwithin", distance=INSIDE)
        inside[near] = False
        return inside

    def _on_crossing(self, point: FloatArray) -> bool:
        gaps = self.parts.gaps
        return bool(
            len(gaps) and shapely.dwithin(shapely.linestrings(gaps), shapely.Point(point), GRID).any()
        )

    def _anchor(self, point: FloatArray) -> FloatArray:
        """A point of the drive area next to this one, to which the robot may drive straight."""
        no_anchor = np.full(2, np.nan)
        if not len(self._rim):
            return no_anchor
        rim = self._rim[self._rim_tree.nearest(shapely.Point(point))]
        foot = shapely.get_coordinates(rim.interpolate(rim.project(shapely.Point(point))))[0]
        if np.hypot(*(foot - point)) > self.site.slop:
            return no_anchor
        for angle in np.arange(SIDES) * (2 * np.pi / SIDES):
            end = foot + 4 * INSIDE * np.array([np.cos(angle), np.sin(angle)])
            if self._well_inside(end[None])[0] and self.site.allows(point, end):
                return end
        return no_anchor


@instance_cached
def reach_of(space: NavigableSpace) -> Reach:
    """Return the space's reachability, prepared once."""
    return Reach(space)


@instance_cached
def room_areas_by_part(space: NavigableSpace) -> tuple[dict[int, float], ...]:
    """Return the drive area of every room, by part."""
    parts = reach_of(space).parts
    return tuple(parts.area_by_part(shape) for shape in room_shapes(space))


@instance_cached
def walls_of(space: NavigableSpace) -> Walls:
    """Everything that a robot's centre keeps clear of: obstacles, closed openings, floor edges."""
    origin = local_origin(space.floor)
    solid = np.concatenate([segments_of(obstacles_of(space)), space.barriers - origin])
    edges = segments_of(ground_of(space))
    clearance = np.repeat([space.settings.radius, space.settings.edge], [len(solid), len(edges)])
    return Walls(np.concatenate([solid, edges]), clearance)
