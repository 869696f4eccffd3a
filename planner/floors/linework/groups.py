"""Groups of touching lines, and the outline of the object that each group shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.floors.rings import Region, polygons_of

_FILLED = 0.5
"""If lines enclose less than this fraction of their hull, each line is a separate object."""
_SMALL = 4.0
"""A group whose hull is at most this large, in m², is one obstacle."""


def groups_of(lines: Sequence[FloatArray], *, within: float) -> list[list[FloatArray]]:
    """Return polylines (n, 2) in groups that are connected over gaps of at most `within` metres."""
    drawn = [line for line in lines if len(line)]
    label = labels_of(
        [shapely.LineString(line) if len(line) > 1 else shapely.Point(line[0]) for line in drawn], within
    )
    groups: list[list[FloatArray]] = [[] for _ in range(int(label.max()) + 1 if len(label) else 0)]
    for line, group in zip(drawn, label.tolist(), strict=True):
        groups[group].append(line)
    return groups


def labels_of(shapes: Sequence[Region], within: float) -> IntArray:
    """The number of the group that each shape is in (n,), counted in the order of the shapes."""
    if not shapes:
        return np.empty(0, dtype=np.int64)
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=within)
    links = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(len(shapes), len(shapes)))
    _, label = connected_components(links, directed=False)
    return label.astype(np.int64)


def outlines_of(lines: Sequence[FloatArray], *, within: float) -> list[shapely.Polygon]:
    """Filled outline of each group of lines."""
    return [part for group in groups_of(lines, within=within) for part in _outline(group)]


def _outline(group: Sequence[FloatArray]) -> list[shapely.Polygon]:
    drawn = shapely.union_all([shapely.LineString(line) for line in group if len(line) > 1], grid_size=1e-4)
    hull = drawn.convex_hull
    faces = shapely.union_all(polygons_of(shapely.polygonize([drawn])))
    enclosed = shapely.union_all([shapely.Polygon(face.exterior) for face in polygons_of(faces)])
    if hull.area <= _SMALL and isinstance(hull, shapely.Polygon):
        return [hull]
    if enclosed.area >= _FILLED * hull.area > 0:
        return polygons_of(enclosed)
    return polygons_of(shapely.union_all([enclosed, drawn.buffer(0.01)]))
