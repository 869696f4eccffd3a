"""Valid polygons from drawn rings and lines: repair, joining, holes, and a canonical form.

Everything is in metres. Results do not depend on the order, direction or starting point of what is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray, Polygon, frozen, ring_area
from stopgo.planner.geometry.shapes import QUARTER, boundary_lines, noded_lines, widened

SNAP = 1e-3
"""Ends closer than this, in metres, meet."""
GAP = 0.05
"""The widest gap, in metres, that is closed in an outline."""
_GRID = 1e-4
"""Open lines are noded on a grid of this width in metres, so that an end on another line meets it."""
_AT_ONCE = 100
"""Shapes that are compared with all others at a time."""
SLIVER = 1e-6
"""Least area in m² of a solid."""

Region: TypeAlias = BaseGeometry
"""A shapely polygon or multipolygon."""


def closed_ring(points: FloatArray, *, closed: bool, gap: float = SNAP) -> FloatArray | None:
    """The ring (n, 2) that a polyline draws, first point not repeated; None if it is open."""
    if len(points) < 3:
        return None
    ends = float(np.hypot(*(points[-1] - points[0])))
    if not closed and ends > gap:
        return None
    return points[:-1] if ends <= SNAP else points


def without_repeats(points: FloatArray, *, within: float = 1e-6) -> FloatArray:
    """The polyline without points that repeat the one before."""
    moved = np.hypot(*np.diff(points, axis=0).T) > within
    return points[np.concatenate(([True], moved))]


def repaired(ring: FloatArray) -> tuple[list[shapely.Polygon], bool]:
    """Return valid polygons that cover the area in `ring`, and True if the ring had to be changed."""
    if len(ring) < 3:
        return [], True
    drawn = shapely.Polygon(ring)
    if drawn.is_valid:
        return ([drawn], False) if drawn.area > SLIVER else ([], True)
    # "structure" fills what a ring goes round twice; by "linework" a part of an obstacle would be free.
    return polygons_of(shapely.make_valid(drawn, method="structure", keep_collapsed=False)), True


def polygons_of(region: Region) -> list[shapely.Polygon]:
    """Return the polygons of any geometry, without slivers, lines and points."""
    parts = [region] if isinstance(region, shapely.Polygon) else shapely.get_parts(shapely.get_parts(region))
    return [part for part in parts if isinstance(part, shapely.Polygon) and part.area > SLIVER]


def canonical(polygon: shapely.Polygon) -> Polygon:
    """Return the canonical form of a polygon: rings start at their smallest vertex, holes are sorted."""
    holes = [canonical_ring(hole, clockwise=True) for hole in polygon.interiors]
    return Polygon(canonical_ring(polygon.exterior), tuple(sorted(holes, key=lambda hole: hole.tolist())))


def canonical_ring(ring: shapely.LinearRing, *, clockwise: bool = False) -> FloatArray:
    """A ring's points (n, 2) from its lexicographically smallest one, the first not repeated."""
    points = shapely.get_coordinates(ring)[:-1]
    if (ring_area(points) < 0) != clockwise:
        points = points[::-1]
    first = int(np.lexsort((points[:, 1], points[:, 0]))[0])
    return frozen(np.concatenate((points[first:], points[:first])))


def canonical_region(region: Region) -> tuple[Polygon, ...]:
    """Return all polygons of a region in canonical form, sorted."""
    return tuple(sorted(map(canonical, polygons_of(region)), key=lambda part: part.exterior.tolist()))


def canonical_line(points: FloatArray) -> FloatArray:
    """Return the canonical form of an open line: from its lexicographically smaller end."""
    return frozen(points[::-1] if points[::-1].tolist() < points.tolist() else points)


def to_shapely(polygon: Polygon) -> shapely.Polygon:
    return shapely.Polygon(polygon.exterior, polygon.holes)


def distinct(polygons: Sequence[shapely.Polygon]) -> list[int]:
    """For each polygon the index of the first that draws the same within `SNAP`, or its own."""
    drawn: dict[bytes, int] = {}
    equal = [drawn.setdefault(shape.wkb, k) for k, shape in enumerate(polygons)]
    kept = list(drawn.values())
    first = {k: kept[other] for k, other in zip(kept, _first_alike([polygons[k] for k in kept]), strict=True)}
    return [first[k] for k in equal]


def _first_alike(polygons: Sequence[shapely.Polygon]) -> list[int]:
    """Return `distinct` of polygons that all differ: of equal ones all pairs would be compared."""
    first = list(range(len(polygons)))
    shapes = np.array(polygons, dtype=object)
    boxes = shapely.bounds(shapes)
    for index, other in _pairs(shapes):
        near = (other < index) & (np.abs(boxes[index] - boxes[other]) <= SNAP).all(axis=1)
        for k, earlier in sorted(zip(index[near].tolist(), other[near].tolist(), strict=True)):
            if first[k] == k and first[earlier] == earlier and _same(shapes[earlier], shapes[k]):
                first[k] = earlier
    return first


