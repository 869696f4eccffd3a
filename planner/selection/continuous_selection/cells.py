"""Cells that hold every place where a stop may be, and all that is in sight of any place in each.

A cell is a square in whole grid steps, as places of stops are. One is left out only where surely no place in
it is allowed, and what is told of its sight is never too little: what no cell can do, no place can.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from stopgo.mission.document.limits import ViewLimits, limits_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import Candidates
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import GRID, SLACK, local_origin, to_grid
from stopgo.planner.selection.continuous_selection.cell_kernel import (
    most_turn,
    overlook,
    overlook_all,
    part_too_far,
)
from stopgo.planner.space.reach import reach_of
from stopgo.planner.space.stop_feasibility import StopFeasibility
from stopgo.planner.visibility.exact_sight import open_space
from stopgo.planner.visibility.sight.kernel import (
    clip_reach,
    clip_side,
    first_not_negative,
    last_not_negative,
    not_negative,
    turn,
    within_reach,
)
from stopgo.planner.visibility.sight.sight import Scene, scene_of
from stopgo.planner.visibility.unit_ranges import ranges

LARGEST_CELL = 0.5
"""Metres; of a cell narrower than its places' distance from walls, no wall is within."""
SMALLEST_CELL = 8
"""Grid steps of the side below which no cell is cut any more."""
NOISE = 4 * GRID
"""Metres by which rounding may move a place."""
HELPERS = (
    turn,
    not_negative,
    within_reach,
    first_not_negative,
    last_not_negative,
    clip_side,
    clip_reach,
    most_turn,
    part_too_far,
    overlook,
)


@dataclass(frozen=True, eq=False)
class PlaceCells:
    """Squares with all that may be in sight of a place in them, as runs of units."""

    corner: IntArray
    """Lower left corner of each in grid steps (n, 2)."""
    side: IntArray
    """In grid steps (n,); a cell's edges belong to it."""
    pointer: IntArray
    """Runs `pointer[c]` to `pointer[c + 1]` are those of cell c; no unit is in two of them (n + 1,)."""
    first: IntArray
    last: IntArray

    def __len__(self) -> int:
        return len(self.side)

    @property
    def middle(self) -> FloatArray:
        """The middle of each in local metres (n, 2)."""
        return (self.corner + self.side[:, None] / 2) * GRID

    def worth(self, price: FloatArray) -> FloatArray:
        """What the units that each cell may see cost together, at a price for every unit (n,)."""
        before = np.concatenate([[0.0], np.cumsum(price)])
        runs = np.concatenate([[0.0], np.cumsum(before[self.last + 1] - before[self.first])])
        worth: FloatArray = runs[self.pointer[1:]] - runs[self.pointer[:-1]]
        return worth

    def among(self, chosen: IntArray) -> PlaceCells:
        """Some of them."""
        counts = np.diff(self.pointer)[chosen]
        run = ranges(self.pointer[chosen], counts)
        pointer = np.concatenate([[0], np.cumsum(counts)])
        return PlaceCells(self.corner[chosen], self.side[chosen], pointer, self.first[run], self.last[run])

    def joined(self, other: PlaceCells) -> PlaceCells:
        """These and the others."""
        return PlaceCells(
            np.concatenate([self.corner, other.corner]),
            np.concatenate([self.side, other.side]),
            np.concatenate([self.pointer, self.pointer[-1] + other.pointer[1:]]),
            np.concatenate([self.first, other.first]),
            np.concatenate([self.last, other.last]),
        )


