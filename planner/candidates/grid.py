"""Grid candidates: the corners of square cells in each room's own axes (paper, 3.2.1)."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.room_grid import room_grid
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.space.local_shapes import room_shapes


def grid(space: NavigableSpace) -> tuple[FloatArray, IntArray]:
    """Cell corners of every room's grid that lie in its bounding rectangle, fitted to it."""
    origin = local_origin(space.floor)
    per_room = [room_grid(shape, spacing=space.settings.grid) for shape in room_shapes(space)]
    xy = np.concatenate([np.empty((0, 2)), *per_room]) + origin
    room = np.repeat(np.arange(len(per_room)), [len(points) for points in per_room])
    return xy, room.astype(np.int64)
