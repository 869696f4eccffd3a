"""Rays past a floor's solids: which heights of a target a scanner sees, at its own height above the floor.

A level ray at the scanner's height meets what is at that height alone. What stands below it
or hangs above it hides a part of a target: furniture, lintels, ceilings, beams. Here the solids' surfaces
are marked in columns of a grid; each column is a pattern of bits by height. A ray from the scanner to each
height of a target is followed over the grid. Columns within what the plan knows as solid are left out: there
the plan's own exact visibility has decided.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document.limits import scanner_height
from stopgo.mission.floor import Element
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace, Visibility
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.visibility.covered_faces import covered_faces
from stopgo.planner.visibility.unit_ranges import visibility_of

COLUMN_M = 0.05
"""Side of a column; doubled for floors with more than MOST_COLUMNS."""
MOST_COLUMNS = 20_000_000
LEVELS = 64
"""Heights of a column: the bits of its pattern."""
SAMPLE_M = 0.02
"""Distance of the points by which a surface is marked."""
MOST_SAMPLES = 2_000_000
"""Points marked at a time."""
STEP_M = 0.04
"""Steps along a ray."""
SORTED_OUT = 8
"""Steps after which rays that reach no height any more are left out."""
AT_TARGET_M = 0.08
"""Columns this near to a target's line are the target's own."""
GRAZING = 0.05
"""Sine of the flattest ray on a target that is told from a flatter one."""
CELL_M = 0.1
"""Height of the cells in which a target's area is counted."""
ON_FACE_M = 0.02
"""A face this near to a unit is the unit's own."""
AT_EDGE_M = 0.001
"""A point this near to a face's edge is on the face."""
PARALLEL = 0.3
"""Sine of the largest angle between a unit and a face of its own."""
SOLID_M = 0.04
"""Columns within this of the plan's solids are theirs."""
MOST_PAIRS = 200_000
"""Rays to one height that are followed at a time."""
ASIDE_M = 0.005
"""Distance from a face at which its solid is looked for."""
PLACES = 3
"""Decimals in metres of a scanner's position, so that a mission's stop and its candidate are one position."""


