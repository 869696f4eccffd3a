"""Assignment of target units to the rooms they face, so that coverage is reported and required by room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import RoomSpace, Targets
from stopgo.planner.geometry.shapes import SLACK, boundary_lines, to_shape
from stopgo.planner.space.ground import Ground

AHEAD = (0.02, 0.1, 0.25)
"""Distances (m) in front of a face at which its room is searched: rooms often begin a little off it."""
JAMB_DISTANCE = 0.3
"""Faces of jambs and niches belong to a room at most this far (m) from them."""
AT_ONCE = 50_000
"""Points that are looked for at once: a shape for each of a million is a large part of the memory."""


def faced_rooms(targets: Targets, rooms: Sequence[RoomSpace], ground: Ground) -> IntArray:
    """Index of the room in front of each unit (units,); -1 where there is none, as on a facade."""
    faced = RoomEdges([to_shape(room.area, ground.origin) for room in rooms])
    middle, normal = targets.unit_xy - ground.origin, _normals(targets)
    segment = targets.unit_segment
    found = np.full(targets.total, -1, dtype=np.int64)
    for ahead in AHEAD:
        unassigned = np.flatnonzero(found < 0)
        front = middle[unassigned] + ahead * normal[unassigned]
        found[unassigned] = faced.nearest_to_rows(front, segment[unassigned], 0.0)
    front = middle + AHEAD[0] * normal
    unassigned = np.flatnonzero(found < 0)
    unassigned = unassigned[shapely.intersects_xy(ground.outline, *front[unassigned].T)]
    found[unassigned] = faced.nearest_to_rows(front[unassigned], segment[unassigned], JAMB_DISTANCE)
    return frozen(found, np.int64)


def _normals(targets: Targets) -> FloatArray:
    """Unit vector out of each unit's face (units, 2); zero for targets that are visible from both sides."""
    along = targets.b - targets.a
    out = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    return np.where(targets.occluding[:, None], out, 0.0)[targets.unit_segment]


class RoomEdges:
    """Rooms, prepared for many points."""

    def __init__(self, shapes: Sequence[BaseGeometry]) -> None:
        self._shapes = shapes
        edges = [boundary_lines(shape) for shape in shapes]
        self._edge_room = np.repeat(np.arange(len(shapes)), [len(lines) for lines in edges])
        self._edges = shapely.STRtree(np.concatenate(edges))

    def nearest_to_rows(self, points: FloatArray, row: IntArray, distance: float) -> IntArray:
        """The same as `nearest`, of points that lie in straight rows, row by row.

        A row has one answer if it is farther than the distance from every edge of a room.
        """
        begin = np.flatnonzero(np.diff(row, prepend=-1))
        count = np.diff(begin, append=len(row))
        lines = shapely.linestrings(np.stack([points[begin], points[begin + count - 1]], axis=1))
        crossed, _ = self._edges.query(lines, predicate="dwithin", distance=distance + SLACK)
        alike = np.ones(len(begin), dtype=bool)
        alike[crossed] = False
        asked = np.repeat(~alike, count)
        asked[begin] = True
        found = np.empty(len(points), dtype=np.int64)
        found[asked] = self.nearest(points[asked], distance)
        found[~asked] = np.repeat(found[begin[alike]], count[alike] - 1)
        return found

    def nearest(self, points: FloatArray, distance: float) -> IntArray:
        """The nearest room within a distance of each point, of several the first; -1 where there is none."""
        blocks = np.split(points, range(AT_ONCE, len(points), AT_ONCE))
        return np.concatenate([self._nearest(block, distance) for block in blocks])

    def _nearest(self, points: FloatArray, distance: float) -> IntArray:
        found = np.full(len(points), -1, dtype=np.int64)
        room, at = shapely.STRtree(shapely.points(points)).query(self._shapes, predicate="intersects")
        _first_of_each(found, at, room)
        outside = np.flatnonzero(found < 0)
        at, edge = self._edges.query_nearest(
            shapely.points(points[outside]), max_distance=max(distance, 1e-9)
        )
        _first_of_each(found, outside[at], self._edge_room[edge])
        return found


def _first_of_each(found: IntArray, at: IntArray, room: IntArray) -> None:
    """Write the lowest room number of each point that is in `at`."""
    order = np.lexsort((room, at))[::-1]
    found[at[order]] = room[order]
