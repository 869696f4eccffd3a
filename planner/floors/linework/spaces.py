"""Derivation of the floor and its rooms from barriers: walls, glass, and the gaps that doors close."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.linework.wall_gaps import WallGap
from stopgo.planner.floors.rings import Region, polygons_of
from stopgo.planner.geometry.shapes import noded_lines

_CLOSED_OVER = (0.1, 0.6, 1.0, 1.6, 2.5, 4.0, 6.0)
"""Widths in metres of gaps in the outer walls that are closed, tried in this order."""
_ENOUGH = 0.8
"""The first width is taken that gives this share of the greatest floor."""
LEAST_ROOM = 1.0
"""Least area in m² of a room."""
_NARROW = 0.3
"""A space that is nowhere wider than this, in metres, is not a room."""
_OPEN = 0.25
"""A space open along more than this share of its outline, where nothing is drawn, is outside."""
_BESIDE = 0.05
_PATTERN = 20
"""So many closed cells on a floor's layer are a pattern of tiles."""
_CUT_TILE = 4.0
_TILE_EDGE = 0.25
"""A tile that a wall cuts off has at least this share of its outline drawn."""


@dataclass(frozen=True, eq=False)
class Spaces:
    """A floor and its rooms, in metres."""

    floor: Region
    rooms: tuple[shapely.Polygon, ...]
    closed_over: float | None = None
    """The widest gap in the outer walls that was closed; None where the outline is drawn."""
    tiled: bool = False
    """True if a pattern of tiles shows the floor."""


def floor_within(barriers: Region) -> Spaces:
    """Return the floor that barriers enclose, with gaps closed where necessary; empty if there is none."""
    filled = _filled(barriers)
    enough = _ENOUGH * _free(_closed(filled, _CLOSED_OVER[-1]), barriers)
    for width in _CLOSED_OVER:
        floor = _closed(filled, width)
        if _free(floor, barriers) >= enough:
            break
    parts = polygons_of(floor.difference(barriers))
    indoors = [part for part in parts if filled.contains(part) or _is_indoors(part, barriers)]
    if sum(part.area for part in indoors) < LEAST_ROOM:
        return Spaces(shapely.Polygon(), ())
    whole = shapely.union_all([*indoors, floor.intersection(barriers)])
    whole = whole.buffer(2e-3, join_style="mitre").buffer(-2e-3, join_style="mitre")
    kept = [part for part in polygons_of(whole) if _free(part, barriers) > LEAST_ROOM]
    return Spaces(shapely.union_all(kept).simplify(0.005), (), width)


def tiled_floor(lines: Sequence[FloatArray], barriers: Region) -> Region:
    """The floor that a pattern of tiles shows, up to the walls that cut tiles off; empty without a pattern.

    `lines` are the polylines (n, 2) of the pattern, without those of walls.
    """
    own = noded_lines([shapely.LineString(line) for line in lines], grid_size=1e-4)
    tiles = polygons_of(shapely.polygonize([own]))
    if len(tiles) < _PATTERN:
        return shapely.Polygon()
    largest = _CUT_TILE * float(np.median(shapely.area(tiles)))
    every = polygons_of(shapely.polygonize([noded_lines([own, barriers.boundary], grid_size=1e-4)]))
    free = [
        face for face in every if face.area <= largest and not barriers.contains(face.representative_point())
    ]
    beside = shapely.length(shapely.intersection(shapely.boundary(free), own.buffer(1e-3)))
    cut = [face for face, drawn in zip(free, beside, strict=True) if drawn >= _TILE_EDGE * face.length]
    shown = shapely.union_all([*tiles, *cut])
    return shapely.union_all([shown, barriers.intersection(shown.buffer(0.5))]).buffer(2e-3).buffer(-2e-3)


def _filled(shape: Region) -> Region:
    """A region without its holes."""
    return shapely.union_all([shapely.Polygon(part.exterior) for part in polygons_of(shape)])


def _closed(filled: Region, width: float) -> Region:
    """Area in or enclosed by a region when gaps up to `width` metres in it are closed."""
    wide = filled.buffer(width / 2, quad_segs=3)
    # Round joins cut into corners; what was there before is there afterwards.
    return shapely.union_all([_filled(wide).buffer(-width / 2, quad_segs=3), filled])


def _free(region: Region, barriers: Region) -> float:
    return float(region.area - region.intersection(barriers).area)


def _is_indoors(part: shapely.Polygon, barriers: Region) -> bool:
    if part.area < LEAST_ROOM:
        return False
    edge = shapely.get_coordinates(part.exterior.segmentize(0.25))
    middles = shapely.points((edge[:-1] + edge[1:]) / 2)
    open_to = shapely.distance(middles, barriers) > _BESIDE
    return bool(np.hypot(*(edge[1:] - edge[:-1])[open_to].T).sum() <= _OPEN * part.exterior.length)


def rooms_within(floor: Region, barriers: Region) -> tuple[shapely.Polygon, ...]:
    """The spaces of a floor that barriers part, without what is too small or narrow to be a room."""
    parts = polygons_of(floor.difference(barriers))
    return tuple(room for part in parts if part.area >= LEAST_ROOM for room in _without_slits(part))


def _without_slits(part: shapely.Polygon) -> list[shapely.Polygon]:
    """The spaces of one part; slits too narrow to pass do not connect rooms."""
    seeds = [
        seed for seed in polygons_of(part.buffer(-_NARROW / 2, join_style="mitre")) if seed.area > _NARROW**2
    ]
    if len(seeds) < 2:
        return [part] if seeds else []
    grown = [part.intersection(seed.buffer(_NARROW / 2 + 1e-3, join_style="mitre")) for seed in seeds]
    rooms = [max(polygons_of(room), key=lambda item: item.area) for room in grown]
    return [room for room in rooms if room.area >= LEAST_ROOM]


def sides_of(gap: WallGap, tree: shapely.STRtree) -> tuple[int | None, int | None]:
    """The rooms on the two sides of a gap; None where there is none."""
    a, b = gap.line
    middle, out = (a + b) / 2, (b - a)[::-1] * (-1.0, 1.0)
    out = out / (out @ out) ** 0.5
    sides = []
    for sign in (1.0, -1.0):
        steps = [gap.depth / 2 + step for step in (0.05, 0.15, 0.3)]
        found = [
            tree.query(shapely.Point(middle + sign * step * out), predicate="intersects") for step in steps
        ]
        sides.append(next((int(hits[0]) for hits in found if len(hits)), None))
    return sides[0], sides[1]
