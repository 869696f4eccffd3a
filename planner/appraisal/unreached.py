"""Floor that a plan does not enter: rooms, and areas of other rooms, each with the reason."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from stopgo.mission.stages import AT_EDGE, IN_HOLE, OTHER_PART, TOO_CLOSE, UNREACHABLE, Candidates, Unreached
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.space.floor_gaps import gap_before
from stopgo.planner.space.local_shapes import obstacles_of, room_shapes
from stopgo.planner.space.opening_joins import PROBES
from stopgo.planner.space.reach import reach_of, room_areas_by_part

LEAST_AREA = 0.01
"""Rooms smaller than this (m²) are not reported."""
LEAST_CUT_OFF = 1.0
"""Cut-off areas of a room with a drive area smaller than this (m²) are not reported."""


def unreached(candidates: Candidates, planned: frozenset[int] | None = None) -> tuple[Unreached, ...]:
    """Every room without a reachable candidate, and every cut-off area of the other rooms.

    `planned` are the parts of the floor that any plan enters; by default the part of these candidates.
    """
    parts = planned or frozenset([candidates.chosen_part])
    found: list[Unreached] = []
    for index, room in enumerate(candidates.space.rooms):
        here = candidates.room == index
        area = sum(polygon.area for polygon in room.area)
        if np.isin(candidates.part[here], sorted(parts)).any():
            found += _cut_off(candidates, index, parts)
        elif area > LEAST_AREA:
            reasons = set(candidates.reason[here].tolist())
            found.append(Unreached(room.name, _why(candidates, index, reasons, parts), area))
    return tuple(found)


def _cut_off(candidates: Candidates, index: int, parts: frozenset[int]) -> Iterator[Unreached]:
    """Areas of an entered room where the robot could drive but that it cannot reach."""
    space = candidates.space
    for part, area in sorted(room_areas_by_part(space)[index].items()):
        if part not in parts and area >= LEAST_CUT_OFF:
            shape = room_shapes(space)[index]
            x, y = _middle(candidates, part, shape)
            gap = gap_before(space, shape, parts)
            beyond = f" ({gap})" if gap else ""
            why = f"in another part of the floor round ({x:.1f}, {y:.1f}){beyond}; --all-parts plans it too"
            yield Unreached(f"an area of {space.rooms[index].name}", why, area)


def _middle(candidates: Candidates, part: int, room: shapely.Geometry) -> tuple[float, float]:
    """A point of a part within a room, in the drawing's metres."""
    found = reach_of(candidates.space).parts
    origin = local_origin(candidates.floor)
    pieces = [piece for piece, number in zip(found.pieces, found.part, strict=True) if number == part]
    inside = max((piece.intersection(room) for piece in pieces), key=lambda shape: shape.area)
    point = inside.representative_point()
    return float(point.x + origin[0]), float(point.y + origin[1])


def _why(candidates: Candidates, index: int, reasons: set[int], parts: frozenset[int]) -> str:
    settings = candidates.settings
    closed = _barriers(candidates, index, parts)
    if OTHER_PART in reasons:
        where = f"in another part of the floor ({closed})" if closed else "in another part of the floor"
        return f"{where}; --all-parts plans it too"
    if UNREACHABLE in reasons:
        return f"the robot does not fit in ({closed or 'too narrow'})"
    if AT_EDGE in reasons:  # of positions far enough from elements
        gap = _gap(candidates, index, parts)
        return f"no position {settings.edge:g} m from the floor's edges{f' ({gap})' if gap else ''}"
    if TOO_CLOSE in reasons:
        return f"no position {settings.d_sec:g} m from every element{_smaller_d_sec(candidates, index)}"
    return "no floor in it" if IN_HOLE in reasons else "no position for a stop"


def _smaller_d_sec(candidates: Candidates, index: int) -> str:
    """The greatest d_sec, in whole centimetres, that leaves a stop position, if the robot fits there."""
    space = candidates.space
    settings, obstacles = space.settings, obstacles_of(space)
    free = room_shapes(space)[index].difference(obstacles)
    if free.is_empty:
        return ""
    middle = shapely.get_point(shapely.maximum_inscribed_circle(free, tolerance=1e-3), 0)
    edge = to_shape(space.floor.outline, local_origin(space.floor)).boundary
    d_sec = math.floor(100 * middle.distance(obstacles.boundary) + 1e-6) / 100
    fits = d_sec >= settings.radius and middle.distance(edge) >= settings.edge
    return f"; --clearance {d_sec:g} leaves one" if fits and d_sec < settings.d_sec else ""


def _barriers(candidates: Candidates, index: int, parts: frozenset[int]) -> str:
    """The openings of a room that are not passable, and the gap in the floor before it, in words."""
    barriers = (_closed_openings(candidates, index), _gap(candidates, index, parts))
    return "; ".join(item for item in barriers if item)


def _gap(candidates: Candidates, index: int, parts: frozenset[int]) -> str:
    """The gap in the floor between a room and the planned parts, in words."""
    space = candidates.space
    return gap_before(space, room_shapes(space)[index], parts)


def _closed_openings(candidates: Candidates, index: int) -> str:
    """The openings of a room that are not passable, in words; or that it has none."""
    space = candidates.space
    room = space.rooms[index].room
    if room is None and not space.floor.rooms:
        return ""
    its = [item for item in space.openings if room in item.rooms]
    if room is None:
        shape = room_shapes(space)[index]
        lines = [shapely.LineString(item.opening.line - local_origin(space.floor)) for item in its]
        its = [item for item, line in zip(its, lines, strict=True) if line.distance(shape) <= PROBES[-1]]
    if not its:
        return "no door or passage is drawn on its outline"
    return "; ".join(
        f"{item.opening.kind} {item.opening.id}: {item.why}" for item in its if not item.passable
    )
