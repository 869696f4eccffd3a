"""Targets to be scanned: element boundaries, touching solids unioned, divided into units (paper, 3.1)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import FloatArray, IntArray, frozen, polyline_length
from stopgo.mission.stages import Targets
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.near_shapes import labels_of
from stopgo.planner.geometry.shapes import (
    GRID,
    LINE_WALL,
    face_segments,
    local_origin,
    mended,
    one_shape,
    polygon_parts,
    snapped,
    snapped_each,
    to_grid,
    union_of_snapped,
)

CRACK = 2e-4
"""Solids at most this far apart (m) touch."""
MITRE = 100.0
"""Where solids are widened to close cracks, corners reach at most this many times as far."""
NOISE = GRID / 100
"""Width in metres up to which closing cracks widens a face by rounding only."""
STRAIGHT = 1.5
"""A vertex less than this many grid steps off the line of its neighbours is on it: snapping moved it."""
CLEAR = 2.5
"""Grid steps that a straightened face keeps from all other vertices: more than STRAIGHT, so that two
straightened faces do not cross."""
FLUSH = 3 * GRID
"""A line along a face, at most this far (m) from it, is flush with it."""


def occluders_of(floor: FloorPlan, closed: FloatArray) -> BaseGeometry:
    """Union of everything that blocks the laser, on the grid, in the local frame.

    A wall drawn as a single line is LINE_WALL thick, so that it has two faces. `closed` are openings that
    block the laser too, as segments (k, 2, 2) in the local frame.
    """
    doors = snapped_each([thin_solid(segment, LINE_WALL) for segment in closed])
    solids = np.concatenate([_occluding(floor)[1], doors])
    return without_needless_vertices(without_cracks(union_of_snapped(solids)), floor)


@instance_cached
def _occluding(floor: FloorPlan) -> tuple[list[int], NDArray[np.object_]]:
    """The occluding elements and their solids, on the grid."""
    origin = local_origin(floor)
    indices = [k for k, item in enumerate(floor.elements) if item.occludes]
    solids = [solid_of(floor.elements[k], origin, LINE_WALL) for k in indices]
    return indices, snapped_each(solids)


def without_cracks(shape: BaseGeometry) -> BaseGeometry:
    """Close hairline gaps between solids that were drawn to touch and miss by rounding.

    Else the laser would pass through the gap, and its faces would be targets that are never visible.
    """
    parts = np.array(polygon_parts(shape), dtype=object)
    cracks = _cracks(parts)
    if not cracks:
        return shape
    near = np.unique(shapely.STRtree(parts).query(cracks, predicate="dwithin", distance=CRACK)[1])
    filled = shapely.union_all([*parts[near], *cracks], grid_size=NOISE)
    return snapped(shapely.MultiPolygon([*np.delete(parts, near), *polygon_parts(filled)]))


def _cracks(parts: NDArray[np.object_]) -> list[shapely.Polygon]:
    """The hairline gaps in polygons and between them; GEOS takes long for all that lie apart at once."""
    group = labels_of(parts.tolist(), within=2 * MITRE * CRACK)
    order = np.argsort(group, kind="stable")
    shapes = shapely.multipolygons(parts[order], indices=group[order])
    wide = shapely.buffer(shapes, CRACK / 2, join_style="mitre", mitre_limit=MITRE)
    closed = [mended(one) for one in shapely.buffer(wide, -CRACK / 2, join_style="mitre", mitre_limit=MITRE)]
    found = shapely.difference(closed, shapes, grid_size=NOISE)
    return [part for one in found for part in polygon_parts(one)]


def solid_of(element: Element, origin: FloatArray, thickness: float) -> BaseGeometry:
    """An element's filled plan in the local frame; lines become solids of this thickness (m)."""
    parts = [one_shape(solid, origin) for solid in element.solids]
    parts += [thin_solid(line - origin, thickness) for line in element.lines if polyline_length(line) > 0]
    return parts[0] if len(parts) == 1 else shapely.union_all(parts)


def thin_solid(line: FloatArray, thickness: float) -> BaseGeometry:
    """A line (n, 2) as a solid of this thickness (m)."""
    wide = shapely.LineString(line).buffer(thickness / 2, cap_style="flat", join_style="mitre")
    return shapely.make_valid(wide)