def _pairs(shapes: NDArray[np.object_]) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs of shapes whose boxes meet, of some shapes at a time: those of many nested ones take memory."""
    tree = shapely.STRtree(shapes)
    for begin in range(0, len(shapes), _AT_ONCE):
        index, other = tree.query(shapes[begin : begin + _AT_ONCE])
        yield index + begin, other


def _same(one: shapely.Polygon, other: shapely.Polygon) -> bool:
    return bool(one.symmetric_difference(other).area <= SNAP * max(one.length, other.length) / 2)


def parents(polygons: Sequence[shapely.Polygon]) -> list[int | None]:
    """For each polygon the smallest larger one that contains it (within `SNAP`), or None."""
    shapes = np.array(polygons, dtype=object)
    area = shapely.area(shapes)
    found: list[int | None] = [None] * len(shapes)
    for inner, outer in _pairs(shapes):
        larger = np.flatnonzero(area[outer] > area[inner])
        order = larger[np.lexsort((outer[larger], area[outer[larger]], inner[larger]))]
        for k, around in zip(inner[order].tolist(), outer[order].tolist(), strict=True):
            if found[k] is None and _holds(shapes[around], shapes[k]):
                found[k] = around
    return found


def _holds(outer: shapely.Polygon, inner: shapely.Polygon) -> bool:
    return bool(outer.covers(inner)) or inner.difference(outer).area <= SNAP * inner.length / 2


def even_odd(polygons: Sequence[shapely.Polygon]) -> Region:
    """The region of nested rings: a ring in a ring is a hole, one in a hole is filled. Parts are unioned."""
    levels: dict[int, list[shapely.Polygon]] = {}
    for polygon, depth in zip(polygons, depths(polygons), strict=True):
        levels.setdefault(depth, []).append(polygon)
    region: Region = shapely.Polygon()
    for depth in sorted(levels):
        layer = shapely.union_all(levels[depth])
        region = region.difference(layer) if depth % 2 else region.union(layer)
    return region


def depths(polygons: Sequence[shapely.Polygon]) -> list[int]:
    """Number of other polygons that contain each polygon."""
    above = parents(polygons)
    found = [0] * len(polygons)
    for index in range(len(polygons)):
        parent = above[index]
        while parent is not None:
            found[index] += 1
            parent = above[parent]
    return found


@dataclass(frozen=True, eq=False)
class Joined:
    """Areas that open lines enclose together."""

    faces: tuple[shapely.Polygon, ...]
    """Enclosed areas, without regard to what lies within them."""
    loose: tuple[int, ...]
    """Indices of the lines that enclose nothing."""
    gaps: tuple[tuple[float, tuple[float, float]], ...]
    """Width and position of each gap that was closed."""


def joined(lines: Sequence[FloatArray], *, merge: bool, gap: float = GAP) -> Joined:
    """The rings that open lines form where their ends meet, or nearly meet.

    Parameters
    ----------
    merge
        True if areas that share an edge are one (a slab with a joint drawn in it), False if several (rooms).
    """
    if not lines:
        return Joined((), (), ())
    faces: list[shapely.Polygon] = []
    cells: list[shapely.Polygon] = []
    bridges, gaps = _bridges(lines, gap=gap)
    drawn = [shapely.LineString(line) for line in (*lines, *bridges)]
    for group in _connected(drawn):
        noded = noded_lines([drawn[index] for index in group], grid_size=_GRID)
        enclosed = polygons_of(shapely.polygonize([noded]))
        whole = polygons_of(shapely.union_all(enclosed)) if merge else enclosed
        faces += [shapely.Polygon(face.exterior) for face in whole]
        cells += enclosed
    edges = widened(boundary_lines(shapely.MultiPolygon(cells)), SNAP, quad_segs=QUARTER)
    alongside = shapely.length(shapely.intersection(drawn, edges)) / shapely.length(drawn)
    loose = tuple(index for index in range(len(lines)) if alongside[index] < 0.5)
    return Joined(tuple(faces), loose, tuple(gaps))


def _bridges(
    lines: Sequence[FloatArray], *, gap: float
) -> tuple[list[FloatArray], list[tuple[float, tuple[float, float]]]]:
    """Short lines between free ends that are each other's nearest, and those of them longer than `SNAP`."""
    ends = _free_ends(lines)
    if len(ends) < 2:
        return [], []
    from scipy.spatial import cKDTree

    apart, nearest = cKDTree(ends).query(ends, k=[2])
    nearest = nearest[:, 0]
    mutual = np.flatnonzero((nearest[nearest] == np.arange(len(ends))) & (apart[:, 0] <= gap))
    pairs = [(int(i), int(nearest[i])) for i in mutual if i < nearest[i]]
    bridges = [ends[[i, j]] for i, j in pairs]
    wide = [(float(apart[i, 0]), _point(ends[i])) for i, _ in pairs if apart[i, 0] > SNAP]
    return bridges, wide


def _free_ends(lines: Sequence[FloatArray]) -> FloatArray:
    ends = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 2)
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    return ends[np.sort(first[count == 1])]


def _point(xy: FloatArray) -> tuple[float, float]:
    return (float(xy[0]), float(xy[1]))


def _connected(drawn: Sequence[shapely.LineString]) -> list[list[int]]:
    """Indices of lines that touch one another, group by group."""
    touching = shapely.STRtree(drawn).query(drawn, predicate="intersects")
    links = coo_array((np.ones(touching.shape[1]), tuple(touching)), shape=(len(drawn), len(drawn)))
    _, group = connected_components(links, directed=False)
    return [np.flatnonzero(group == index).tolist() for index in np.unique(group)]
