"""Openings exactly as wide as the robot: found between corners and walls, decided by distance.

The drive area is drawn with a little more clearance than the robot needs, so it closes gaps that the
robot just fits through. Each such gap gets a straight crossing here, checked by exact distances, and
so no drawn polygon decides what is connected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from mission.geometry import FloatArray
from planner.shapes import GRID, GROWTH, SLACK

STEPS = 0.02 * 1.4 ** np.arange(15)
"""Distances from a gap's middle, up to about 2 m, at which the drive area is looked for."""


@dataclass(frozen=True, eq=False)
class Walls:
    """Boundary segments (n, 2, 2) with the clearance (n,) that a centre must keep from each."""

    segments: FloatArray
    clearance: FloatArray

    def shapes(self) -> NDArray[np.object_]:
        return shapely.linestrings(self.segments) if len(self.segments) else np.empty(0, dtype=object)


@dataclass(frozen=True, eq=False)
class Gap:
    """The narrowest place between a corner and a wall."""

    middle: FloatArray
    across: FloatArray
    """Unit vector from the corner to the wall."""
    width: float
    walls: tuple[int, int]
    """A segment that ends at the corner, and the wall's segment."""


def keeps_clear(shape: BaseGeometry, walls: Walls, tree: shapely.STRtree) -> bool:
    """Whether a point or line keeps every wall's clearance, to within SLACK."""
    if not len(walls.segments):
        return True
    near = tree.query(shape.buffer(float(walls.clearance.max())))
    distances = shapely.distance(shape, shapely.linestrings(walls.segments[near]))
    return bool(np.all(distances >= walls.clearance[near] - SLACK))


def tight_gaps(walls: Walls) -> list[Gap]:
    """Gaps that the clearances just allow, to within what the drive area's drawing adds."""
    slop = 2 * (GROWTH - 1) * float(walls.clearance.max(initial=0.0)) + 8 * GRID
    return gaps_between(walls, short=-2 * SLACK, long=slop)


def gaps_between(walls: Walls, *, short: float, long: float) -> list[Gap]:
    """Gaps whose width exceeds the clearances of their sides by `short` to `long` metres."""
    if not len(walls.segments):
        return []
    corners = walls.segments[:, 0]
    widest = 2 * float(walls.clearance.max()) + long
    tree = shapely.STRtree(walls.shapes())
    corner, wall = tree.query(shapely.points(corners), predicate="dwithin", distance=widest)
    foot = _feet(corners[corner], walls.segments[wall])
    width = np.hypot(*(foot - corners[corner]).T)
    spare = width - walls.clearance[corner] - walls.clearance[wall]
    fits = (spare >= short) & (spare <= long) & (width > GRID)
    gaps = [
        _gap(corners[c], f, w, s, walls, (int(c), int(k)))
        for c, k, f, w, s in zip(corner[fits], wall[fits], foot[fits], width[fits], spare[fits], strict=True)
    ]
    return _distinct(gaps)


def _feet(points: FloatArray, segments: FloatArray) -> FloatArray:
    a, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    t = np.einsum("ij,ij->i", points - a, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    return a + np.clip(t, 0.0, 1.0)[:, None] * along


def _gap(
    corner: FloatArray, foot: FloatArray, width: float, spare: float, walls: Walls, pair: tuple[int, int]
) -> Gap:
    across = (foot - corner) / width
    middle = corner + (walls.clearance[pair[0]] + spare / 2) * across
    return Gap(middle, across, float(width), pair)


def _distinct(gaps: list[Gap]) -> list[Gap]:
    """One gap per place and direction, in a canonical order."""
    found: dict[tuple[float, ...], Gap] = {}
    for gap in gaps:
        sign = 1.0 if tuple(gap.across) > (0.0, 0.0) else -1.0
        key = (*np.round(gap.middle, 6).tolist(), *np.round(sign * gap.across, 6).tolist())
        found.setdefault(key, gap)
    return [found[key] for key in sorted(found)]


def crossings_through(
    gaps: list[Gap], walls: Walls, drive_area: BaseGeometry, ground: BaseGeometry
) -> FloatArray:
    """Straight ways (k, 2, 2) through gaps, from drive area to drive area.

    A gap counts only if the whole way keeps every clearance and stays on the ground.
    """
    if not gaps:
        return np.empty((0, 2, 2))
    tree = shapely.STRtree(walls.shapes())
    shapely.prepare(drive_area)
    shapely.prepare(ground)
    ways = []
    for gap in gaps:
        along = np.array([-gap.across[1], gap.across[0]])
        here = _way_out(gap.middle, along, walls, tree, drive_area)
        there = _way_out(gap.middle, -along, walls, tree, drive_area)
        if here is not None and there is not None and ground.covers(shapely.LineString([here, there])):
            ways.append(np.stack([here, there]))
    return np.array(ways).reshape(-1, 2, 2)


def _way_out(
    middle: FloatArray, along: FloatArray, walls: Walls, tree: shapely.STRtree, drive_area: BaseGeometry
) -> FloatArray | None:
    for step in STEPS:
        end = middle + step * along
        if drive_area.contains_properly(shapely.Point(end)):
            return end if keeps_clear(shapely.LineString([middle, end]), walls, tree) else None
    return None