class SolidRays:
    """A floor's solids, prepared for rays from many positions."""

    def __init__(self, space: NavigableSpace, solids: ModelSolids) -> None:
        self._columns = _MarkedColumns(solids, space)
        self._height = scanner_height(space.settings)
        self._targets = space.targets
        self.cells = UnitCells.of(space, solids)
        self._along = _along(space)
        self._outward = _outward(space, self._along)
        self._covered = self.cells.there & covered_faces(
            space.targets,
            solids.triangles[~_is_upright(solids.triangles)],
            self._outward,
            self.cells.z,
            before_m=(ASIDE_M, AT_TARGET_M / 2, AT_TARGET_M),
        )

    def reached(self, xy: FloatArray, units: IntArray) -> BoolArray:
        """True for the heights (n, k) of units (n,) that rays from above `xy`, (2,) or (n, 2), reach."""
        open_ = self.cells.there[units] & ~self._covered[units]
        return self._followed(xy, units, self.cells.z[units]) & open_

    def clear(self, xy: FloatArray, units: IntArray) -> BoolArray:
        """True for units (n,) of which rays from scanners above `xy` (n, 2) reach any height."""
        low, high = self.cells.low[units], self.cells.high[units]
        nearest = np.clip(self._height, low + CELL_M / 2, np.maximum(high - CELL_M / 2, low + CELL_M / 2))
        found = np.ones(len(units), dtype=bool)
        for part in _parts(len(units), MOST_PAIRS):
            found[part] = self._followed(xy[part], units[part], nearest[part, None])[:, 0]
        found &= ~self._covered[units].any(axis=1)
        rest = np.flatnonzero(~found)
        for part in _parts(len(rest), MOST_PAIRS // max(1, self.cells.z.shape[1])):
            found[rest[part]] = self.reached(xy[rest[part]], units[rest[part]]).any(axis=1)
        return found

    def _followed(self, xy: FloatArray, units: IntArray, z: FloatArray) -> BoolArray:
        start = np.broadcast_to(np.round(xy, PLACES), (len(units), 2))
        ends, outward = self._targets.unit_xy[units], self._outward[units]
        before = np.einsum("nd,nd->n", start - ends, outward) > 0
        two_sided = ~outward.any(axis=1)
        clear = self._columns.reached(start, ends, self._along[units], z, self._height)
        return clear & (before | two_sided)[:, None]


def _along(space: NavigableSpace) -> FloatArray:
    """Directions of the units' lines (n, 2)."""
    along = (space.targets.b - space.targets.a)[space.targets.unit_segment]
    found: FloatArray = along / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    return found


def _outward(space: NavigableSpace, along: FloatArray) -> FloatArray:
    """Directions (n, 2) that the faces of units look to, if they are one side of a solid; else 0, 0.

    The plan itself knows the sides of what occludes; this is for beams and what is lower than the scanner.
    """
    targets = space.targets
    left = np.column_stack([-along[:, 1], along[:, 0]])
    element = targets.element[targets.unit_segment]
    found = np.zeros_like(left)
    for index in np.unique(element[~targets.occluding[targets.unit_segment]]).tolist():
        solids = space.floor.elements[index].solids
        own = np.flatnonzero(element == index)
        if solids:
            shape = shapely.union_all([shapely.Polygon(part.exterior, part.holes) for part in solids])
            inside = [
                shapely.contains_xy(shape, *(targets.unit_xy[own] + side * ASIDE_M * left[own]).T)
                for side in (1.0, -1.0)
            ]
            found[own] = (inside[1].astype(float) - inside[0])[:, None] * left[own]
    return found


@instance_cached
def solid_rays(space: NavigableSpace) -> SolidRays | None:
    """Return the rays past the solids of a space's floor; None if its solids are not known."""
    solids = space.floor.solids
    return None if solids is None else SolidRays(space, solids)


def clear_of_solids(visible: Visibility) -> Visibility:
    """Return the visibility without targets that no ray reaches at any height, and with their length."""
    rays = solid_rays(visible.space)
    if rays is None:
        return visible
    row, _, first, last = visible.runs_apart
    counts = last - first + 1
    units, row = ranges(first, counts), np.repeat(row, counts)
    candidates = visible.candidates
    clear = rays.clear(candidates.xy[candidates.kept][row], units)
    if clear.all():
        return visible
    ends = np.searchsorted(row[clear], np.arange(visible.rows + 1))
    seen = np.split(units[clear], ends[1:-1])
    found = visibility_of(candidates, seen, method=visible.method)
    hidden = np.zeros(visible.targets.total, dtype=bool)
    hidden[units] = True
    hidden[units[clear]] = False
    return replace(found, hidden_m=float(visible.targets.unit_length[hidden].sum()))


def _parts(count: int, most: int) -> Iterator[IntArray]:
    for start in range(0, count, max(1, most)):
        yield np.arange(start, min(count, start + max(1, most)))


@dataclass(frozen=True, eq=False)
class UnitCells:
    """Cells of the units: middle heights (n, k), which of them exist, and their height (n, k)."""

    z: FloatArray
    there: BoolArray
    tall: FloatArray
    low: FloatArray
    """Lower height of each unit's element (n,)."""
    high: FloatArray
    upright: BoolArray
    """True for units with an upright face (n,); others, as on a roof, have no area that is counted."""

    @classmethod
    def of(cls, space: NavigableSpace, solids: ModelSolids) -> UnitCells:
        spans = np.array([_span(item, solids.ceiling) for item in space.floor.elements]).reshape(-1, 2)
        low, high = spans[space.targets.element[space.targets.unit_segment]].T
        rows = int(np.ceil((high - low).max(initial=CELL_M) / CELL_M - 1e-9))
        bottom = low[:, None] + np.arange(rows) * CELL_M
        top = np.minimum(bottom + CELL_M, high[:, None])
        tall, z = np.maximum(top - bottom, 0.0), (bottom + top) / 2
        on_face, upright = _on_faces(space, solids.triangles, z)
        return cls(z, (tall > 1e-9) & on_face, tall, low, high, upright)


def _on_faces(space: NavigableSpace, triangles: FloatArray, z: FloatArray) -> tuple[BoolArray, BoolArray]:
    """True for heights (n, k) at which the model has an upright face, and for units (n,) that have one.

    A unit without any upright face, as on a sloping wall, has all its heights.
    """
    upright = triangles[_is_upright(triangles)]
    plan = shapely.linestrings(upright[:, [0, 1, 2], :2])
    points = shapely.points(space.targets.unit_xy)
    unit, face = shapely.STRtree(plan).query(points, predicate="dwithin", distance=ON_FACE_M)
    direction = _direction(upright[face])
    own = _along(space)[unit]
    same = np.abs(own[:, 0] * direction[:, 1] - own[:, 1] * direction[:, 0]) <= PARALLEL
    unit, face, direction = unit[same], face[same], direction[same]
    found = np.zeros(z.shape, dtype=bool)
    along = upright[face, :, :2] - space.targets.unit_xy[unit, None]
    t = np.einsum("nkd,nd->nk", along, direction)
    low, high = _heights_at(t, upright[face, :, 2])
    for k in range(z.shape[1]):
        here = (z[unit, k] >= low - AT_EDGE_M) & (z[unit, k] <= high + AT_EDGE_M)
        found[unit[here], k] = True
    has_face = np.isin(np.arange(len(z)), unit)
    found[~has_face] = True
    return found, has_face


def _is_upright(triangles: FloatArray) -> BoolArray:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normal, axis=1)
    found: BoolArray = (size > 1e-9) & (np.abs(normal[:, 2]) <= 0.05 * size)
    return found


