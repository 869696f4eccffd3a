"""Control points -> the scans that see them: targets whose coordinates are known in the site's frame."""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.shapes import local_origin, to_shape

SeenPoint = tuple[int, FloatArray]
"""A scan's index, and a control point that it sees, local metres (2,)."""


def seen_control(space: NavigableSpace, xy: FloatArray) -> list[SeenPoint]:
    """The control points of the settings that scans at positions (n, 2), local metres, see.

    A point is seen up to `overlap_range` if nothing that stops the laser lies between.
    """
    settings, origin = space.settings, local_origin(space.floor)
    points = np.array(settings.control, dtype=np.float64).reshape(-1, 2) - origin
    if not len(points):
        return []
    solids = to_shape(space.occluders, origin)
    shapely.prepare(solids)
    away = np.hypot(*(xy[:, None] - points[None]).transpose(2, 0, 1))
    scan, point = np.nonzero(away <= settings.farthest_overlap)
    lines = shapely.linestrings(np.stack([xy[scan], points[point]], axis=1))
    free = ~shapely.intersects(solids, lines)
    return [(int(k), points[p]) for k, p in zip(scan[free], point[free], strict=True)]