class CellVisibility:
    """A floor's part, prepared for telling where stops may be and what is in sight of whole cells."""

    def __init__(self, candidates: Candidates) -> None:
        space = candidates.space
        self._space, self._settings, self._part = space, space.settings, candidates.chosen_part
        self._origin, self._targets = local_origin(space.floor), space.targets
        self._place, self._reach = StopFeasibility(space), reach_of(space)
        a, b = self._targets.a - self._origin, self._targets.b - self._origin
        self._scene = scene_of(open_space(candidates), a, b, self._targets.units, self._targets.occluding)
        self._limits = limits_of(self._settings)
        own = [k for k, part in enumerate(self._reach.parts.part) if part == self._part]
        pieces = [self._reach.parts.pieces[k] for k in own]
        ways = self._reach.parts.gaps[self._reach.parts.gap_part == self._part]
        self._drive = shapely.union_all([*pieces, *shapely.linestrings(ways)] if len(ways) else pieces)
        self._rooms = shapely.union_all(self._place.rooms)
        for shape in (self._drive, self._rooms):
            shapely.prepare(shape)

    def whole(self) -> PlaceCells:
        """Cells that hold all places where a stop may be."""
        low_x, low_y, high_x, high_y = shapely.total_bounds(self._rooms)
        largest = min(LARGEST_CELL, 0.7 * self._place.element_clearance)
        side = max(SMALLEST_CELL, int(largest / GRID))
        slack = self._reach.site.slop + NOISE
        low = to_grid(np.array([low_x - slack, low_y - slack]))
        high = to_grid(np.array([high_x + slack, high_y + slack]))
        x, y = (np.arange(low[k], high[k] + 1, side) for k in range(2))
        corner = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return self._seen_from(self._allowed(corner, np.full(len(corner), side)), side)

    def cut(self, cells: PlaceCells) -> PlaceCells:
        """The quarters of cells in which a stop may be; their sides overlap by a step where one is odd."""
        found = []
        for side in np.unique(cells.side):
            half = -(-int(side) // 2)
            corner = cells.corner[cells.side == side]
            steps = np.array([(0, 0), (0, 1), (1, 0), (1, 1)]) * (int(side) - half)
            quarters = (corner[:, None] + steps[None]).reshape(-1, 2)
            found.append(self._seen_from(self._allowed(quarters, np.full(len(quarters), half)), half))
        whole = found[0]
        for more in found[1:]:
            whole = whole.joined(more)
        return whole

    def _allowed(self, corner: IntArray, side: IntArray) -> IntArray:
        """Those corners (n, 2) of cells of which not every place is surely forbidden.

        No distance changes by more than the way, so what the middle lacks by more than that, all lack.
        """
        middle = (corner + side[:, None] / 2) * GRID
        away = side * GRID * np.sqrt(0.5) + NOISE
        points = shapely.points(middle)
        able = shapely.distance(self._rooms, points) <= away + SLACK
        for keep in (
            lambda at: shapely.distance(self._place.outline, points[at]) <= away[at] + SLACK,
            lambda at: shapely.distance(self._drive, points[at]) <= away[at] + self._reach.site.slop + NOISE,
            lambda at: self._place.to_element(middle[at]) >= self._place.element_clearance - SLACK - away[at],
            lambda at: self._place.to_edge(middle[at]) >= self._settings.edge - SLACK - away[at],
            lambda at: ~self._inside_wall(middle[at], away[at]),
            lambda at: ~self._avoided(middle[at], away[at]),
        ):
            at = np.flatnonzero(able)
            able[at] = keep(at)
        found: IntArray = corner[able]
        return found

    def _inside_wall(self, middle: FloatArray, away: FloatArray) -> BoolArray:
        """Whether a cell's middle is in an obstacle, and its places are too, or too near."""
        inside: BoolArray = shapely.contains(self._place.obstacles, shapely.points(middle))
        return inside & (self._place.to_element(middle) + self._place.element_clearance - SLACK > away)

    def _avoided(self, middle: FloatArray, away: FloatArray) -> BoolArray:
        inside = np.zeros(len(middle), dtype=bool)
        for x, y, radius in self._settings.avoid:
            inside |= np.hypot(*(middle + self._origin - (x, y)).T) + away <= radius
        return inside

    def _seen_from(self, corner: IntArray, side: int) -> PlaceCells:
        """The cells of one side with these corners and what is in sight of them."""
        wide = int(np.ceil(side * np.sqrt(0.5))) + 2
        boxes = np.concatenate([corner, corner + side], axis=1)
        row, first, last = self._looked(boxes, wide)
        if not self._limits.none:
            row, first, last = self._well(boxes, row, first, last)
        row, first, last = _apart(row, first, last, self._targets.total)
        return PlaceCells(
            corner, np.full(len(corner), side), np.searchsorted(row, np.arange(len(corner) + 1)), first, last
        )

    def _looked(self, boxes: IntArray, wide: int) -> tuple[IntArray, IntArray, IntArray]:
        """Row, first and last unit of what may be in sight of each rectangle, in no order."""
        scene, mesh, rows = self._scene, self._scene.mesh, len(boxes)
        shapes = shapely.box(*(boxes + np.array([-2, -2, 2, 2])).T * GRID)
        row, triangle = mesh.tree.query(shapes, predicate="intersects")
        order = np.lexsort((triangle, row))
        row, triangle = row[order], triangle[order]
        arrays = [
            np.ascontiguousarray(array, dtype=np.int64)
            for array in (
                *(boxes.ravel(), np.full(rows, wide), np.searchsorted(row, np.arange(rows + 1)), triangle),
                *(mesh.vertices[:, 0], mesh.vertices[:, 1]),
                *(mesh.corners.ravel(), mesh.neighbour.ravel(), scene.face.ravel()),
                *(scene.bucket_pointer, scene.bucket_segment, scene.bucket_low, scene.bucket_high),
                *(scene.a[:, 0], scene.a[:, 1], scene.b[:, 0], scene.b[:, 1], scene.units),
            )
        ]
        reach = round(self._settings.range / GRID)
        kernel = compiled(overlook_all, *HELPERS)
        pointer, runs = _run(kernel, arrays, reach, mesh.triangles, _everything(scene))
        of = np.repeat(np.arange(rows), np.diff(pointer))
        start = self._targets.first_unit[:-1][runs[0]]
        return of, start + runs[1], start + runs[2]

    def _well(
        self, boxes: IntArray, row: IntArray, first: IntArray, last: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """The same without units that no place in the cell sees within the limits."""
        counts = last - first + 1
        unit, of = ranges(first, counts), np.repeat(row, counts)
        good = may_be_well_seen(self._nearness(boxes, unit, of), self._limits)
        unit, of = unit[good], of[good]
        return of, unit, unit

    def _nearness(self, boxes: IntArray, unit: IntArray, of: IntArray) -> _Nearness:
        targets, segment = self._targets, self._targets.unit_segment[unit]
        low, high = boxes[of, :2] * GRID, boxes[of, 2:] * GRID
        middle = targets.unit_xy[unit] - self._origin
        inward = np.maximum(np.maximum(low - middle, middle - high), 0.0)
        outward = np.maximum(np.abs(low - middle), np.abs(high - middle))
        along = (targets.b - targets.a)[segment]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
        x = np.stack([(low - middle)[:, 0], (high - middle)[:, 0]])
        y = np.stack([(low - middle)[:, 1], (high - middle)[:, 1]])
        heights = np.abs(x[:, None] * across[:, 0] + y[None] * across[:, 1])
        return _Nearness(np.hypot(*inward.T), np.hypot(*outward.T), heights.max(axis=(0, 1)))


@dataclass(frozen=True, eq=False)
class _Nearness:
    """How a unit's midpoint lies to the places of a cell, in metres."""

    nearest: FloatArray
    farthest: FloatArray
    most_square: FloatArray
    """The greatest distance of a place from the line the unit lies on."""


def may_be_well_seen(way: _Nearness, limits: ViewLimits) -> BoolArray:
    """Whether each limit by itself may hold at some place of the cell."""
    slant = np.maximum(way.nearest - NOISE, 0.0) ** 2 + limits.rise**2
    square = way.most_square + NOISE
    good: BoolArray = way.farthest + NOISE >= limits.near
    if limits.max_incidence is not None:
        good &= np.cos(limits.max_incidence) ** 2 * slant <= square**2 * (1 + 1e-9)
    if limits.farthest_per_height is not None:
        good &= slant <= limits.farthest_per_height * square * (1 + 1e-9)
    return good


def _everything(scene: Scene) -> tuple[IntArray, IntArray, IntArray]:
    """Every unit there is, as runs."""
    number = np.arange(len(scene.units))
    return number, np.zeros(len(number), np.int64), scene.units - 1


def _run(
    kernel: Callable[..., int],
    arrays: list[Any],
    reach: int,
    triangles: int,
    everything: tuple[IntArray, IntArray, IntArray],
) -> tuple[IntArray, tuple[IntArray, IntArray, IntArray]]:
    """Call the kernel, again with more room when that ran out; a cell without end may see everything."""
    rows = len(arrays[1])
    stack, pointer = np.zeros(16 * (2 * triangles + 64), np.int64), np.zeros(rows + 1, np.int64)
    out = [np.zeros(max(4096, 64 * rows), np.int64) for _ in range(3)]
    done = kernel(0, pointer, *arrays, reach, stack, *out)
    while done != rows:
        if done < 0:
            row = -1 - done
            begin, count = int(pointer[row]), len(everything[0])
            while len(out[0]) < begin + count:
                out = [np.concatenate([column, np.zeros_like(column)]) for column in out]
            for column, values in zip(out, everything, strict=True):
                column[begin : begin + count] = values
            pointer[row + 1] = begin + count
            done = row + 1
        else:
            out = [np.concatenate([column, np.zeros_like(column)]) for column in out]
        done = kernel(done, pointer, *arrays, reach, stack, *out)
    end = int(pointer[-1])
    return pointer, (out[0][:end], out[1][:end], out[2][:end])


def _apart(row: IntArray, first: IntArray, last: IntArray, total: int) -> tuple[IntArray, IntArray, IntArray]:
    """Runs that say the same, in the order of rows and units, no unit twice in a row."""
    order = np.lexsort((first, row))
    row, first, last = row[order], first[order], last[order]
    far = row * (total + 1)
    reached = np.maximum.accumulate(last + far) - far
    if len(row):
        same = np.diff(row) == 0
        begin = np.where(same, np.maximum(first[1:], reached[:-1] + 1), first[1:])
        first = np.concatenate([first[:1], begin])
    real = first <= last
    return row[real], first[real], last[real]
