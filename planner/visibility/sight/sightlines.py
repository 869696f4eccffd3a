"""What a place sees, told line by line: every sight line is held against every edge that may block it.

Slow and plain: it shares nothing with the triangular expansion of `stopgo.planner.visibility.sight.sight`,
so that each proves the other. The rule for lines through a vertex is the same: a midpoint is seen if a ray
turned to one side by an arbitrarily small angle reaches it.

Everything is whole grid steps and exact. Coordinates lie within ±2**29 steps, as `to_grid` sees to, and
units are at least 1 mm long, so a midpoint times its `pieces` is below 2**55; products beyond 64 bits
are held as two numbers, high * 2**SPLIT + low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.document.limits import limits_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.shapes import GRID, local_origin, to_grid, whole_steps_of
from stopgo.planner.space.targets import face_segments
from stopgo.planner.visibility.sight.well_seen import SeenSegments, well_seen

SPLIT = 27
LOW = (1 << SPLIT) - 1
PAIRS = 250_000
"""Lines times edges held against each other at a time, the nearest edges first: most lines end there."""
CLOSE = 1e-9
"""Squared distances that differ by less than this share are compared in whole numbers."""


@dataclass(frozen=True, eq=False)
class Midpoints:
    """Midpoints of units: the fraction odd / pieces of the way from a to b."""

    a: IntArray
    """(n, 2)."""
    b: IntArray
    odd: IntArray
    """(n,)."""
    pieces: IntArray
    face: BoolArray
    """True where only what is left of a -> b sees the unit (n,)."""

    @classmethod
    def of(cls, a: IntArray, b: IntArray, units: IntArray, face: BoolArray) -> Midpoints:
        """Those of `units` (m,) equal pieces of every segment, one after the other."""
        segment = np.repeat(np.arange(len(units)), units)
        number = np.arange(len(segment)) - (np.cumsum(units) - units)[segment]
        return cls(a[segment], b[segment], 2 * number + 1, 2 * units[segment], face[segment])

    def among(self, chosen: IntArray) -> Midpoints:
        """Some of them."""
        return Midpoints(
            self.a[chosen], self.b[chosen], self.odd[chosen], self.pieces[chosen], self.face[chosen]
        )


class SightLines:
    """A floor's targets and occluders, prepared for telling what many places see; units by number."""

    def __init__(self, space: NavigableSpace) -> None:
        self._origin, targets = local_origin(space.floor), space.targets
        a, b = to_grid(targets.a - self._origin), to_grid(targets.b - self._origin)
        self._midpoints = Midpoints.of(a, b, targets.units, targets.occluding)
        outlines = whole_steps_of(space.occluders, self._origin)
        self._edges = np.rint(face_segments(outlines)).astype(np.int64)
        self._reach, self._limits = space.settings.range, limits_of(space.settings)
        self._points = shapely.STRtree(shapely.points(targets.unit_xy - self._origin))
        self._lines = shapely.STRtree(shapely.linestrings(self._edges * GRID))

    def seen_from(
        self, xy: FloatArray, among: BoolArray | None = None, *, scanner: FloatArray | None = None
    ) -> IntArray:
        """Units that a place (2,) in the drawing's coordinates sees well enough, of `among` if given.

        `scanner` is where the scanner stands, if it looks past a door's line from beside it.
        """
        place = to_grid(xy - self._origin)
        units, edges = self._near(self._points, place), self._near(self._lines, place)
        units = units if among is None else units[among[units]]
        reach = round(self._reach / GRID)
        units = units[sees(place, self._midpoints.among(units), self._edges[edges], reach=reach)]
        stand = place if scanner is None else to_grid(scanner - self._origin)
        return units if self._limits.none else units[self._well_seen(stand, self._midpoints.among(units))]

    def _well_seen(self, place: IntArray, midpoints: Midpoints) -> BoolArray:
        stretches = SeenSegments(midpoints.a - place, midpoints.b - place, midpoints.pieces // 2)
        return well_seen(stretches, (midpoints.odd - 1) // 2, self._limits)

    def _near(self, tree: shapely.STRtree, place: IntArray) -> IntArray:
        """What may lie within range, and a little more, ascending."""
        found = tree.query(shapely.Point(place * GRID), predicate="dwithin", distance=self._reach + 4 * GRID)
        return np.sort(found)


def sees(place: IntArray, midpoints: Midpoints, edges: IntArray, *, reach: int | None) -> BoolArray:
    """Whether a place (2,) sees each midpoint (n,) past edges (e, 2, 2); the place lies on none of them.

    `reach` is the range in grid steps.
    """
    a, b = midpoints.a - place, midpoints.b - place
    way = (midpoints.pieces - midpoints.odd)[:, None] * a + midpoints.odd[:, None] * b
    seen = ~midpoints.face | (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0)
    if reach is not None:
        seen &= _within(way, midpoints.pieces, reach)
    lines = np.flatnonzero(seen)
    near = _nearest_first(edges - place, way[lines], midpoints.pieces[lines])
    seen[lines] = _open(way[lines], midpoints.pieces[lines], near)
    return seen


def _within(way: IntArray, pieces: IntArray, reach: int) -> BoolArray:
    """Whether way / pieces is at most `reach` long."""
    squared = (way.astype(float) ** 2).sum(axis=1)
    limit = (pieces.astype(float) * reach) ** 2
    inside: BoolArray = squared < limit
    for k in np.flatnonzero(np.abs(squared - limit) <= CLOSE * limit):
        x, y = way[k].tolist()
        inside[k] = x * x + y * y <= (int(pieces[k]) * reach) ** 2
    return inside


def _nearest_first(edges: IntArray, way: IntArray, pieces: IntArray) -> IntArray:
    """Edges as near as the farthest midpoint, by their distance; floating point only sorts and keeps more."""
    ends = edges.astype(float)
    along = ends[:, 1] - ends[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1.0)
    foot = np.clip(-(ends[:, 0] * along).sum(axis=1) / squared, 0.0, 1.0)
    away = np.hypot(*(ends[:, 0] + foot[:, None] * along).T)
    farthest = np.hypot(*(way / pieces[:, None]).T).max(initial=0.0)
    order = np.argsort(away, kind="stable")
    return edges[order[away[order] <= farthest + 2.0]]


def _open(way: IntArray, pieces: IntArray, edges: IntArray) -> BoolArray:
    """Whether no edge blocks each way (n, 2) / pieces, or at least not the ways turned to one side."""
    left, right = np.ones(len(way), dtype=bool), np.ones(len(way), dtype=bool)
    begin = 0
    while begin < len(edges) and len(lines := np.flatnonzero(left | right)):
        end = begin + 1 + PAIRS // len(lines)
        on_left, on_right = _blocked(way[lines], pieces[lines], edges[begin:end])
        left[lines] &= ~on_left
        right[lines] &= ~on_right
        begin = end
    return left | right


def _blocked(way: IntArray, pieces: IntArray, edges: IntArray) -> tuple[BoolArray, BoolArray]:
    """Whether some edge crosses each way, turned a little to the left and a little to the right."""
    (from_high, from_low), (to_high, to_low) = (_side(way, edges[:, k]) for k in range(2))
    start, end = _sign(from_high, from_low), _sign(to_high, to_low)
    left, right = (start > 0) != (end > 0), (start >= 0) != (end >= 0)
    line, edge = np.nonzero(left | right)
    near = edges[edge, 0, 0] * edges[edge, 1, 1] - edges[edge, 0, 1] * edges[edge, 1, 0]
    high = from_high[line, edge] - to_high[line, edge] + pieces[line] * (near >> SPLIT)
    low = from_low[line, edge] - to_low[line, edge] + pieces[line] * (near & LOW)
    across = np.sign(near) * _sign(*_carried(high, low)) < 0
    return _any(left, line[across], edge[across]), _any(right, line[across], edge[across])


def _any(crossed: BoolArray, line: IntArray, edge: IntArray) -> BoolArray:
    """Whether each line has a pair of line and edge at which `crossed` is true."""
    found = np.zeros(len(crossed), dtype=bool)
    found[line[crossed[line, edge]]] = True
    return found


def _side(way: IntArray, points: IntArray) -> tuple[IntArray, IntArray]:
    """The cross product of each way with each point (n, m), as high and low part: above 0 on its left."""
    (x_high, y_high), (x_low, y_low) = (way >> SPLIT).T[:, :, None], (way & LOW).T[:, :, None]
    x, y = points.T[:, None, :]
    return _carried(x_high * y - y_high * x, x_low * y - y_low * x)


def _carried(high: IntArray, low: IntArray) -> tuple[IntArray, IntArray]:
    """The same number with a low part of 0 to LOW."""
    return high + (low >> SPLIT), low & LOW


def _sign(high: IntArray, low: IntArray) -> IntArray:
    return np.where(high != 0, np.sign(high), low > 0)