def _direction(triangles: FloatArray) -> FloatArray:
    """Direction in plan of upright triangles: along the longest of their sides (n, 2)."""
    sides = np.roll(triangles, -1, axis=1)[..., :2] - triangles[..., :2]
    lengths = np.hypot(sides[..., 0], sides[..., 1])
    longest = np.argmax(lengths, axis=1)
    rows = np.arange(len(triangles))
    return sides[rows, longest] / np.maximum(lengths[rows, longest], 1e-9)[:, None]


def _heights_at(t: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper height of upright triangles where `t`, given at their corners (n, 3), is 0."""
    low, high = np.full(len(t), np.inf), np.full(len(t), -np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        span = t[:, b] - t[:, a]
        level = np.abs(span) < 1e-9
        fraction = np.clip(-t[:, a] / np.where(level, 1.0, span), 0.0, 1.0)
        at = z[:, a] + fraction * (z[:, b] - z[:, a])
        on = (
            ~level
            & (np.minimum(t[:, a], t[:, b]) <= AT_EDGE_M)
            & (np.maximum(t[:, a], t[:, b]) >= -AT_EDGE_M)
        )
        low = np.where(on, np.minimum(low, at), low)
        high = np.where(on, np.maximum(high, at), high)
    return low, high


def _span(item: Element, ceiling: float) -> tuple[float, float]:
    """Lower and upper height of an element above the floor, up to the next floor."""
    low, high = item.heights or (0.0, ceiling)
    return max(low, 0.0), max(min(high, ceiling), low, 0.0)


class _MarkedColumns:
    """Marked surfaces of the model: a pattern of bits by height for each column of the grid."""

    def __init__(self, solids: ModelSolids, space: NavigableSpace) -> None:
        rings = np.concatenate([part.exterior for part in space.floor.outline])
        self._low = rings.min(axis=0) - 1.0
        size = rings.max(axis=0) + 1.0 - self._low
        self._side = COLUMN_M
        while (size / self._side).prod() > MOST_COLUMNS:
            self._side *= 2
        self._shape = tuple((np.ceil(size / self._side) + 1).astype(int).tolist())
        self._tall = solids.ceiling / LEVELS
        known = shapely.union_all(
            [shapely.Polygon(part.exterior, part.holes).buffer(SOLID_M) for part in space.occluders]
        )
        shapely.prepare(known)
        bits = np.zeros(self._shape[0] * self._shape[1], dtype=np.uint64)
        triangles = self._within(solids.triangles)
        rings = shapely.linestrings(triangles[:, [0, 1, 2, 0], :2])
        for points in _samples(triangles[~shapely.covers(known, rings)]):
            self._mark(bits, points)
        self._bits = self._without_known(bits, known)

    def _within(self, triangles: FloatArray) -> FloatArray:
        """Triangles over the grid that lie between the floor and the next one."""
        high = self._low + np.array(self._shape) * self._side
        low_corner, high_corner = triangles.min(axis=1), triangles.max(axis=1)
        near = (high_corner[:, :2] >= self._low).all(axis=1) & (low_corner[:, :2] <= high).all(axis=1)
        top = LEVELS * self._tall
        there = (high_corner[:, 2] > self._tall) & (low_corner[:, 2] < top - self._tall)
        return triangles[near & there]

    def _mark(self, bits: np.ndarray, points: FloatArray) -> None:
        at = np.floor((points[:, :2] - self._low) / self._side).astype(np.int64)
        level = np.floor(points[:, 2] / self._tall).astype(np.int64)
        good = (at >= 0).all(axis=1) & (at < self._shape).all(axis=1) & (level >= 0) & (level < LEVELS)
        cell = at[good, 0] * self._shape[1] + at[good, 1]
        keys = np.unique(cell * LEVELS + level[good])
        np.bitwise_or.at(bits, keys // LEVELS, np.uint64(1) << (keys % LEVELS).astype(np.uint64))

    def _without_known(self, bits: np.ndarray, known: BaseGeometry) -> np.ndarray:
        """The patterns without columns in what the plan knows as solid from floor to ceiling."""
        marked = np.flatnonzero(bits)
        xy = np.column_stack(np.divmod(marked, self._shape[1])) + 0.5
        inside = shapely.contains_xy(known, *(xy * self._side + self._low).T)
        bits[marked[inside]] = 0
        return bits

    def reached(
        self, starts: FloatArray, ends: FloatArray, along: FloatArray, z: FloatArray, height: float
    ) -> BoolArray:
        """True for heights `z` (n, k) at `ends` (n, 2) that rays from scanners above `starts` (n, 2) reach.

        `along` are the directions of the targets' lines (n, 2).
        """
        rays = ends - starts
        away = np.hypot(*rays.T)
        sine = np.abs(rays[:, 0] * along[:, 1] - rays[:, 1] * along[:, 0]) / np.maximum(away, 1e-9)
        before = away - AT_TARGET_M / np.maximum(sine, GRAZING)
        clear = np.ones(z.shape, dtype=bool)
        left = _Rays.longest_first(starts, rays, away, before)
        for number, step in enumerate(np.arange(STEP_M, float(before.max(initial=0.0)), STEP_M)):
            left = left.longer_than(step)
            if number % SORTED_OUT == 0:
                left = left.among(np.flatnonzero(clear[left.row].any(axis=1)))
            fraction = step / left.away
            pattern = self._bits[self._column(left, fraction)]
            met = np.flatnonzero(pattern)
            if len(met):
                rows = left.row[met]
                level = np.floor((height + (z[rows] - height) * fraction[met, None]) / self._tall)
                level = np.clip(level, 0, LEVELS - 1).astype(np.uint64)
                clear[rows] &= (pattern[met, None] >> level) & np.uint64(1) == 0
        return clear

    def _column(self, rays: _Rays, fraction: FloatArray) -> IntArray:
        """Column (n,) in which each ray is after a fraction (n,) of it; at the grid's edge beyond that."""
        x = ((rays.x + fraction * rays.dx - self._low[0]) / self._side).astype(np.int64)
        y = ((rays.y + fraction * rays.dy - self._low[1]) / self._side).astype(np.int64)
        column: IntArray = np.clip(x, 0, self._shape[0] - 1) * self._shape[1]
        return column + np.clip(y, 0, self._shape[1] - 1)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays that are followed together, the longest first."""

    row: IntArray
    """Number of each ray among all (n,)."""
    x: FloatArray
    y: FloatArray
    """Where they start (n,)."""
    dx: FloatArray
    dy: FloatArray
    """The whole way to their ends (n,)."""
    away: FloatArray
    """Its length (n,)."""
    shorter: FloatArray
    """Minus the length that is followed (n,), ascending."""

    @classmethod
    def longest_first(
        cls, starts: FloatArray, rays: FloatArray, away: FloatArray, before: FloatArray
    ) -> _Rays:
        row = np.argsort(-before, kind="stable")
        (x, y), (dx, dy) = starts[row].T.copy(), rays[row].T.copy()
        return cls(row, x, y, dx, dy, away[row], -before[row])

    def longer_than(self, step: float) -> _Rays:
        """Those that are followed for more than this length."""
        count = int(np.searchsorted(self.shorter, -step))
        return self if count == len(self.row) else self.among(slice(count))

    def among(self, chosen: IntArray | slice) -> _Rays:
        """Some of the rays."""
        return _Rays(
            self.row[chosen],
            *(self.x[chosen], self.y[chosen]),
            *(self.dx[chosen], self.dy[chosen]),
            *(self.away[chosen], self.shorter[chosen]),
        )


def _samples(triangles: FloatArray) -> Iterator[FloatArray]:
    """Points (n, 3) on triangles: on lines along the longest side, both at most SAMPLE_M apart."""
    if not len(triangles):
        return
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    turned = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3
    triangles, longest = np.take_along_axis(triangles, turned[..., None], axis=1), sides.max(axis=1)
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    height = np.linalg.norm(across, axis=1) / np.maximum(longest, 1e-12)
    counts = np.maximum(1, np.ceil(np.column_stack([longest, height]) / SAMPLE_M)).astype(np.int64)
    found, group = np.unique(counts, axis=0, return_inverse=True)
    for number, (along, up) in enumerate(found.tolist()):
        own = triangles[group.ravel() == number]
        weights = _weights(along, up)
        for part in np.array_split(own, max(1, -(-len(own) * len(weights) // MOST_SAMPLES))):
            if len(part):
                yield np.einsum("wk,nkd->nwd", weights, part).reshape(-1, 3)


def _weights(along: int, up: int) -> FloatArray:
    """Weights of a triangle's corners (n, 3) on `up` lines along its first side, `along` steps on that."""
    lines = []
    for k in range(up + 1):
        share = 1 - k / up
        at = np.linspace(0.0, share, 1 + math.ceil(along * share))
        lines.append(np.column_stack([share - at, at, np.full(len(at), 1 - share)]))
    return np.concatenate(lines)
