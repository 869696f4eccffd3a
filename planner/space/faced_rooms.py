"""Assignment of target units to the rooms they face, so that coverage is reported and required by room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import RoomSpace, Targets
from stopgo.planner.geometry.shapes import to_shape
from stopgo.planner.space.ground import Ground

AHEAD = (0.02, 0.1, 0.25)
"""Distances (m) in front of a face at which its room is searched: rooms often begin a little off it."""
JAMB_DISTANCE = 0.3
"""Faces of jambs and niches belong to a room at most this far (m) from them."""


def faced_rooms(targets: Targets, rooms: Sequence[RoomSpace], ground: Ground) -> IntArray:
    """Index of the room in front of each unit (units,); -1 where there is none, as on a facade."""
    shapes = [to_shape(room.area, ground.origin) for room in rooms]
    tree = shapely.STRtree(shapes)
    middle, normal = targets.unit_xy - ground.origin, _normals(targets)
    found = np.full(targets.total, -1, dtype=np.int64)
    for ahead in AHEAD:
        unassigned = np.flatnonzero(found < 0)
        found[unassigned] = _nearest_room(tree, middle[unassigned] + ahead * normal[unassigned], 0.0)
    front = middle + AHEAD[0] * normal
    unassigned = np.flatnonzero(found < 0)
    unassigned = unassigned[shapely.intersects(ground.outline, shapely.points(front[unassigned]))]
    found[unassigned] = _nearest_room(tree, front[unassigned], JAMB_DISTANCE)
    return frozen(found, np.int64)


def _normals(targets: Targets) -> FloatArray:
    """Unit vector out of each unit's face (units, 2); zero for targets that are visible from both sides."""
    along = targets.b - targets.a
    out = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    return np.where(targets.occluding[:, None], out, 0.0)[targets.unit_segment]


def _nearest_room(tree: shapely.STRtree, points: FloatArray, distance: float) -> IntArray:
    """The nearest room within a distance of each point, of several the first; -1 where there is none."""
    found = np.full(len(points), -1, dtype=np.int64)
    at, room = tree.query_nearest(shapely.points(points), max_distance=max(distance, 1e-9))
    order = np.lexsort((room, at))[::-1]
    found[at[order]] = room[order]
    return found
