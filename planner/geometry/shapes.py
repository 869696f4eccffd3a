"""Conversion between arrays and shapely: polygons in a local frame, snapped to a grid of 10 µm.

The local frame begins at the lower left corner of the floor. So coordinates stay small, and a floor that is
moved gets the same plan. On the grid, orientation tests are exact integer arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document.problems import FAR
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray, Polygon, bounds, frozen
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.near_shapes import labels_of

GRID = 1e-5
"""Metres per grid step."""
LINE_WALL = 1e-3
"""Thickness in metres given to an occluding element that is drawn as a single line."""
SLACK = 1e-6
"""Clearances may fall short by this much, in metres: float noise, far below any drawing's precision."""
HAIRLINE = 4e-7
"""Thickness in metres that an obstacle drawn as a single line gets, so that it has an inside."""
LARGEST = 5000.0
"""Greatest extent of a floor in metres; with the elements around it, it stays within FARTHEST_STEPS."""
FEW = 5_000
"""Vertices up to which shapes are united all at once; more take half the time where they lie apart."""
MANY_POINTS = 20_000
"""Vertices of lines above which they are united in a mixed order."""
APART = 4.0
"""Grid steps from which on two shapes do not change each other's rounding, with room to spare."""
SAMPLE, CROWDED = 200, 30
"""Shapes whose boxes are looked at, and boxes over each above which shapes are united all at once."""
SETTLING = 20
"""Maximum number of rounding passes until an outline no longer changes; two or three are enough."""
FARTHEST_STEPS = 2**29
"""Grid steps from 0, 0 up to which all integer arithmetic is exact, a little more than 5.3 km."""


@instance_cached
def local_origin(floor: FloorPlan) -> FloatArray:
    """The lower left corner of everything on the floor (2,); refuses floors too large or too far."""
    drawn = {"its outline": [ring for polygon in floor.outline for ring in polygon.rings]}
    drawn |= {room.id: [ring for polygon in room.polygons for ring in polygon.rings] for room in floor.rooms}
    drawn |= {item.id: [item.line] for item in floor.openings}
    drawn |= {e.id: [*(ring for solid in e.solids for ring in solid.rings), *e.lines] for e in floor.elements}
    low_x, low_y, high_x, high_y = bounds(part for parts in drawn.values() for part in parts)
    extent = max(high_x - low_x, high_y - low_y)
    if extent > LARGEST:
        raise InputError(
            f"{floor.name}: {extent:.0f} m across with {_farthest(drawn)}, more than {LARGEST:.0f} m; "
            "check it, and the drawing's units"
        )
    away = max(-low_x, -low_y, high_x, high_y)
    if away > FAR:
        raise InputError(
            f"{floor.name}: lies {away:.3g} m from its origin, and no mission reaches beyond {FAR:g} m; "
            "check it, and the drawing's units"
        )
    return frozen([low_x, low_y])


def _farthest(drawn: Mapping[str, Sequence[FloatArray]]) -> str:
    """Name of the element that reaches farthest from the first point of all."""
    first = next(part[0] for parts in drawn.values() for part in parts if len(part))
    away = {
        name: max((float(np.hypot(*(part - first).T).max()) for part in parts if len(part)), default=0.0)
        for name, parts in drawn.items()
    }
    return max(away, key=lambda name: away[name])


def to_shape(polygons: Iterable[Polygon], origin: FloatArray) -> BaseGeometry:
    """The union of `polygons` as one shapely geometry in the local frame; polygons that lie apart are it."""
    shapes = [one_shape(polygon, origin) for polygon in polygons]
    if len(shapes) > 1 and all(isinstance(shape, shapely.Polygon) for shape in shapes):
        whole = shapely.MultiPolygon(shapes)
        if whole.is_valid and not any(shape.is_empty for shape in shapes):
            return shapely.normalize(shapely.remove_repeated_points(whole))
    return union(shapes)


def union(shapes: Iterable[BaseGeometry]) -> BaseGeometry:
    """The union of shapes, the same to the last bit in whatever order they come.

    Where edges nearly meet, GEOS sometimes loses a piece without an error. If a corner is missing from the
    union, the union is made again on a grid far finer than SLACK, which is reliable.
    """
    found = np.array(list(shapes), dtype=object)
    if len(found) == 1 and found[0].geom_type == "Polygon" and found[0].is_valid:
        return shapely.normalize(shapely.remove_repeated_points(found[0]))
    ordered = found[np.argsort(shapely.to_wkb(found), kind="stable")]
    whole = _united(ordered, within=APART * GRID)
    if len(found) > 1 and not _has_corners(whole, shapely.get_coordinates(found)):
        whole = shapely.union_all(ordered, grid_size=SLACK / 100)
    return shapely.normalize(whole)


