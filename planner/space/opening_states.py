"""Openings that the robot can pass to the rooms on both sides, and the obstacle where it cannot."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import OpeningState
from stopgo.planner.geometry.ring_index import RingIndex
from stopgo.planner.geometry.shapes import (
    LINE_WALL,
    SLACK,
    boundary_lines,
    polygon_parts,
    to_shape,
    widened,
)
from stopgo.planner.space.connected_parts import Parts
from stopgo.planner.space.gaps import Gap, Walls, gaps_between
from stopgo.planner.space.ground import Ground
from stopgo.planner.space.opening_joins import Crossing, middle_and_normal

NEAR_OPENING = 1.6
"""Distance from an opening (m) within which the obstacle that blocks it is searched."""
REACHED_FRACTION = 0.2
"""An opening leads to a room if it reaches this fraction of the drive area there …"""
REACHED_AREA = 0.5
"""… or at least this much of it (m²)."""


def opening_states(
    ground: Ground, parts: Parts, settings: Settings
) -> tuple[tuple[OpeningState, ...], tuple[Finding, ...]]:
    """Return the state of each opening for the robot, and a finding for each inner one it cannot pass."""

    @cache
    def side_of(room: int | None) -> OpeningSide:
        return _opening_side(room, parts, ground)

    around = Surroundings(ground, settings)
    states, findings = [], []
    for crossing in ground.crossings:
        sides = [] if crossing.closed_because else [side_of(room) for room in crossing.rooms]
        why = crossing.closed_because or _not_reached(crossing, parts, sides, around)
        states.append(_state(crossing, why, ground.origin))
        if why and not why.startswith("exterior"):
            findings.append(_opening_finding(crossing, why, ground))
    return tuple(states), tuple(findings)


def _state(crossing: Crossing, why: str, origin: FloatArray) -> OpeningState:
    filled = crossing.clear.is_empty
    middle = crossing.opening.line.mean(axis=0) if filled else middle_and_normal(crossing.clear)[0] + origin
    return OpeningState(crossing.opening, crossing.rooms, crossing.width, frozen(middle), not why, why)


def _opening_finding(crossing: Crossing, why: str, ground: Ground) -> Finding:
    x, y = crossing.opening.line.mean(axis=0)
    names = " and ".join("outside" if k is None else ground.floor.rooms[k].label for k in crossing.rooms)
    message = f"{crossing.opening.kind} {crossing.opening.id} between {names} is not passable: {why}"
    code = "narrow_opening" if crossing.closed_because else "blocked_opening"
    return Finding(code, message, crossing.opening.id, (float(x), float(y)))


@dataclass(frozen=True)
class OpeningSide:
    """The room, or the floor outside every room, on one side of an opening."""

    shape: BaseGeometry
    main: frozenset[int]
    """Parts that make up a large fraction of the drive area there."""


def _opening_side(room: int | None, parts: Parts, ground: Ground) -> OpeningSide:
    """Return the side of an opening that is a room, or for None the floor outside every room."""
    if room is None:
        rooms = [to_shape(item.polygons, ground.origin) for item in ground.floor.rooms]
        shape = ground.outline.difference(shapely.union_all(rooms))
    else:
        shape = to_shape(ground.floor.rooms[room].polygons, ground.origin)
    only = parts.only_part_in(shape)
    if only is not None:
        return OpeningSide(shape, frozenset([only]))
    free = parts.area_by_part(shape)
    enough = min(REACHED_AREA, REACHED_FRACTION * sum(free.values()))
    return OpeningSide(shape, frozenset(part for part, area in free.items() if area >= enough and area > 0))


class Surroundings:
    """Ground with spatial indexes, made when an opening is blocked: what lies near it is found by them."""

    def __init__(self, ground: Ground, settings: Settings) -> None:
        self.ground, self.settings = ground, settings

    @cached_property
    def walls(self) -> Walls:
        """Everything that a robot's centre keeps clear of."""
        return self.ground.walls(self.settings)

    @cached_property
    def outline_rings(self) -> RingIndex:
        return RingIndex(self.ground.outline)

    @cached_property
    def _obstacles(self) -> tuple[list[str], shapely.STRtree]:
        """Names and solids of the obstacles, in the floor's order."""
        names = [item.id for item in self.ground.floor.elements if item.obstacle]
        return names, shapely.STRtree(self.ground.solids)

    def owner(self, segment: FloatArray) -> str:
        """The first obstacle that a wall segment (2, 2) belongs to, in words."""
        middle = shapely.Point(segment.mean(axis=0))
        names, solids = self._obstacles
        near = solids.query(middle, predicate="dwithin", distance=LINE_WALL)
        if len(near):
            return names[int(near.min())]
        lines = shapely.linestrings(self.ground.barriers)
        is_closed = len(lines) and np.any(shapely.distance(lines, middle) <= LINE_WALL)
        return "a closed opening" if is_closed else "the floor's edge"


def _not_reached(crossing: Crossing, parts: Parts, sides: Sequence[OpeningSide], around: Surroundings) -> str:
    """Reason why the robot cannot drive from the opening to both sides; empty if it can."""
    here = parts.touching(crossing.clear)
    if here and all(here & side.main or not side.main for side in sides):
        return ""
    return _limiting_gap(crossing, parts, sides, around)


def _limiting_gap(
    crossing: Crossing, parts: Parts, sides: Sequence[OpeningSide], around: Surroundings
) -> str:
    """Describe the gap near an opening that limits the robot's size most."""
    window = shapely.Point(middle_and_normal(crossing.clear)[0]).buffer(NEAR_OPENING)
    cells = [_cells_of(parts, side, window) for side in sides]
    obstacles = around.ground.obstacle_rings.around(window.bounds)
    free = window.intersection(around.outline_rings.around(window.bounds)).difference(obstacles)
    no_room = f"no room for a robot of radius {around.settings.radius:.3f} m next to it"
    if not _joins(free, crossing, cells):
        return no_room
    walls = around.walls.near(window)
    gaps = gaps_between(walls, short=-2 * float(walls.clearance.max(initial=0.0)) + 0.05, long=-SLACK)
    gaps = sorted(gaps, key=lambda item: -item.width)
    edges = boundary_lines(obstacles.intersection(window))

    def opens(gap: Gap) -> bool:
        """True if a robot that just fits through the gap can drive from the opening to both sides."""
        return _joins(free.difference(widened(edges, gap.width / 2 - SLACK, quad_segs=16)), crossing, cells)

    widest = bisect_left(gaps, True, key=opens)  # a robot can reach every point that a wider robot reaches
    if widest == len(gaps):
        return no_room
    gap = gaps[widest]
    names = " and ".join(dict.fromkeys(around.owner(walls.segments[k]) for k in gap.walls))
    need = float(walls.clearance[list(gap.walls)].sum())
    return f"{gap.width:.3f} m between {names} near it, the robot needs {need:.3f} m"


def _cells_of(parts: Parts, side: OpeningSide, window: BaseGeometry) -> NDArray[np.object_]:
    """Triangles of the drive area on one side near an opening, without pockets that it cannot reach."""
    near = parts.tree.query(side.shape.intersection(window), predicate="intersects")
    return parts.cells[near[np.isin(parts.cell_part[near], sorted(side.main))]]


def _joins(free: BaseGeometry, crossing: Crossing, cells: list[NDArray[np.object_]]) -> bool:
    """True if free floor leads from the opening to the cells on both sides."""
    here = [piece for piece in polygon_parts(free) if piece.intersects(crossing.clear)]
    return all(any(np.any(shapely.intersects(some, piece)) for piece in here) for some in cells if len(some))
