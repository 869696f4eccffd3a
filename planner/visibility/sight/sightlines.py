"""Visibility from one position, line by line: every line of sight is tested against every edge.

It shares nothing with the triangular expansion of
`stopgo.planner.visibility.sight.sight`, so that each is a check of the other. The rule for lines through a
vertex is the same: a midpoint is seen if a ray rotated to one side by an arbitrarily small angle reaches it.

Floating point decides where the bound of its error lets it, and whole grid steps where not. Coordinates lie
within ±2**29 steps (`to_grid` ensures it), and units are at least 1 mm long, so a midpoint times its `pieces`
is below 2**55. Products beyond 64 bits are stored as two numbers, high * 2**SPLIT + low.
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
DOUBT = 2.0**-49
"""Error of a cross product in floating point, of the sizes that were multiplied: 16 roundings."""
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

    @property
    def xy(self) -> FloatArray:
        """Their positions in grid steps, rounded (n, 2)."""
        odd, pieces = self.odd[:, None], self.pieces[:, None]
        return np.asarray(((pieces - odd) * self.a + odd * self.b) / pieces)

    def among(self, chosen: IntArray) -> Midpoints:
        """Some of the midpoints."""
        return Midpoints(
            self.a[chosen], self.b[chosen], self.odd[chosen], self.pieces[chosen], self.face[chosen]
        )


class TestedLines:
    """Midpoints and edges, prepared for tests of the lines from many positions to them."""

    def __init__(self, midpoints: Midpoints, edges: IntArray, *, reach: float) -> None:
        """`edges` are (e, 2, 2) in grid steps, and `reach` is the range in metres."""
        self.midpoints = midpoints
        self._edges, self._reach = edges, reach
        self._points = shapely.STRtree(shapely.points(midpoints.xy * GRID))
        self._lines = shapely.STRtree(shapely.linestrings(edges * GRID))
        self._hidden_by = np.full(len(midpoints.odd), -1)
        """An edge that hid each midpoint from an earlier position, -1 if none is known (n,)."""

    def seen_from(self, position: IntArray, among: BoolArray | None = None) -> IntArray:
        """Midpoints that a position (2,) in grid steps sees within the range, of `among` if given."""
        chosen = self._near(self._points, position)
        chosen = chosen if among is None else chosen[among[chosen]]
        if not len(chosen):
            return chosen
        edges = self._near(self._lines, position)
        first, reach = _places(self._hidden_by[chosen], edges), round(self._reach / GRID)
        seen, by = sees_past(position, self.midpoints.among(chosen), self._edges[edges], first, reach=reach)
        self._hidden_by[chosen[by >= 0]] = edges[by[by >= 0]]
        return chosen[seen]

    def _near(self, tree: shapely.STRtree, position: IntArray) -> IntArray:
        """Items within range, and more in the corners of its square, ascending."""
        around = self._reach + 4 * GRID
        return np.sort(tree.query(shapely.box(*(position * GRID - around), *(position * GRID + around))))


def _places(items: IntArray, among: IntArray) -> IntArray:
    """Place of each item (n,) among others (ascending), -1 where it is not one of them."""
    if not len(among):
        return np.full(len(items), -1)
    place = np.minimum(np.searchsorted(among, items), len(among) - 1)
    return np.where(among[place] == items, place, -1)


class SightLines:
    """A floor's targets and occluders, prepared for the visibility from many positions."""

    def __init__(self, space: NavigableSpace) -> None:
        self._space = space
        self._origin, targets = local_origin(space.floor), space.targets
        a, b = to_grid(targets.a - self._origin), to_grid(targets.b - self._origin)
        outlines = whole_steps_of(space.occluders, self._origin)
        edges = np.rint(face_segments(outlines)).astype(np.int64)
        midpoints = Midpoints.of(a, b, targets.units, targets.occluding)
        self._lines = TestedLines(midpoints, edges, reach=space.settings.range)
        self._limits = limits_of(space.settings)

    def seen_from(
        self, xy: FloatArray, among: BoolArray | None = None, *, scanner: FloatArray | None = None
    ) -> IntArray:
        """Units that a position (2,) in drawing coordinates sees within the limits, of `among` if given.

        `scanner` is the scanner's own position, if `xy` is a viewpoint next to a door's line.
        """
        position = to_grid(xy - self._origin)
        units = self._lines.seen_from(position, among)
        origin = position if scanner is None else to_grid(scanner - self._origin)
        if not self._limits.none:
            units = units[self._well_seen(origin, self._lines.midpoints.among(units))]
        rays = solid_rays(self._space)
        if rays is None or not len(units):
            return units
        above = xy if scanner is None else scanner
        return units[rays.clear(np.broadcast_to(above, (len(units), 2)), units)]

    def _well_seen(self, position: IntArray, midpoints: Midpoints) -> BoolArray:
        stretches = SeenSegments(midpoints.a - position, midpoints.b - position, midpoints.pieces // 2)
        return well_seen(stretches, (midpoints.odd - 1) // 2, self._limits)


def sees(position: IntArray, midpoints: Midpoints, edges: IntArray, *, reach: int | None) -> BoolArray:
    """True for each midpoint (n,) that a position (2,) sees past edges (e, 2, 2); it lies on none of them.

    `reach` is the range in grid steps.
    """
    none = np.full(len(midpoints.odd), -1)
    return sees_past(position, midpoints, edges, none, reach=reach)[0]


def sees_past(
    position: IntArray, midpoints: Midpoints, edges: IntArray, first: IntArray, *, reach: int | None
) -> tuple[BoolArray, IntArray]:
    """The same, and for each midpoint the number of an edge that hides it, -1 if none is known (n,).

    `first` has edges that may hide them, which are tested first: what hides a unit often hides it from the
    next position, too.
    """
    a, b = midpoints.a - position, midpoints.b - position
    offset = (midpoints.pieces - midpoints.odd)[:, None] * a + midpoints.odd[:, None] * b
    seen, by = ~midpoints.face | (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0), np.full(len(a), -1)
    if reach is not None:
        lines = np.flatnonzero(seen)
        seen[lines] = _within(offset[lines], midpoints.pieces[lines], reach)
    known = np.flatnonzero(seen & (first >= 0))
    hidden = known[_surely_crosses(offset[known], midpoints.pieces[known], edges[first[known]] - position)]
    seen[hidden], by[hidden] = False, first[hidden]
    lines = np.flatnonzero(seen)
    near = _nearest_first(edges - position, offset[lines], midpoints.pieces[lines])
    seen[lines], found = _open(offset[lines], midpoints.pieces[lines], edges[near] - position)
    by[lines[found >= 0]] = near[found[found >= 0]]
    return seen, by


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
    """Edges as near as the farthest midpoint (k,), by distance; floating point only sorts and keeps more."""
    ends = edges.astype(float)
    along = ends[:, 1] - ends[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1.0)
    foot = np.clip(-(ends[:, 0] * along).sum(axis=1) / squared, 0.0, 1.0)
    away = np.hypot(*(ends[:, 0] + foot[:, None] * along).T)
    farthest = np.hypot(*(offset / pieces[:, None]).T).max(initial=0.0)
    order = np.argsort(away, kind="stable")
    return order[away[order] <= farthest + 2.0]


def _open(offset: IntArray, pieces: IntArray, edges: IntArray) -> tuple[BoolArray, IntArray]:
    """True where no edge blocks `offset` / pieces (n, 2), or that line rotated slightly to one side.

    With it comes the number of an edge that blocks both, -1 if none does (n,).
    """
    blocked, by = np.zeros((2, len(offset)), dtype=bool), np.full(len(offset), -1)
    begin = 0
    while begin < len(edges) and len(lines := np.flatnonzero(~blocked.all(axis=0))):
        end = begin + 1 + PAIRS // len(lines)
        line, edge = _touching(offset[lines], edges[begin:end])
        line, edge = lines[line], begin + edge
        crossed = _crossed(offset[line], pieces[line], edges[edge])
        both = crossed.all(axis=0)
        by[line[both]] = edge[both]
        for side in range(2):
            blocked[side, line[crossed[side]]] = True
        begin = end
    return np.asarray(~blocked.all(axis=0)), by


def _touching(offset: IntArray, edges: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of line and edge of which not both ends of the edge are on one side of the line for certain.

    The cross products are in floating point. None is larger than `most`, and two of one sign whose product
    is above `most` times their doubt are both above it.
    """
    lines, ends = offset.astype(float), edges.astype(float)
    most = np.abs(lines).sum(axis=1, keepdims=True) * np.abs(ends).max(initial=0.0)
    turned = np.stack([ends[..., 1], -ends[..., 0]])
    both = (lines @ turned[..., 0]) * (lines @ turned[..., 1])
    line, edge = np.divmod(np.flatnonzero(both <= DOUBT * most**2), len(edges))
    return line, edge


def _crossed(offset: IntArray, pieces: IntArray, edges: IntArray) -> BoolArray:
    """True where an edge (n, 2, 2) crosses its line, rotated a little to the left and to the right (2, n)."""
    yes, no = _certain(offset, pieces, edges)
    crossed = np.stack([yes, yes])
    doubtful = np.flatnonzero(~yes & ~no)
    crossed[:, doubtful] = _crosses(offset[doubtful], pieces[doubtful], edges[doubtful])
    return crossed


def _surely_crosses(offset: IntArray, pieces: IntArray, edges: IntArray) -> BoolArray:
    """True where an edge (n, 2, 2) crosses its line for certain in floating point (n,)."""
    return _certain(offset, pieces, edges)[0]


def _certain(offset: IntArray, pieces: IntArray, edges: IntArray) -> tuple[BoolArray, BoolArray]:
    """True where an edge crosses its line for certain in floating point, and where it does not (n,)."""
    (x, y), (from_x, from_y, to_x, to_y) = offset.T.astype(float), edges.reshape(-1, 4).T.astype(float)
    start, end, near = x * from_y - y * from_x, x * to_y - y * to_x, from_x * to_y - from_y * to_x
    beyond = start - end + pieces * near
    size = np.abs([from_x, from_y, to_x, to_y]).max(axis=0)
    side_doubt, near_doubt = DOUBT * (np.abs(x) + np.abs(y)) * size, DOUBT * size**2
    is_sure = (np.abs(near) > near_doubt) & (np.abs(beyond) > 2.0 * side_doubt + pieces * near_doubt)
    apart = (np.minimum(start, end) < -side_doubt) & (np.maximum(start, end) > side_doubt)
    across = (near > 0) != (beyond > 0)
    return is_sure & across & apart, is_sure & ~across


def _crosses(offset: IntArray, pieces: IntArray, edges: IntArray) -> BoolArray:
    """The same as `_crossed` in whole numbers alone."""
    (from_high, from_low), (to_high, to_low) = (_side(offset, edges[:, k]) for k in range(2))
    start, end = _sign(from_high, from_low), _sign(to_high, to_low)
    sides = np.stack([(start > 0) != (end > 0), (start >= 0) != (end >= 0)])
    near = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    high = from_high - to_high + pieces * (near >> SPLIT)
    low = from_low - to_low + pieces * (near & LOW)
    return np.asarray(sides & (np.sign(near) * _sign(*_carried(high, low)) < 0))


def _side(offset: IntArray, points: IntArray) -> tuple[IntArray, IntArray]:
    """Cross product of each line with a point (n,), as high and low part: above 0 on its left."""
    (x_high, y_high), (x_low, y_low) = (offset >> SPLIT).T, (offset & LOW).T
    x, y = points.T
    return _carried(x_high * y - y_high * x, x_low * y - y_low * x)


def _carried(high: IntArray, low: IntArray) -> tuple[IntArray, IntArray]:
    """The same number with a low part of 0 to LOW."""
    return high + (low >> SPLIT), low & LOW


def _sign(high: IntArray, low: IntArray) -> IntArray:
    return np.where(high != 0, np.sign(high), low > 0)
