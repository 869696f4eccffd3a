"""Groups of touching lines, and the outline of the object that each group shows."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.rings import polygons_of
from stopgo.planner.geometry.near_shapes import labels_of
from stopgo.planner.geometry.shapes import noded_lines

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


def outlines_of(lines: Sequence[FloatArray], *, within: float) -> list[shapely.Polygon]:
    """Filled outline of each group of lines."""
    return [part for group in groups_of(lines, within=within) for part in _outline(group)]


def _outline(group: Sequence[FloatArray]) -> list[shapely.Polygon]:
    drawn = noded_lines([shapely.LineString(line) for line in group if len(line) > 1], grid_size=1e-4)
    hull = drawn.convex_hull
    faces = shapely.union_all(polygons_of(shapely.polygonize([drawn])))
    enclosed = shapely.union_all([shapely.Polygon(face.exterior) for face in polygons_of(faces)])
    if hull.area <= _SMALL and isinstance(hull, shapely.Polygon):
        return [hull]
    if enclosed.area >= _FILLED * hull.area > 0:
        return polygons_of(enclosed)
    return polygons_of(shapely.union_all([enclosed, drawn.buffer(0.01)]))
