"""Visibility from one position, line by line: every line of sight is tested against every edge.

It is slow and simple. It shares nothing with the triangular expansion of
`stopgo.planner.visibility.sight.sight`, so that each is a check of the other. The rule for lines through a
vertex is the same: a midpoint is seen if a ray rotated to one side by an arbitrarily small angle reaches it.

All numbers are whole grid steps and exact. Coordinates lie within ±2**29 steps (`to_grid` ensures it), and
units are at least 1 mm long, so a midpoint times its `pieces` is below 2**55. Products beyond 64 bits are
stored as two numbers, high * 2**SPLIT + low.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.document.limits import limits_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.shapes import GRID, face_segments, local_origin, to_grid, whole_steps_of
from stopgo.planner.visibility.sight.well_seen import SeenSegments, well_seen
from stopgo.planner.visibility.solid_rays import solid_rays

SPLIT = 27
LOW = (1 << SPLIT) - 1
PAIRS = 50_000
"""Lines times edges tested at a time, the nearest edges first, because they block most lines."""
CLOSE = 1e-9
"""Relative difference of squared distances below which they are compared in whole numbers."""


@dataclass(frozen=True, eq=False)
class Midpoints:
    """Midpoints of units: at the fraction odd / pieces of the line from a to b."""

    a: IntArray
    """(n, 2)."""
    b: IntArray
    odd: IntArray
    """(n,)."""
    pieces: IntArray
    face: BoolArray
    """True for units that are visible only from the left of a -> b (n,)."""

    @classmethod
    def of(cls, a: IntArray, b: IntArray, units: IntArray, face: BoolArray) -> Midpoints:
        """Those of `units` (m,) equal pieces of every segment, one after the other."""
        segment = np.repeat(np.arange(len(units)), units)
        number = np.arange(len(segment)) - (np.cumsum(units) - units)[segment]
        return cls(a[segment], b[segment], 2 * number + 1, 2 * units[segment], face[segment])

    def among(self, chosen: IntArray) -> Midpoints:
        """Some of the midpoints."""
        return Midpoints(
            self.a[chosen], self.b[chosen], self.odd[chosen], self.pieces[chosen], self.face[chosen]
        )


class SightLines:
    """A floor's targets and occluders, prepared for the visibility from many positions."""

    def __init__(self, space: NavigableSpace) -> None:
        self._space = space
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
        """Units that a position (2,) in drawing coordinates sees within the limits, of `among` if given.

        `scanner` is the scanner's own position, if `xy` is a viewpoint next to a door's line.
        """
        position = to_grid(xy - self._origin)
        units, edges = self._near(self._points, position), self._near(self._lines, position)
        units = units if among is None else units[among[units]]
        reach = round(self._reach / GRID)
        units = units[sees(position, self._midpoints.among(units), self._edges[edges], reach=reach)]
        origin = position if scanner is None else to_grid(scanner - self._origin)
        if not self._limits.none:
            units = units[self._well_seen(origin, self._midpoints.among(units))]
        rays = solid_rays(self._space)
        if rays is None or not len(units):
            return units
        above = xy if scanner is None else scanner
        return units[rays.clear(np.broadcast_to(above, (len(units), 2)), units)]

    def _well_seen(self, position: IntArray, midpoints: Midpoints) -> BoolArray:
        stretches = SeenSegments(midpoints.a - position, midpoints.b - position, midpoints.pieces // 2)
        return well_seen(stretches, (midpoints.odd - 1) // 2, self._limits)

    def _near(self, tree: shapely.STRtree, position: IntArray) -> IntArray:
        """Candidates for items within range, and slightly more, ascending."""
        found = tree.query(
            shapely.Point(position * GRID), predicate="dwithin", distance=self._reach + 4 * GRID
        )
        return np.sort(found)


def sees(position: IntArray, midpoints: Midpoints, edges: IntArray, *, reach: int | None) -> BoolArray:
    """True for each midpoint (n,) that a position (2,) sees past edges (e, 2, 2); it lies on none of them.

    `reach` is the range in grid steps.
    """
    a, b = midpoints.a - position, midpoints.b - position
    offset = (midpoints.pieces - midpoints.odd)[:, None] * a + midpoints.odd[:, None] * b
    seen = ~midpoints.face | (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0)
    if reach is not None:
        seen &= _within(offset, midpoints.pieces, reach)
    lines = np.flatnonzero(seen)
    near = _nearest_first(edges - position, offset[lines], midpoints.pieces[lines])
    seen[lines] = _open(offset[lines], midpoints.pieces[lines], near)
    return seen


def _within(offset: IntArray, pieces: IntArray, reach: int) -> BoolArray:
    """True where offset / pieces is at most `reach` long."""
    squared = (offset.astype(float) ** 2).sum(axis=1)
    limit = (pieces.astype(float) * reach) ** 2
    inside: BoolArray = squared < limit
    for k in np.flatnonzero(np.abs(squared - limit) <= CLOSE * limit):
        x, y = offset[k].tolist()
        inside[k] = x * x + y * y <= (int(pieces[k]) * reach) ** 2
    return inside


def _nearest_first(edges: IntArray, offset: IntArray, pieces: IntArray) -> IntArray:
    """Edges as near as the farthest midpoint, by their distance; floating point only sorts and keeps more."""
    ends = edges.astype(float)
    along = ends[:, 1] - ends[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1.0)
    foot = np.clip(-(ends[:, 0] * along).sum(axis=1) / squared, 0.0, 1.0)
    away = np.hypot(*(ends[:, 0] + foot[:, None] * along).T)
    farthest = np.hypot(*(offset / pieces[:, None]).T).max(initial=0.0)
    order = np.argsort(away, kind="stable")
    return edges[order[away[order] <= farthest + 2.0]]


def _open(offset: IntArray, pieces: IntArray, edges: IntArray) -> BoolArray:
    """True where no edge blocks `offset` / pieces (n, 2), or that line rotated slightly to one side."""
    left, right = np.ones(len(offset), dtype=bool), np.ones(len(offset), dtype=bool)
    begin = 0
    while begin < len(edges) and len(lines := np.flatnonzero(left | right)):
        end = begin + 1 + PAIRS // len(lines)
        on_left, on_right = _blocked(offset[lines], pieces[lines], edges[begin:end])
        left[lines] &= ~on_left
        right[lines] &= ~on_right
        begin = end
    return left | right


def _blocked(offset: IntArray, pieces: IntArray, edges: IntArray) -> tuple[BoolArray, BoolArray]:
    """True where some edge crosses the line, rotated slightly to the left and slightly to the right."""
    (from_high, from_low), (to_high, to_low) = (_side(offset, edges[:, k]) for k in range(2))
    start, end = _sign(from_high, from_low), _sign(to_high, to_low)
    left, right = (start > 0) != (end > 0), (start >= 0) != (end >= 0)
    line, edge = np.nonzero(left | right)
    near = edges[edge, 0, 0] * edges[edge, 1, 1] - edges[edge, 0, 1] * edges[edge, 1, 0]
    high = from_high[line, edge] - to_high[line, edge] + pieces[line] * (near >> SPLIT)
    low = from_low[line, edge] - to_low[line, edge] + pieces[line] * (near & LOW)
    across = np.sign(near) * _sign(*_carried(high, low)) < 0
    return _any(left, line[across], edge[across]), _any(right, line[across], edge[across])


def _any(crossed: BoolArray, line: IntArray, edge: IntArray) -> BoolArray:
    """True for each line with a pair of line and edge at which `crossed` is true."""
    found = np.zeros(len(crossed), dtype=bool)
    found[line[crossed[line, edge]]] = True
    return found


def _side(offset: IntArray, points: IntArray) -> tuple[IntArray, IntArray]:
    """Cross product of each line with each point (n, m), as high and low part: above 0 on its left."""
    (x_high, y_high), (x_low, y_low) = (offset >> SPLIT).T[:, :, None], (offset & LOW).T[:, :, None]
    x, y = points.T[:, None, :]
    return _carried(x_high * y - y_high * x, x_low * y - y_low * x)


def _carried(high: IntArray, low: IntArray) -> tuple[IntArray, IntArray]:
    """The same number with a low part of 0 to LOW."""
    return high + (low >> SPLIT), low & LOW


def _sign(high: IntArray, low: IntArray) -> IntArray:
    return np.where(high != 0, np.sign(high), low > 0)
