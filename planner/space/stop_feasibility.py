"""Feasibility of stop positions: decided by exact distances, with the reason where a stop is not allowed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import AT_EDGE, AVOIDED, IN_HOLE, KEPT, OUTSIDE, TOO_CLOSE, NavigableSpace
from stopgo.planner.geometry.ring_index import RingIndex
from stopgo.planner.geometry.shapes import SLACK, boundary_lines, local_origin, to_shape
from stopgo.planner.space.local_shapes import obstacles_of, room_shapes


class StopFeasibility:
    """A navigable space, prepared for deciding at which positions a stop is allowed."""

    def __init__(self, space: NavigableSpace) -> None:
        self.space = space
        self.origin = local_origin(space.floor)
        self.outline = to_shape(space.floor.outline, self.origin)
        self.rooms = room_shapes(space)
        self.obstacles = obstacles_of(space)
        self._walls = boundary_lines(self.obstacles)
        self._edges = boundary_lines(self.outline)
        self._wall_tree, self._edge_tree = shapely.STRtree(self._walls), shapely.STRtree(self._edges)
        self._obstacle_rings, self._outline_rings = RingIndex(self.obstacles), RingIndex(self.outline)
        for shape in (self.outline, self.obstacles, *self.rooms):
            shapely.prepare(shape)

    @property
    def element_clearance(self) -> float:
        """Least distance from a stop to an element: d_sec, or the robot's radius if that is more."""
        return max(self.space.settings.d_sec, self.space.settings.radius)

    def reasons(self, xy: FloatArray, room: IntArray) -> IntArray:
        """Index into DROP_REASONS of each position (n, 2) in the drawing's coordinates: the first."""
        local = np.asarray(xy, dtype=np.float64).reshape(-1, 2) - self.origin
        rooms, found = np.array(self.rooms, dtype=object), np.full(len(local), KEPT, dtype=np.int64)
        tests: list[tuple[int, Callable[[FloatArray, IntArray], BoolArray]]] = [
            (OUTSIDE, lambda at, room: ~shapely.dwithin(rooms[room], shapely.points(at), SLACK)),
            (IN_HOLE, lambda at, _: ~shapely.dwithin(self.outline, shapely.points(at), SLACK)),
            (TOO_CLOSE, lambda at, _: self.to_element(at) < self.element_clearance - SLACK),
            (TOO_CLOSE, lambda at, _: shapely.contains(self.obstacles, shapely.points(at))),
            (AT_EDGE, lambda at, _: self.to_edge(at) < self.space.settings.edge - SLACK),
            (AVOIDED, lambda at, _: self.avoided(at + self.origin)),
        ]
        left = np.arange(len(local))
        for reason, holds in tests:
            dropped = holds(local[left], np.asarray(room)[left])
            found[left[dropped]] = reason
            left = left[~dropped]
        return found

    def around(self, shape: BaseGeometry, margin: float) -> tuple[BaseGeometry, BaseGeometry]:
        """Obstacles and outline in the box that reaches `margin` metres beyond a shape."""
        low_x, low_y, high_x, high_y = shape.bounds
        box = (low_x - margin, low_y - margin, high_x + margin, high_y + margin)
        return self._obstacle_rings.within(box), self._outline_rings.within(box)

    def avoided(self, xy: FloatArray) -> BoolArray:
        """True for each point (n, 2) in a circle where the user allows no stop."""
        inside = np.zeros(len(xy), dtype=bool)
        for x, y, radius in self.space.settings.avoid:
            inside |= np.hypot(xy[:, 0] - x, xy[:, 1] - y) <= radius
        return inside

    def room_at(self, xy: FloatArray) -> int:
        """Number of the room nearest to a point; of several, the first."""
        point = shapely.Point(xy - self.origin)
        return int(np.argmin([room.distance(point) for room in self.rooms]))

    def to_element(self, local: FloatArray) -> FloatArray:
        """Distance of each local point (n, 2) to the nearest element's outline."""
        return _nearest(self._wall_tree, self._walls, local)

    def to_edge(self, local: FloatArray) -> FloatArray:
        """Distance of each local point (n, 2) to the nearest floor edge."""
        return _nearest(self._edge_tree, self._edges, local)


def _nearest(tree: shapely.STRtree, lines: NDArray[np.object_], local: FloatArray) -> FloatArray:
    if not len(lines) or not len(local):
        return np.full(len(local), np.inf)
    points = shapely.points(local)
    return shapely.distance(points, lines[tree.nearest(points)])