def _has_corners(whole: BaseGeometry, corners: FloatArray) -> bool:
    """True if a shape contains all of these points (n, 2), or comes close; most are corners of its own."""
    own = shapely.get_coordinates(whole).view(np.complex128).ravel()
    others = corners[~np.isin(corners.view(np.complex128).ravel(), own)]
    shapely.prepare(whole)
    return bool(shapely.dwithin(whole, shapely.points(others), SLACK).all())


def one_shape(polygon: Polygon, origin: FloatArray) -> BaseGeometry:
    """One polygon in the local frame, repaired where it crosses itself; empty if it has no area."""
    if len(polygon.exterior) < 3:
        return shapely.Polygon()
    holes = [hole - origin for hole in polygon.holes if len(hole) >= 3]
    return mended(shapely.Polygon(polygon.exterior - origin, holes))


def mended(shape: BaseGeometry) -> BaseGeometry:
    """The valid part of a polygonal geometry, itself if it is valid; empty if it has no area."""
    return shape if shape.is_valid else shapely.union_all(polygon_parts(shapely.make_valid(shape)))


def to_polygons(shape: BaseGeometry, origin: FloatArray) -> tuple[Polygon, ...]:
    """The polygonal parts of `shape` in the drawing's coordinates, in a canonical order."""
    polygons = [
        Polygon.of(
            shapely.get_coordinates(part.exterior) + origin,
            [shapely.get_coordinates(hole) + origin for hole in part.interiors],
        )
        for part in polygon_parts(shape)
    ]
    return tuple(sorted(polygons, key=lambda polygon: tuple(polygon.exterior.min(axis=0))))


def polygon_parts(shape: BaseGeometry) -> list[shapely.Polygon]:
    """The polygons of a geometry of any type, empty ones left out."""
    if shape.geom_type == "Polygon":
        return [] if shape.is_empty else [shape]
    parts = shapely.get_parts(shapely.get_parts(shape))
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]


def snapped(shape: BaseGeometry) -> BaseGeometry:
    """The same shape, valid, every vertex on the grid, no line within half a step of another's vertex.

    So snapping it again changes nothing, and operations on its whole steps find no new crossing.
    """
    return snapped_each([shape])[0]


def snapped_each(shapes: Sequence[BaseGeometry]) -> NDArray[np.object_]:
    """Every shape `snapped` by itself."""
    return _in_metres(_settled(_in_steps(np.array(shapes, dtype=object))))


def snapped_union(shapes: Sequence[BaseGeometry]) -> BaseGeometry:
    """The union of shapes, `snapped`, with every crossing a vertex."""
    return union_of_snapped(snapped_each(shapes))


def union_of_snapped(shapes: NDArray[np.object_]) -> BaseGeometry:
    """The same, of shapes that are each `snapped` already."""
    found = _in_steps(shapes)
    ordered = found[np.argsort(shapely.to_wkb(found), kind="stable")]
    whole = np.array([_united(ordered, within=APART, grid_size=1.0)], dtype=object)
    return shapely.normalize(_in_metres(_settled(whole))[0])


def noded_lines(lines: Sequence[BaseGeometry] | NDArray[np.object_], *, grid_size: float) -> BaseGeometry:
    """The union of lines on a grid: they meet at their ends only.

    Very many segments are taken in a mixed order. GEOS keeps the grid's points in an unbalanced tree,
    so points in a row, as of a comb, took time as the square of their number.
    """
    parts = shapely.get_parts(np.asarray(lines, dtype=object))
    if shapely.get_num_coordinates(parts).sum() > MANY_POINTS:
        xy, of = shapely.get_coordinates(parts, return_index=True)
        pieces = np.stack([xy[:-1], xy[1:]], axis=1)[of[:-1] == of[1:]]
        parts = shapely.linestrings(np.random.default_rng(0).permutation(pieces))
    return shapely.union_all(parts, grid_size=grid_size)


