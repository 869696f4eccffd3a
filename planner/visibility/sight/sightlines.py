"""Visibility from one position, line by line: every line of sight is tested against every edge.

It shares nothing with the triangular expansion of
`stopgo.planner.visibility.sight.sight`, so that each is a check of the other. The rule for lines through a
vertex is the same: a midpoint is seen if a ray rotated to one side by an arbitrarily small angle reaches it.

Coordinates lie within ±2**29 steps (`to_grid` ensures it).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.document.limits import limits_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import GRID, face_segments, local_origin, to_grid, whole_steps_of
from stopgo.planner.visibility.sight.line_kernel import mark_seen
from stopgo.planner.visibility.sight.well_seen import SeenSegments, well_seen
from stopgo.planner.visibility.solid_rays import solid_rays

FARTHEST = 2**31
"""No two coordinates are farther apart, in grid steps."""
LARGE = 10_000
"""Midpoints from which on a test of all lines takes long without a compiled kernel."""


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


class LineByLine:
    """Midpoints and edges, prepared for tests of the lines from many positions to them."""

    def __init__(self, midpoints: Midpoints, edges: IntArray, *, reach: int | None) -> None:
        """`edges` are (e, 2, 2), and `reach` is the range, all in grid steps."""
        self.midpoints = midpoints
        self._edges, self._reach = edges, FARTHEST if reach is None else min(reach, FARTHEST)
        self._points = shapely.STRtree(shapely.points(midpoints.xy))
        self._lines = shapely.STRtree(shapely.linestrings(edges))
        self._kernel = compiled(mark_seen, large=len(midpoints.odd) > LARGE)
        columns = (midpoints.a.ravel(), midpoints.b.ravel(), midpoints.odd, midpoints.pieces)
        whole = [np.ascontiguousarray(column, dtype=np.int64) for column in (*columns, edges.ravel())]
        face, hidden_by = midpoints.face.astype(np.int8), np.full(len(midpoints.odd), -1, dtype=np.int64)
        self._columns = [self._for_kernel(column) for column in (*whole[:4], face, whole[4])]
        self._hidden_by = self._for_kernel(hidden_by)

    def seen_from(self, position: IntArray, among: BoolArray | None = None) -> IntArray:
        """Midpoints that a position (2,) in grid steps sees within the range, of `among` if given.

        The position lies on no edge.
        """
        chosen = self._near(self._points, position)
        chosen = chosen if among is None else chosen[among[chosen]]
        if not len(chosen):
            return chosen
        rows = (chosen, *self._nearest_first(position), np.zeros(len(chosen), dtype=np.int8))
        these, near, away, seen = map(self._for_kernel, rows)
        kernel: Any = self._kernel or mark_seen
        x, y = position.tolist()
        kernel(x, y, self._reach, these, *self._columns, near, away, self._hidden_by, seen)
        return chosen[np.flatnonzero(seen)]

    def _for_kernel(self, column: NDArray[Any]) -> Any:
        """A list where the kernel is interpreted, since lists index faster there; else the array."""
        return column if self._kernel else column.tolist()

    def _near(self, tree: shapely.STRtree, position: IntArray) -> IntArray:
        """Items within range, and more in the corners of its square, ascending."""
        around = self._reach + 4
        return np.sort(tree.query(shapely.box(*(position - around), *(position + around))))

    def _nearest_first(self, position: IntArray) -> tuple[IntArray, FloatArray]:
        """Edges within range (k,) by distance, and the distances; floating point only sorts them."""
        near = self._near(self._lines, position)
        ends = (self._edges[near] - position).astype(float)
        along = ends[:, 1] - ends[:, 0]
        squared = np.maximum((along**2).sum(axis=1), 1.0)
        foot = np.clip(-(ends[:, 0] * along).sum(axis=1) / squared, 0.0, 1.0)
        away = np.hypot(*(ends[:, 0] + foot[:, None] * along).T)
        order = np.argsort(away, kind="stable")
        return near[order], away[order]


class SightLines:
    """A floor's targets and occluders, prepared for the visibility from many positions."""

    def __init__(self, space: NavigableSpace) -> None:
        self._space = space
        self._origin, targets = local_origin(space.floor), space.targets
        a, b = to_grid(targets.a - self._origin), to_grid(targets.b - self._origin)
        outlines = whole_steps_of(space.occluders, self._origin)
        edges = np.rint(face_segments(outlines)).astype(np.int64)
        midpoints = Midpoints.of(a, b, targets.units, targets.occluding)
        self._lines = LineByLine(midpoints, edges, reach=round(space.settings.range / GRID))
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
