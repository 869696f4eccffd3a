"""Passages between rooms without a door, through which a robot fits from one room into the next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.areas import Space
from stopgo.planner.floors.ifc.doors import Door
from stopgo.planner.floors.ifc.solids import Solid
from stopgo.planner.floors.rings import Region

DEEPEST = 0.8
"""The thickest wall that a passage leads through, metres."""
NARROWEST = 0.5
"""A narrower passage is none for a robot, metres."""
STEP = 0.1
"""A border is looked at in pieces of this length, metres."""
REACH = 0.3
"""So far on both sides of a passage the floor is free, metres."""
TOUCH = 0.02
"""Rooms nearer than this share a border, metres."""
STANDING = ("walls", "columns", "windows", "railings", "stairs", "objects", "other")


def passages(
    floor: Region, rooms: Sequence[Space], solids: Sequence[Solid], doors: Sequence[Door]
) -> list[FloatArray]:
    """Lines (2, 2) across every passage, from side to side."""
    standing = shapely.union_all(
        [item.region for item in solids if item.kind in STANDING and item.product.role != "furniture"]
    )
    shut = shapely.union_all([standing, *(door.threshold.buffer(0.05) for door in doors)])
    free = floor.difference(shut)
    shapely.prepare(free)
    nearly_free = free.buffer(TOUCH)
    lines: list[FloatArray] = []
    for one, other in _neighbours([_Grown(room.region) for room in rooms]):
        lines += _borders(one, other, free, nearly_free)
        lines += _openings(one, other, free)
    return lines


@dataclass(frozen=True, eq=False)
class _Grown:
    """A room's area, and the same with a margin; each margin is made once for all neighbours."""

    region: Region

    @cached_property
    def squarely(self) -> Region:
        """With the margin within which rooms touch, and square corners."""
        return self.region.buffer(TOUCH, join_style="mitre")

    @cached_property
    def roundly(self) -> Region:
        """With the margin within which rooms touch, and round corners."""
        return self.region.buffer(TOUCH)

    @cached_property
    def deep(self) -> Region:
        """With the thickest wall around it."""
        return self.region.buffer(DEEPEST)


def _neighbours(rooms: Sequence[_Grown]) -> Iterator[tuple[_Grown, _Grown]]:
    if len(rooms) < 2:
        return
    tree = shapely.STRtree([room.region for room in rooms])
    pairs = tree.query([room.region for room in rooms], predicate="dwithin", distance=DEEPEST)
    yield from ((rooms[a], rooms[b]) for a, b in sorted(zip(*pairs.tolist(), strict=True)) if a < b)


def _borders(one: _Grown, other: _Grown, free: Region, nearly_free: Region) -> Iterator[FloatArray]:
    """Straight pieces of a border that two rooms share, where nothing stands on it."""
    shared = one.region.boundary.intersection(other.squarely)
    for line in shapely.get_parts(shapely.line_merge(_lines_of(shared))):
        for a, b in _straight(shapely.get_coordinates(line)):
            crossing = shapely.LineString([a, b]).intersection(nearly_free)
            for piece in shapely.get_parts(_lines_of(crossing)):
                yield from _leading_on(shapely.get_coordinates(piece)[[0, -1]], free)


def _leading_on(line: FloatArray, free: Region) -> Iterator[FloatArray]:
    """The stretches of a line that have room for a robot on both sides."""
    along = line[1] - line[0]
    length = float(np.hypot(*along))
    if length < NARROWEST:
        return
    across = np.array([-along[1], along[0]]) / length * REACH
    t = np.linspace(0, 1, max(2, int(np.ceil(length / STEP)) + 1))
    middles = line[0] + (t[1:, None] + t[:-1, None]) / 2 * along
    crossings = shapely.linestrings(np.stack([middles - across, middles + across], axis=1))
    leads = np.concatenate([[False], shapely.covers(free, crossings), [False]])
    changes = np.flatnonzero(leads[1:] != leads[:-1])
    for first, last in zip(changes[::2], changes[1::2], strict=True):
        if (t[last] - t[first]) * length >= NARROWEST:
            yield _on_grid(line[0] + t[[first, last], None] * along)


def _lines_of(region: Region) -> Region:
    parts = shapely.get_parts(region)
    lines = [part for part in parts if part.geom_type == "LineString" and not part.is_empty]
    return shapely.MultiLineString(lines)


def _straight(points: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """The straight runs of a polyline: joints of collinear pieces are none."""
    thin = shapely.get_coordinates(shapely.LineString(points).simplify(0.01)) if len(points) > 2 else points
    yield from pairwise(thin)


def _openings(one: _Grown, other: _Grown, free: Region) -> Iterator[FloatArray]:
    """The middle lines of openings without a door in a wall between two rooms."""
    if one.region.distance(other.region) <= TOUCH:
        return
    between = one.deep.intersection(other.deep).intersection(free)
    between = between.difference(one.region).difference(other.region)
    for part in shapely.get_parts(between):
        sides = [_side(part, room) for room in (one, other)]
        if all(side is not None for side in sides):
            yield from _middle(*sides)  # type: ignore[arg-type]


def _side(part: Region, room: _Grown) -> FloatArray | None:
    """Side of an opening at a room: the ends (2, 2) of the longest line they share."""
    shared = shapely.line_merge(_lines_of(part.boundary.intersection(room.roundly)))
    lines = [line for line in shapely.get_parts(shared) if line.length >= NARROWEST]
    if not lines:
        return None
    return shapely.get_coordinates(max(lines, key=lambda line: line.length))[[0, -1]]


def _middle(one: FloatArray, other: FloatArray) -> Iterator[FloatArray]:
    same, crossed = np.hypot(*(one - other).T).sum(), np.hypot(*(one - other[::-1]).T).sum()
    line = (one + (other if same <= crossed else other[::-1])) / 2
    if np.hypot(*(line[1] - line[0])) >= NARROWEST:
        yield _on_grid(line)


def _on_grid(line: FloatArray) -> FloatArray:
    return np.round(line / 1e-4) * 1e-4