def targets_of(floor: FloorPlan, occluders: BaseGeometry, *, d_dis: float) -> Targets:
    """Units of at most `d_dis` metres on every target element of the floor.

    Faces of occluding solids come from their union, so hidden joint faces are not targets. An element that
    does not occlude (a beam) keeps its own outline.
    """
    origin = local_origin(floor)
    faces, owners = _occluding_faces(floor, occluders)
    free = _free_segments(floor)
    drawn = np.array([s for s, _ in free]).reshape(-1, 2, 2)
    segments = np.concatenate([faces, off_faces(drawn, face_segments(occluders))])
    lengths = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    return Targets(
        a=frozen(segments[:, 0] + origin),
        b=frozen(segments[:, 1] + origin),
        units=frozen(units_on(lengths, d_dis=d_dis), np.int64),
        element=frozen([*owners, *(index for _, index in free)], np.int64),
        occluding=frozen([True] * len(faces) + [False] * len(free), np.bool_),
        raw=raw_units(floor, d_dis=d_dis),
    )


def units_on(lengths: FloatArray, *, d_dis: float) -> IntArray:
    """Least number of equal units of at most `d_dis` that make up each length (paper, 3.1).

    A length may exceed this by the amount that snapping its ends to the grid adds. So rotating the drawing
    does not add a unit.
    """
    return np.maximum(1, np.ceil((lengths - 2 * GRID) / d_dis)).astype(np.int64)


def raw_units(floor: FloorPlan, *, d_dis: float) -> dict[str, int]:
    """Units per kind, each element by itself, the paper's Table 2; targets and occluders only."""
    counts: dict[str, int] = {}
    for item in floor.elements:
        if item.target or item.occludes:
            edges = _edges(item)
            lengths = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
            counts[item.kind] = counts.get(item.kind, 0) + int(units_on(lengths, d_dis=d_dis).sum())
    return dict(sorted(counts.items()))