def _united(shapes: NDArray[np.object_], *, within: float, grid_size: float | None = None) -> BaseGeometry:
    """The union of polygonal shapes; of many, those farther apart than `within` are united by themselves."""
    if shapely.get_num_coordinates(shapes).sum() <= FEW or _are_crowded(shapes):
        return shapely.union_all(shapes, grid_size=grid_size)
    group = labels_of(shapes.tolist(), within=within)
    groups = np.split(shapes[np.argsort(group, kind="stable")], np.cumsum(np.bincount(group))[:-1])
    parts = [part for some in groups for part in polygon_parts(shapely.union_all(some, grid_size=grid_size))]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def _are_crowded(shapes: NDArray[np.object_]) -> bool:
    """True if so many boxes of shapes overlap that it would take long to find those that lie apart."""
    some = shapes[:: -(-len(shapes) // SAMPLE)]
    return shapely.STRtree(shapes).query(some).shape[1] > CROWDED * len(some)


def _in_steps(shapes: NDArray[np.object_]) -> NDArray[np.object_]:
    """The shapes in grid steps, not rounded to whole ones."""
    return shapely.transform(shapes, lambda xy: xy / GRID)


def _in_metres(steps: NDArray[np.object_]) -> NDArray[np.object_]:
    return shapely.transform(steps, lambda xy: np.rint(xy) / round(1 / GRID))  # 0.3, not 0.30000000000000004


def _settled(steps: NDArray[np.object_]) -> NDArray[np.object_]:
    """Round each shape to whole steps, until no line moved by rounding meets another vertex."""
    settled, moving = steps.copy(), np.arange(len(steps))
    for _ in range(SETTLING):
        before = settled[moving]
        settled[moving] = shapely.normalize(shapely.set_precision(shapely.set_precision(before, 1.0), 0))
        moving = moving[~shapely.equals_exact(before, settled[moving])]
        if not len(moving):
            return settled
    x, y = shapely.get_coordinates(settled[moving[0]]).mean(axis=0) * GRID
    raise StopgoError(f"outlines near ({x:.3f}, {y:.3f}) cannot be rounded to {GRID:g} m; draw them again")


def whole_steps(shape: BaseGeometry) -> BaseGeometry:
    """A shape that was `snapped` with its coordinates in whole grid steps: the very same vertices."""
    return shapely.transform(shape, lambda xy: to_grid(xy).astype(float))


def whole_steps_of(polygons: Iterable[Polygon], origin: FloatArray) -> BaseGeometry:
    """Polygons of a shape that was `snapped`, in the drawing's coordinates, as one in whole grid steps."""
    parts = [(one.exterior - origin, [hole - origin for hole in one.holes]) for one in polygons]
    return whole_steps(shapely.MultiPolygon(parts))


def to_grid(xy: FloatArray) -> NDArray[np.int64]:
    """Local coordinates in metres as whole grid steps; refuses those that are too large to be exact."""
    steps = np.rint(np.asarray(xy) / GRID)
    if not np.all(np.abs(steps) <= FARTHEST_STEPS):
        far, most = GRID * float(np.abs(steps).max()), GRID * FARTHEST_STEPS
        raise InputError(
            f"something lies {far:.0f} m from the floor's lower left corner, more than {most:.0f} m; "
            "check the drawing's units"
        )
    return steps.astype(np.int64)


def widened(
    lines: NDArray[np.object_],
    distance: float | FloatArray,
    *,
    quad_segs: int,
    grid_size: float | None = None,
) -> BaseGeometry:
    """All points at most `distance` metres (of each line its own) from straight lines.

    Lines are widened one by one: GEOS simplifies a whole outline before it widens it. At some angles the
    result is a polygon whose rings cross, on which later operations fail.
    """
    return shapely.union_all(shapely.buffer(lines, distance, quad_segs=quad_segs), grid_size=grid_size)


def roughly_widened(shape: BaseGeometry, distance: float, **style: Any) -> BaseGeometry:
    """A shape widened as a whole and made valid: fast, with an error of up to 1 % of the distance."""
    wide = shapely.buffer(shape, distance, **style)
    return shapely.make_valid(wide, method="structure", keep_collapsed=False)


def holds(region: BaseGeometry, shape: BaseGeometry, *, slack: float) -> bool:
    """True if a point or line lies in a region, or at most `slack` metres outside it."""
    if region.covers(shape):
        return True
    outside = shape.difference(region)
    edges = boundary_lines(region)
    near = edges[shapely.dwithin(edges, outside, slack)]
    return bool(widened(near, slack, quad_segs=QUARTER).covers(outside))


QUARTER = 4
GROWTH = float(1 / np.cos(np.pi / (4 * QUARTER)))
"""Radius of the polygon round a circle of radius 1 with 4 × QUARTER corners."""


def boundary_lines(shape: BaseGeometry) -> NDArray[np.object_]:
    """All boundary segments of a polygonal geometry as lines."""
    segments = segments_of(shape)
    return shapely.linestrings(segments) if len(segments) else np.empty(0, dtype=object)


def segments_of(shape: BaseGeometry) -> FloatArray:
    """All boundary segments (n, 2, 2) of a polygonal geometry, in ring order."""
    rings = [ring for part in polygon_parts(shape) for ring in (part.exterior, *part.interiors)]
    coordinates = [shapely.get_coordinates(ring) for ring in rings]
    pairs = [np.stack([ring[:-1], ring[1:]], axis=1) for ring in coordinates]
    return np.concatenate(pairs) if pairs else np.empty((0, 2, 2))


def face_segments(shape: BaseGeometry) -> FloatArray:
    """Boundary segments (n, 2, 2) with the solid on the right hand, in a canonical order."""
    segments = segments_of(shapely.orient_polygons(shape, exterior_cw=True))
    return segments[np.lexsort(segments.reshape(-1, 4).T[::-1])]


def first_corner(shape: BaseGeometry, origin: FloatArray) -> tuple[float, float]:
    """The first corner of a shape, in the drawing's metres."""
    x, y = min(map(tuple, shapely.get_coordinates(shape).tolist()))
    return (float(x + origin[0]), float(y + origin[1]))
