"""Route + solids of the model -> area of the targets that the stops see, by height.

A plan counts a target as seen if a level ray at the scanner's height reaches it. What stands below that
height or hangs above it hides a part of the target: furniture, lintels, ceilings, beams. Here the model's
surfaces are marked in columns of a grid; each column is a pattern of bits by height. A ray from the scanner
to each height of a target is followed over the grid. Columns within what the plan knows as solid are left
out: there the plan's own exact visibility has decided.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document.limits import scanner_height
from stopgo.mission.floor import Element
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace, Route
from stopgo.mission.stages.seen_area import SeenArea, SeenSurface

COLUMN_M = 0.05
"""Side of a column; doubled for floors with more than MOST_COLUMNS."""
MOST_COLUMNS = 20_000_000
LEVELS = 64
"""Heights of a column: the bits of its pattern."""
SAMPLE_M = 0.03
"""Distance of the points by which a surface is marked."""
MOST_SAMPLES = 2_000_000
"""Points marked at a time."""
STEP_M = 0.04
"""Steps along a ray."""
AT_TARGET_M = 0.08
"""The last of a ray, which lies in the target's own surface."""
CELL_M = 0.1
"""Height of the cells in which a target's area is counted."""
ON_FACE_M = 0.02
"""A face this near to a unit is the unit's own."""
SOLID_M = 0.04
"""Columns within this of the plan's solids are theirs."""
MOST_PAIRS = 200_000


def seen_surface(route: Route, solids: ModelSolids) -> SeenSurface:
    """Return the area of the targets that the stops of a route see, by kind of element."""
    space, height = route.space, scanner_height(route.settings)
    columns = _MarkedColumns(solids, space)
    targets, elements = space.targets, space.floor.elements
    cells = _Cells.of(space, solids)
    seen = np.zeros(cells.there.shape, dtype=bool)
    for stop, units in _sights(route):
        for part in np.array_split(units, max(1, -(-len(units) // MOST_PAIRS))):
            seen[part] |= columns.reached(stop, targets.unit_xy[part], cells.z[part], height)
    seen &= cells.there
    kinds = np.array([item.kind for item in elements])[targets.element[targets.unit_segment]]
    promised = np.zeros(targets.total, dtype=bool)
    for _, units in _sights(route):
        promised[units] = True
    area = targets.unit_length[:, None] * cells.tall
    return SeenSurface(
        height_m=height,
        kinds={
            str(kind): _area(kinds == kind, promised, area * cells.there, seen) for kind in np.unique(kinds)
        },
        hidden_m=float(targets.unit_length[promised & ~seen.any(axis=1)].sum()),
    )


def _area(of_kind: BoolArray, promised: BoolArray, area: FloatArray, seen: BoolArray) -> SeenArea:
    own = of_kind & promised
    return SeenArea(
        total_m2=float(area[own].sum()),
        seen_m2=float((area[own] * seen[own]).sum()),
        length_m2=float(area[of_kind].sum()),
    )


def _sights(route: Route) -> Iterator[tuple[FloatArray, IntArray]]:
    """Position of each stop, and the units that it sees in the plan."""
    visibility, candidates = route.visibility, route.visibility.candidates
    for row in route.selection.chosen.tolist():
        yield candidates.xy[candidates.kept[row]], visibility.seen_by(row)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells of the units: middle heights (n, k), which of them exist, and their height (n, k)."""

    z: FloatArray
    there: BoolArray
    tall: FloatArray

    @classmethod
    def of(cls, space: NavigableSpace, solids: ModelSolids) -> _Cells:
        spans = np.array([_span(item, solids.ceiling) for item in space.floor.elements]).reshape(-1, 2)
        low, high = spans[space.targets.element[space.targets.unit_segment]].T
        rows = int(np.ceil((high - low).max(initial=CELL_M) / CELL_M - 1e-9))
        bottom = low[:, None] + np.arange(rows) * CELL_M
        top = np.minimum(bottom + CELL_M, high[:, None])
        tall, z = np.maximum(top - bottom, 0.0), (bottom + top) / 2
        return cls(z, (tall > 1e-9) & _on_faces(space, solids.triangles, z), tall)


def _on_faces(space: NavigableSpace, triangles: FloatArray, z: FloatArray) -> BoolArray:
    """True for heights (n, k) of the units at which the model has an upright face: no opening is there.

    A unit without any upright face, as on a sloping wall, has all its heights.
    """
    upright = triangles[_is_upright(triangles)]
    plan = shapely.linestrings(upright[:, [0, 1, 2], :2])
    points = shapely.points(space.targets.unit_xy)
    unit, face = shapely.STRtree(plan).query(points, predicate="dwithin", distance=ON_FACE_M)
    found = np.zeros(z.shape, dtype=bool)
    along = upright[face, :, :2] - space.targets.unit_xy[unit, None]
    t = np.einsum("nkd,nd->nk", along, _direction(upright[face]))
    low, high = _heights_at(t, upright[face, :, 2])
    for k in range(z.shape[1]):
        here = (z[unit, k] >= low - ON_FACE_M) & (z[unit, k] <= high + ON_FACE_M)
        found[unit[here], k] = True
    found[~np.isin(np.arange(len(z)), unit)] = True
    return found


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
            & (np.minimum(t[:, a], t[:, b]) <= ON_FACE_M)
            & (np.maximum(t[:, a], t[:, b]) >= -ON_FACE_M)
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

    def reached(self, stop: FloatArray, ends: FloatArray, z: FloatArray, height: float) -> BoolArray:
        """True for heights `z` (n, k) at `ends` (n, 2) that rays from a scanner above `stop` reach."""
        away = np.hypot(*(ends - stop).T)
        clear = np.ones(z.shape, dtype=bool)
        for step in np.arange(STEP_M, float(away.max(initial=0.0)) - AT_TARGET_M, STEP_M):
            on = np.flatnonzero(away - AT_TARGET_M > step)
            fraction = step / away[on]
            at = np.floor((stop + fraction[:, None] * (ends[on] - stop) - self._low) / self._side).astype(
                np.int64
            )
            at = np.clip(at, 0, np.array(self._shape) - 1)
            pattern = self._bits[at[:, 0] * self._shape[1] + at[:, 1]]
            met = np.flatnonzero(pattern)
            if len(met):
                rows = on[met]
                level = np.floor((height + (z[rows] - height) * fraction[met, None]) / self._tall)
                level = np.clip(level, 0, LEVELS - 1).astype(np.uint64)
                clear[rows] &= (pattern[met, None] >> level) & np.uint64(1) == 0
        return clear


def _samples(triangles: FloatArray) -> Iterator[FloatArray]:
    """Points (n, 3) on triangles, at most SAMPLE_M apart."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    count = np.maximum(1, np.ceil(longest / SAMPLE_M)).astype(np.int64)
    for many in np.unique(count).tolist():
        own = triangles[count == many]
        i, j = np.triu_indices(many + 1)
        weights = np.column_stack([i, j - i, many - j]) / many
        for part in np.array_split(own, max(1, -(-len(own) * len(weights) // MOST_SAMPLES))):
            if len(part):
                yield np.einsum("wk,nkd->nwd", weights, part).reshape(-1, 3)