def _edges(element: Element) -> FloatArray:
    """Every segment (n, 2, 2) of an element's outlines and lines."""
    rings = [ring for solid in element.solids for ring in solid.rings]
    edges = [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    edges += [np.stack([line[:-1], line[1:]], axis=1) for line in element.lines]
    return np.concatenate([np.empty((0, 2, 2)), *edges])


def _free_segments(floor: FloorPlan) -> list[tuple[FloatArray, int]]:
    """Outline segments of targets that do not occlude, each with its element; duplicates count once."""
    origin = local_origin(floor)
    found: dict[tuple[tuple[float, ...], ...], tuple[FloatArray, int]] = {}
    for index, item in enumerate(floor.elements):
        if item.target and not item.occludes:
            for a, b in _edges(item):
                ends = tuple(sorted([tuple(a.tolist()), tuple(b.tolist())]))
                found.setdefault(ends, (np.stack([a, b]) - origin, index))
    return [found[ends] for ends in sorted(found)]


def off_faces(segments: FloatArray, faces: FloatArray) -> FloatArray:
    """Segments (n, 2, 2); a segment that runs along a face is moved slightly in front of it.

    Else rounding would put a beam flush with a wall in front of it or inside it. Its side would be visible
    at one angle of the drawing and hidden at another.
    """
    if not len(segments) or not len(faces):
        return segments
    tree = shapely.STRtree(shapely.linestrings(faces))
    free, face = tree.query(shapely.linestrings(segments), predicate="dwithin", distance=FLUSH)
    begin, extent = faces[face, 0], faces[face, 1] - faces[face, 0]
    length = np.hypot(*extent.T)
    along = extent / length[:, None]
    before = np.stack([-along[:, 1], along[:, 0]], axis=1)
    shared = np.ptp(np.clip(_dots(segments[free] - begin[:, None], along), 0.0, length[:, None]), axis=1)
    straight = np.ptp(_dots(segments[free], before), axis=1) * shared <= FLUSH * np.ptp(
        _dots(segments[free], along), axis=1
    )
    offset = np.zeros((len(segments), 2))
    np.add.at(offset, free, np.where(straight, shared, 0.0)[:, None] * before)
    size = np.maximum(np.hypot(*offset.T), LINE_WALL)
    return segments + (FLUSH * offset / size[:, None])[:, None]


def _dots(points: FloatArray, axes: FloatArray) -> FloatArray:
    """Coordinates of each pair of points (n, 2, 2) along its own axis (n, 2)."""
    return np.einsum("nij,nj->ni", points, axes)


def _occluding_faces(floor: FloorPlan, occluders: BaseGeometry) -> tuple[FloatArray, list[int]]:
    """Faces (m, 2, 2) of the union that belong to target elements, and their elements."""
    faces = face_segments(occluders)
    owners = owners_of(faces, floor)
    wanted = [k for k, owner in enumerate(owners) if owner >= 0 and floor.elements[owner].target]
    return faces[wanted], [owners[k] for k in wanted]


def owners_of(faces: FloatArray, floor: FloorPlan) -> list[int]:
    """The element whose boundary each face lies on; a target before another, then the first; else -1."""
    if not len(faces):
        return []
    indices, solids = _occluding(floor)
    tree = shapely.STRtree(shapely.boundary(solids))
    middles = shapely.points(faces.mean(axis=1))
    face, hit = tree.query(middles, predicate="dwithin", distance=3 * GRID)
    owners = [-1] * len(faces)
    for f, h in sorted(zip(face.tolist(), hit.tolist(), strict=True)):
        element = indices[h]
        if owners[f] < 0 or (floor.elements[element].target and not floor.elements[owners[f]].target):
            owners[f] = element
    return owners


def without_needless_vertices(shape: BaseGeometry, floor: FloorPlan | None = None) -> BaseGeometry:
    """Remove vertices on a straight face of one element, which crossings inside the union left there.

    Without a floor all faces count as one element's.

    They would divide a face and so give more units than the paper's least number. A straightened face keeps
    clear of every other vertex, so the outlines still meet at the same points and nowhere else.
    """
    corners = _Corners(shape, floor)
    polygons = []
    for part in polygon_parts(shape):
        oriented = shapely.orient_polygons(part, exterior_cw=True)
        rings = [
            corners.straightened(shapely.get_coordinates(r)[:-1])
            for r in (oriented.exterior, *oriented.interiors)
        ]
        polygons.append(shapely.Polygon(rings[0], rings[1:]))
    return shapely.MultiPolygon(polygons)


class _Corners:
    """All vertices of a union, with the test for vertices that a face does not need."""

    def __init__(self, shape: BaseGeometry, floor: FloorPlan | None) -> None:
        faces = face_segments(shape)
        owners = [0] * len(faces) if floor is None else owners_of(faces, floor)
        self._owner = dict(zip(map(_key, faces), owners, strict=True))
        self._uses = Counter(map(_key, faces[:, 0]))
        self._all = to_grid(np.array([*self._uses]).reshape(-1, 2)).astype(float)
        self._tree = shapely.STRtree(shapely.points(self._all))

    def straightened(self, ring: FloatArray) -> FloatArray:
        """Return the ring (n, 2) with the fewest vertices that keep its shape."""
        n, steps, needless = len(ring), to_grid(ring).astype(float), self._needless(ring)
        corner = steps.tolist()

        def is_straight(begin: int, end: int) -> bool:
            """Most vertices are off the line by far; three points show that."""
            if _is_off(corner[(end - 1) % n], corner[begin % n], corner[end % n]):
                return False
            return self._is_straight(steps, begin, end)

        needed = (k for k in range(n) if not (needless[k] and is_straight(k - 1, k + 1)))
        corners = [next(needed, 0)]
        for k in range(corners[0] + 2, corners[0] + n + 1):
            if not (needless[(k - 1) % n] and is_straight(corners[-1], k)):
                corners.append(k - 1)
        return ring[np.array(corners) % n] if len(corners) >= 3 else ring

    def _needless(self, ring: FloatArray) -> list[bool]:
        """True for each vertex between two faces of one element that no other ring has."""
        sides = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
        owners = [self._owner[_key(side)] for side in sides]
        return [self._uses[_key(xy)] == 1 and owners[k - 1] == owners[k] for k, xy in enumerate(ring)]

    def _is_straight(self, steps: FloatArray, begin: int, end: int) -> bool:
        """True if the vertices between two of a ring lie on their line, and no other vertex is near it."""
        between = steps[np.arange(begin + 1, end) % len(steps)]
        line = steps[[begin % len(steps), end % len(steps)]]
        if (_distance_to(between, line) >= STRAIGHT).any():
            return False
        near = self._all[self._tree.query(shapely.LineString(line), predicate="dwithin", distance=CLEAR)]
        return len(near) == len(between) + 2


def _is_off(point: Sequence[float], a: Sequence[float], b: Sequence[float]) -> bool:
    """True if a point is farther than STRAIGHT, for certain, from the line through two others."""
    x, y = b[0] - a[0], b[1] - a[1]
    area = x * (point[1] - a[1]) - y * (point[0] - a[0])
    return area * area > 1.01 * STRAIGHT * STRAIGHT * (x * x + y * y)


def _distance_to(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of each point (n, 2) to a line (2, 2) from end to end."""
    distance: FloatArray = shapely.distance(shapely.points(points), shapely.LineString(line))
    return distance


def _key(xy: FloatArray) -> tuple[float, ...]:
    return tuple(xy.ravel().tolist())
