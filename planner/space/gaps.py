"""Tight gaps that the robot just fits through: found between corners and walls, checked by exact distances.

The drive area is drawn with a little more clearance than the robot needs, so it closes such gaps. Each gap
gets a crossing here: a chain of straight lines, checked by exact distances. So no drawn polygon decides
which parts are connected.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray
from stopgo.planner.geometry.shapes import GRID, GROWTH, SLACK, holds

STEPS = 0.02 * 1.4 ** np.arange(15)
"""Distances from a gap's middle, up to about 2 m, at which the drive area is searched."""
LONGEST = 10.0
"""Gaps at most this far apart (m) are tried as the two ends of one narrow corridor."""
CLEAR_SLACK = 2e-6
"""Clearance in metres that is lost when a mission is rounded to micrometres."""


@dataclass(frozen=True, eq=False)
class Walls:
    """Boundary segments (n, 2, 2) with the clearance (n,) that a centre must keep from each."""

    segments: FloatArray
    clearance: FloatArray

    def shapes(self) -> NDArray[np.object_]:
        return shapely.linestrings(self.segments) if len(self.segments) else np.empty(0, dtype=object)

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.shapes())

    def near(self, shape: BaseGeometry) -> Walls:
        """The walls that touch a shape."""
        index = np.sort(self._tree.query(shape, predicate="intersects"))
        return Walls(self.segments[index], self.clearance[index])


@dataclass(frozen=True, eq=False)
class Gap:
    """The narrowest passage between a corner and a wall."""

    middle: FloatArray
    across: FloatArray
    """Unit vector from the corner to the wall."""
    width: float
    walls: tuple[int, int]
    """A segment that begins at the corner, and the wall's segment."""


def keeps_clear(shape: BaseGeometry, walls: Walls, tree: shapely.STRtree) -> bool:
    """True if a point or line keeps every wall's clearance, to within SLACK."""
    if not len(walls.segments):
        return True
    near = tree.query(shape, predicate="dwithin", distance=float(walls.clearance.max()))
    distances = shapely.distance(shape, tree.geometries[near])
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
    fits = np.flatnonzero((spare >= short) & (spare <= long) & (width > GRID))
    gaps = []
    for k in fits:
        across = (foot[k] - corners[corner[k]]) / width[k]
        middle = corners[corner[k]] + (walls.clearance[corner[k]] + spare[k] / 2) * across
        gaps.append(Gap(middle, across, float(width[k]), (int(corner[k]), int(wall[k]))))
    return _distinct(gaps)


def _feet(points: FloatArray, segments: FloatArray) -> FloatArray:
    a, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    t = np.einsum("ij,ij->i", points - a, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    return a + np.clip(t, 0.0, 1.0)[:, None] * along


def _distinct(gaps: list[Gap]) -> list[Gap]:
    """One gap per position and direction, in a canonical order."""
    found: dict[tuple[float, ...], Gap] = {}
    for gap in gaps:
        sign = 1.0 if tuple(gap.across) > (0.0, 0.0) else -1.0
        key = (*np.round(gap.middle, 6).tolist(), *np.round(sign * gap.across, 6).tolist())
        found.setdefault(key, gap)
    return [found[key] for key in sorted(found)]


def crossings_through(
    gaps: list[Gap], walls: Walls, drive_area: BaseGeometry, ground: BaseGeometry
) -> FloatArray:
    """Straight lines (k, 2, 2) through gaps, chained from drive area to drive area.

    Every line keeps every clearance and stays on the ground. A gap with an exit on one side only is one
    end of a narrow corridor. It is joined with every other such end that a straight drive reaches.
    """
    gaps = _unblocked(gaps, walls)
    if not gaps:
        return np.empty((0, 2, 2))
    site = Site(walls, drive_area, ground)
    lines: list[tuple[FloatArray, FloatArray]] = []
    ends: list[FloatArray] = []
    for gap in gaps:
        along = np.array([-gap.across[1], gap.across[0]])
        here, there = (site.exit_from(gap, sign * along) for sign in (1.0, -1.0))
        if (len(here) > 1) != (len(there) > 1):
            ends.append(gap.middle)
        if len(here) > 1 or len(there) > 1:
            lines += pairwise([*here[:0:-1], gap.middle, *there[1:]])
    lines += site.corridors(ends)
    return np.array(lines).reshape(-1, 2, 2)


def _unblocked(gaps: list[Gap], walls: Walls) -> list[Gap]:
    """Gaps whose middle keeps the clearance of every wall; no line leads through the others.

    Only the nearest wall of each clearance is measured, for all gaps at once. With a clearance of many
    metres, hundreds of walls are near every gap, and each trial line would measure them all.
    """
    middles = shapely.points(np.array([gap.middle for gap in gaps]).reshape(-1, 2))
    lines = walls.shapes()
    clear = np.ones(len(gaps), dtype=bool)
    for clearance in np.unique(walls.clearance):
        alike = lines[walls.clearance == clearance]
        nearest = alike[shapely.STRtree(alike).nearest(middles)]
        clear &= shapely.distance(middles, nearest) >= clearance - 2 * SLACK
    return [gap for gap, is_clear in zip(gaps, clear, strict=True) if is_clear]


class Site:
    """Walls, ground and drive area, prepared for collision checks of many straight drives."""

    def __init__(self, walls: Walls, drive_area: BaseGeometry, ground: BaseGeometry) -> None:
        self.walls, self.drive_area = walls, drive_area
        self.ground = ground
        self.slop = 2 * (GROWTH - 1) * float(walls.clearance.max(initial=0.0)) + 8 * GRID
        """The drive area may begin this far (m) from a point that keeps every clearance."""
        self.tree = shapely.STRtree(walls.shapes())
        shapely.prepare(drive_area)
        shapely.prepare(self.ground)

    def allows(self, a: FloatArray, b: FloatArray) -> bool:
        """True if the robot may drive straight from a to b."""
        line = shapely.LineString([a, b])
        return keeps_clear(line, self.walls, self.tree) and holds(self.ground, line, slack=SLACK)

    def exit_from(self, gap: Gap, along: FloatArray) -> list[FloatArray]:
        """Points from the gap's middle to the drive area; only the middle if there is no exit.

        Past the gap the robot may still be at the minimum distance from a wall. The last point then lies
        aside of the straight line, where the drive area begins.
        """
        for step in STEPS:
            end = gap.middle + step * along
            if not self.allows(gap.middle, end):
                break
            for offset in self._offsets(gap):
                if self.drive_area.contains_properly(shapely.Point(end + offset)):
                    if not offset.any():
                        return [gap.middle, end]
                    if self.allows(end, end + offset):
                        return [gap.middle, end, end + offset]
        return [gap.middle]

    def _offsets(self, gap: Gap) -> Iterator[FloatArray]:
        yield np.zeros(2)
        yield -self.slop * gap.across
        yield self.slop * gap.across

    def corridors(self, ends: list[FloatArray]) -> list[tuple[FloatArray, FloatArray]]:
        """Straight lines between the two ends of corridors exactly as wide as the robot."""
        near = [(a, b) for a, b in combinations(ends, 2) if 0 < np.hypot(*(a - b)) <= LONGEST]
        return [(a, b) for a, b in near if self.allows(a, b)]
