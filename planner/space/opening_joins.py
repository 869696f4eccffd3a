"""Doors and passages: the rooms they join, their clear width, and the reason if they are closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.floor import FloorPlan, Opening
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.planner.geometry.ring_index import RingIndex
from stopgo.planner.geometry.shapes import SLACK, boundary_lines, local_origin, to_shape, widened
from stopgo.planner.geometry.side_work import in_halves

PROBES = (0.15, 0.25, 0.4, 0.6)
"""Distances in metres from an opening's line at which its rooms are searched."""
THRESHOLD = 0.3
"""Half the depth of the floor assumed under an opening."""
ALONG = 2e-4
"""A line this close (m) to an obstacle runs along it."""
END_GAP = 0.1
"""An opening's line may end this short of its jamb."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """An opening in the local frame, before its reachability is known."""

    opening: Opening
    clear: BaseGeometry
    """The widest piece of its line that is free of obstacles; empty if there is none."""
    rooms: tuple[int | None, int | None]
    closed_because: str
    """Reason why no robot of any size may pass; empty if it may."""

    @property
    def width(self) -> float:
        return float(self.clear.length)


def crossings_of(
    floor: FloorPlan, obstacles: RingIndex, settings: Settings, *, forked: bool = False
) -> tuple[Crossing, ...]:
    """Every opening with its clear width and the rooms on its sides; in two processes if `forked`."""
    origin = local_origin(floor)
    rooms = shapely.STRtree([to_shape(room.polygons, origin) for room in floor.rooms])
    shapely.prepare(rooms.geometries)
    outline = to_shape(floor.outline, origin)
    shapely.prepare(outline)

    def found(openings: Sequence[Opening]) -> list[Crossing]:
        return [_crossing(item, origin, obstacles, rooms, outline, settings) for item in openings]

    return tuple(in_halves(found, floor.openings, forked=forked))


def _crossing(
    opening: Opening,
    origin: FloatArray,
    obstacles: RingIndex,
    rooms: shapely.STRtree,
    outline: BaseGeometry,
    settings: Settings,
) -> Crossing:
    line = shapely.LineString(opening.line - origin)
    if line.length <= SLACK:
        return Crossing(opening, shapely.LineString(), (None, None), "its line has no length")
    clear = widest_clear(line, obstacles)
    sides = (None, None) if clear.is_empty else _sides(clear, rooms)
    return Crossing(opening, clear, sides, _closed(clear, sides, outline, opening, settings))


def widest_clear(line: BaseGeometry, obstacles: RingIndex) -> BaseGeometry:
    """The longest piece of an opening's line between obstacles; empty if there is none.

    A line drawn along a wall's face, or within ALONG of it, counts as inside the wall there.
    """
    near = part_near(obstacles, line)
    clear = _longest(line.difference(near).difference(_alongside(line, near)))
    if clear.is_empty:
        return clear
    a, b = shapely.get_coordinates(clear)[[0, -1]]
    step = ALONG * (b - a) / np.hypot(*(b - a))
    reach = shapely.LineString([a - step, b + step]).difference(near)
    whole = shapely.get_coordinates(line)[[0, -1]]
    ends = shapely.get_coordinates(_longest(reach))[[0, -1]]
    return shapely.LineString([_clamped(end, whole) for end in ends])


def _alongside(line: BaseGeometry, obstacles: BaseGeometry) -> BaseGeometry:
    """The area within ALONG of the obstacle outlines near a line."""
    edges = boundary_lines(obstacles)
    return widened(edges[shapely.dwithin(edges, line, ALONG)], ALONG, quad_segs=16)


def _longest(lines: BaseGeometry) -> BaseGeometry:
    pieces = [piece for piece in shapely.get_parts(lines) if piece.length > SLACK]
    return max(pieces, key=lambda piece: piece.length, default=shapely.LineString())


def _clamped(point: FloatArray, ends: FloatArray) -> FloatArray:
    """The point, or the end of the line (2, 2) that it lies beyond."""
    along = ends[1] - ends[0]
    t = float(np.dot(point - ends[0], along) / np.dot(along, along))
    return ends[0] if t < 0 else ends[1] if t > 1 else point


def part_near(shape: RingIndex, line: BaseGeometry) -> BaseGeometry:
    """The part of a large shape within 1 m of a line's bounds, which is faster to compute with."""
    x0, y0, x1, y1 = line.bounds
    return shape.within((x0 - 1.0, y0 - 1.0, x1 + 1.0, y1 + 1.0))


def _sides(clear: BaseGeometry, rooms: shapely.STRtree) -> tuple[int | None, int | None]:
    """The rooms found by probing at right angles from the middle of the clear piece.

    Where rooms lie in rooms, the innermost counts.
    """
    middle, across = middle_and_normal(clear)
    found = []
    for sign in (1.0, -1.0):
        points = (shapely.Point(middle + sign * step * across) for step in PROBES)
        hits = (_around(point, rooms) for point in points)
        nearest = next((some for some in hits if len(some)), ())
        found.append(min(map(int, nearest), key=lambda k: (rooms.geometries[k].area, k), default=None))
    return found[0], found[1]


def _around(point: BaseGeometry, rooms: shapely.STRtree) -> IntArray:
    """The rooms that a point lies in. They are prepared: a room around thousands has as many holes."""
    near = rooms.query(point)
    return near[shapely.intersects(rooms.geometries[near], point)]


def middle_and_normal(line: BaseGeometry) -> tuple[FloatArray, FloatArray]:
    """Midpoint of a straight line and the unit vector to its left."""
    a, b = shapely.get_coordinates(line)[[0, -1]]
    along = (b - a) / np.hypot(*(b - a))
    return (a + b) / 2, np.array([-along[1], along[0]])


def _closed(
    clear: BaseGeometry,
    sides: tuple[int | None, int | None],
    outline: BaseGeometry,
    opening: Opening,
    settings: Settings,
) -> str:
    if clear.is_empty:
        return "obstacles fill it"
    if clear.length < settings.door_access - SLACK:
        return f"{clear.length:.3f} m clear, less than door_access {settings.door_access:.3f} m"
    if opening.kind == "door" and _is_exterior(clear, sides, outline):
        return "exterior: no floor on one side"
    return ""


def _is_exterior(clear: BaseGeometry, sides: tuple[int | None, int | None], outline: BaseGeometry) -> bool:
    """True if one side has neither a room nor floor, beyond the thickness of walls."""
    return any(
        room is None and not outline.intersects(end) for room, end in zip(sides, _ends(clear), strict=True)
    )


def _ends(clear: BaseGeometry) -> tuple[BaseGeometry, BaseGeometry]:
    """Points on both sides of an opening, beyond the thickness of walls."""
    middle, across = middle_and_normal(clear)
    left, right = (shapely.Point(middle + sign * PROBES[-1] * across) for sign in (1.0, -1.0))
    return left, right


def threshold(crossing: Crossing) -> BaseGeometry:
    """The floor under an opening: its clear piece, as deep as walls are thick."""
    return crossing.clear.buffer(THRESHOLD, cap_style="flat")


def barrier(crossing: Crossing, origin: FloatArray, obstacles: RingIndex) -> FloatArray:
    """The opening's line (2, 2), extended to the jambs when it ends just short of them."""
    a, b = crossing.opening.line - origin
    along = (b - a) / max(float(np.hypot(*(b - a))), SLACK)
    ends = []
    for end, outward in ((a, -along), (b, along)):
        reach = shapely.LineString([end, end + END_GAP * outward])
        ends.append(end + END_GAP * outward if reach.intersects(part_near(obstacles, reach)) else end)
    return np.stack(ends)
