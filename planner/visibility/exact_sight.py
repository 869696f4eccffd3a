"""Exact visibility: triangular expansion over open space, independent of the drawing's rotation."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray, bounds, frozen, read_only
from stopgo.mission.stages import Candidates, NavigableSpace, Visibility
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import LINE_WALL, local_origin, to_grid, whole_steps_of
from stopgo.planner.visibility.sight.mesh import Mesh, mesh_of
from stopgo.planner.visibility.sight.sight import scene_of, sight

DOOR_OFFSET = 2 * LINE_WALL
"""Distance in metres between a closed door's line and the viewpoints of a scanner in its doorway."""
MARGIN = 1.0
"""Open space around everything, in metres."""


def exact(candidates: Candidates) -> Visibility:
    """Units in range whose midpoint is visible; the rule for corners is that of `sight.kernel`."""
    space, targets = candidates.space, candidates.targets
    origin = local_origin(space.floor)
    places, row = viewpoints_of(candidates)
    scene = scene_of(
        open_space(candidates), targets.a - origin, targets.b - origin, targets.units, targets.occluding
    )
    runs = sight(scene, to_grid(places - origin), reach=space.settings.range)
    start = targets.first_unit[:-1].astype(runs.low.dtype)[runs.segment]
    return Visibility(
        candidates=candidates,
        pointer=frozen(runs.pointer[np.searchsorted(row, np.arange(len(candidates.kept) + 1))], np.int64),
        segment=read_only(runs.segment),
        first=read_only(np.add(runs.low, start, out=runs.low)),
        last=read_only(np.add(runs.high, start, out=runs.high)),
        method="exact",
    )


def viewpoints_of(candidates: Candidates) -> tuple[FloatArray, IntArray]:
    """Viewpoints of the kept candidates (n, 2), and the row of each (n,), ascending.

    A scanner in a doorway keeps that door open. So where doors are closed for the laser, it looks from
    both sides of the door's line.
    """
    xy = candidates.xy[candidates.kept]
    row = np.arange(len(xy))
    if candidates.settings.doors == "open" or not len(candidates.doorway_rows):
        return xy, row
    twice = np.repeat(row, np.where(np.isin(row, candidates.doorway_rows), 2, 1))
    places = xy[twice]
    first = np.searchsorted(twice, candidates.doorway_rows)
    sides = sides_of_doors(candidates.space, xy[candidates.doorway_rows])
    places[first], places[first + 1] = sides[:, 0], sides[:, 1]
    return places, twice


def sides_of_doors(space: NavigableSpace, points: FloatArray) -> FloatArray:
    """The two viewpoints (n, 2, 2) of a scanner in each doorway (n, 2), on both sides of the door's line."""
    ends, tree = _door_lines(space)
    point, door = tree.query_nearest(shapely.points(points), all_matches=True)
    nearest = np.full(len(points), len(ends))
    np.minimum.at(nearest, point, door)
    a, b = ends[nearest, 0], ends[nearest, 1]
    across = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1) / np.hypot(*(b - a).T)[:, None]
    return np.stack([points + DOOR_OFFSET * across, points - DOOR_OFFSET * across], axis=1)


@instance_cached
def _door_lines(space: NavigableSpace) -> tuple[FloatArray, shapely.STRtree]:
    """Ends of each door's line (doors, 2, 2), and a tree of the lines."""
    lines = [item.opening.line for item in space.openings]
    ends = np.array([(line[0], line[-1]) for line in lines]).reshape(-1, 2, 2)
    return ends, shapely.STRtree([shapely.LineString(line) for line in lines])


def open_space(candidates: Candidates) -> Mesh:
    """A mesh of the open space: a frame around the floor, minus the occluders."""
    space = candidates.space
    return open_space_around(candidates, whole_steps_of(space.occluders, local_origin(space.floor)))


def open_space_around(candidates: Candidates, solids: BaseGeometry) -> Mesh:
    """A mesh of the open space around these solids, which are the occluders in whole grid steps.

    Their outlines meet only at vertices. So the mesh's edges are exactly their faces.
    """
    space = candidates.space
    origin = local_origin(space.floor)
    outlines = [polygon.exterior for polygon in space.occluders]
    low_x, low_y, high_x, high_y = bounds([space.targets.a, space.targets.b, candidates.xy, *outlines])
    corners = np.array([(low_x - MARGIN, low_y - MARGIN), (high_x + MARGIN, high_y + MARGIN)]) - origin
    frame = shapely.box(*to_grid(corners).ravel())
    return mesh_of(shapely.difference(frame, solids))
