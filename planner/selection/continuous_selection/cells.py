"""Cells that together contain every allowed position of a stop, and all units that each cell may see.

The bound of the continuous selection needs an upper estimate: no position may see a unit that its cell
does not. Cells are therefore conservative in both respects. A cell is dropped only if it surely contains
no allowed position, and its units are never too few. Too many units only weaken the bound, and as cells
become small the surplus vanishes.

Data
----
A cell is a square, `corner` and `side` in whole grid steps, with its edges included. Positions of stops
are whole grid steps too, so every position lies in at least one cell. `PositionCells` holds many cells as
flat arrays. What cell c may see are the runs `first[k]..last[k]` (unit numbers of the targets, both
included) with `pointer[c] <= k < pointer[c + 1]`.

Units: `corner`, `side`, `boxes` and `wide` count grid steps (`GRID` metres each) from the floor's local
origin; `middle`, clearances and `_UnitDistances` are local metres. A *row* is the index of a cell, as in
the kernel.

Invariants
----------
- The runs of one cell are ascending and disjoint (`_disjoint`), so that prices can be summed once per unit.
- `cut` returns quarters that cover their cell. For an odd side they overlap by one step.
- Every distance test has the slack of half the cell's diagonal, and `NOISE` for rounding.
- Each limit on views is tested by itself. A unit stays if each limit may hold somewhere in the cell, even
  if no single position meets them all.
- The largest cell is narrower than the clearance from elements, unless that is almost 0. So a cell with an
  allowed position contains no wall, and the kernel's expansion ends. If not, the cell may see all units.

Order of work: `all_cells` -> `_allowed` drops cells -> `_with_runs` calls the kernel (`_visible_runs`),
applies the limits (`_within_limits`) and makes the runs disjoint.
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
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.shapes import GRID, SLACK, local_origin, to_grid
from stopgo.planner.space.reach import reach_of
from stopgo.planner.space.stop_feasibility import StopFeasibility
from stopgo.planner.visibility.exact_sight import open_space
from stopgo.planner.visibility.sight.kernel import look_from_all_cells
from stopgo.planner.visibility.sight.sight import Scene, scene_of

LARGEST_CELL = 0.5
"""Metres; a cell narrower than the clearance of its positions contains no wall."""
SMALLEST_CELL = 8
"""Side in grid steps below which no cell is cut."""
NOISE = 4 * GRID
"""Metres by which rounding may move a position."""


@dataclass(frozen=True, eq=False)
class PositionCells:
    """Square cells, with all units that any position in each may see, as runs."""

    corner: IntArray
    """Lower left corner of each cell in grid steps (n, 2)."""
    side: IntArray
    """Side of each cell in grid steps (n,); a cell's edges belong to it."""
    pointer: IntArray
    """Runs `pointer[c]` to before `pointer[c + 1]` belong to cell c; no unit is in two of them (n + 1,)."""
    first: IntArray
    last: IntArray

    def __len__(self) -> int:
        return len(self.side)

    @property
    def middle(self) -> FloatArray:
        """Centre of each cell in local metres (n, 2)."""
        return (self.corner + self.side[:, None] / 2) * GRID

    def worth(self, price: FloatArray) -> FloatArray:
        """Total price of the units that each cell may see, at a price per unit (n,)."""
        before = np.concatenate([[0.0], np.cumsum(price)])
        runs = np.concatenate([[0.0], np.cumsum(before[self.last + 1] - before[self.first])])
        worth: FloatArray = runs[self.pointer[1:]] - runs[self.pointer[:-1]]
        return worth

    def among(self, chosen: IntArray) -> PositionCells:
        """Some of the cells."""
        counts = np.diff(self.pointer)[chosen]
        run = ranges(self.pointer[chosen], counts)
        pointer = np.concatenate([[0], np.cumsum(counts)])
        return PositionCells(self.corner[chosen], self.side[chosen], pointer, self.first[run], self.last[run])

    def joined(self, other: PositionCells) -> PositionCells:
        """These cells and the others."""
        return PositionCells(
            np.concatenate([self.corner, other.corner]),
            np.concatenate([self.side, other.side]),
            np.concatenate([self.pointer, self.pointer[-1] + other.pointer[1:]]),
            np.concatenate([self.first, other.first]),
            np.concatenate([self.last, other.last]),
        )


class CellVisibility:
    """One part of a floor, prepared for cells: allowed positions, and what whole cells may see."""

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
        crossings = self._reach.parts.gaps[self._reach.parts.gap_part == self._part]
        self._drive = shapely.union_all(
            [*pieces, *shapely.linestrings(crossings)] if len(crossings) else pieces
        )
        self._rooms = shapely.union_all(self._place.rooms)
        for shape in (self._drive, self._rooms):
            shapely.prepare(shape)

    def all_cells(self) -> PositionCells:
        """Cells that together contain all allowed positions of stops."""
        low_x, low_y, high_x, high_y = shapely.total_bounds(self._rooms)
        largest = min(LARGEST_CELL, 0.7 * self._place.element_clearance)
        side = max(SMALLEST_CELL, int(largest / GRID))
        slack = self._reach.site.slop + NOISE
        low = to_grid(np.array([low_x - slack, low_y - slack]))
        high = to_grid(np.array([high_x + slack, high_y + slack]))
        x, y = (np.arange(low[k], high[k] + 1, side) for k in range(2))
        corner = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        return self._with_runs(self._allowed(corner, np.full(len(corner), side)), side)

    def cut(self, cells: PositionCells) -> PositionCells:
        """The allowed quarters of cells; quarters overlap by one step where a side is odd."""
        found = []
        for side in np.unique(cells.side):
            half = -(-int(side) // 2)
            corner = cells.corner[cells.side == side]
            steps = np.array([(0, 0), (0, 1), (1, 0), (1, 1)]) * (int(side) - half)
            quarters = (corner[:, None] + steps[None]).reshape(-1, 2)
            found.append(self._with_runs(self._allowed(quarters, np.full(len(quarters), half)), half))
        whole = found[0]
        for more in found[1:]:
            whole = whole.joined(more)
        return whole

    def _allowed(self, corner: IntArray, side: IntArray) -> IntArray:
        """Corners (n, 2) of the cells that may contain an allowed position.

        A distance changes by at most the distance moved. So if the centre misses a limit by more than half
        the diagonal, every position of the cell misses it.
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
        """True if the cell's centre lies in an obstacle, and all its positions do or are too close."""
        inside: BoolArray = shapely.contains(self._place.obstacles, shapely.points(middle))
        return inside & (self._place.to_element(middle) + self._place.element_clearance - SLACK > away)

    def _avoided(self, middle: FloatArray, away: FloatArray) -> BoolArray:
        inside = np.zeros(len(middle), dtype=bool)
        for x, y, radius in self._settings.avoid:
            inside |= np.hypot(*(middle + self._origin - (x, y)).T) + away <= radius
        return inside

    def _with_runs(self, corner: IntArray, side: int) -> PositionCells:
        """The cells of one side length with these corners, with the units they may see."""
        wide = int(np.ceil(side * np.sqrt(0.5))) + 2
        boxes = np.concatenate([corner, corner + side], axis=1)
        row, first, last = self._visible_runs(boxes, wide)
        if not self._limits.none:
            row, first, last = self._within_limits(boxes, row, first, last)
        row, first, last = _disjoint(row, first, last, self._targets.total)
        return PositionCells(
            corner, np.full(len(corner), side), np.searchsorted(row, np.arange(len(corner) + 1)), first, last
        )

    def _visible_runs(self, boxes: IntArray, wide: int) -> tuple[IntArray, IntArray, IntArray]:
        """Row, first and last unit of the runs that each rectangle may see, unordered."""
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
        kernel = compiled(look_from_all_cells, large=True) or look_from_all_cells
        pointer, runs = _run(kernel, arrays, reach, mesh.triangles, _all_units(scene))
        of = np.repeat(np.arange(rows), np.diff(pointer))
        start = self._targets.first_unit[:-1][runs[0]]
        return of, start + runs[1], start + runs[2]

    def _within_limits(
        self, boxes: IntArray, row: IntArray, first: IntArray, last: IntArray
    ) -> tuple[IntArray, IntArray, IntArray]:
        """The same without units that no position in the cell sees within the limits."""
        counts = last - first + 1
        unit, of = ranges(first, counts), np.repeat(row, counts)
        good = may_meet_limits(self._distances(boxes, unit, of), self._limits)
        unit, of = unit[good], of[good]
        return of, unit, unit

    def _distances(self, boxes: IntArray, unit: IntArray, of: IntArray) -> _UnitDistances:
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
        return _UnitDistances(np.hypot(*inward.T), np.hypot(*outward.T), heights.max(axis=(0, 1)))


@dataclass(frozen=True, eq=False)
class _UnitDistances:
    """Distances in metres between a unit's midpoint and the positions of a cell."""

    nearest: FloatArray
    farthest: FloatArray
    most_square: FloatArray
    """The greatest distance of a position from the unit's line."""


def may_meet_limits(away: _UnitDistances, limits: ViewLimits) -> BoolArray:
    """True where each limit by itself may hold at some position of the cell."""
    slant = np.maximum(away.nearest - NOISE, 0.0) ** 2 + limits.rise**2
    square = away.most_square + NOISE
    good: BoolArray = away.farthest + NOISE >= limits.near
    if limits.max_incidence is not None:
        good &= np.cos(limits.max_incidence) ** 2 * slant <= square**2 * (1 + 1e-9)
    if limits.farthest_per_height is not None:
        good &= slant <= limits.farthest_per_height * square * (1 + 1e-9)
    return good


def _all_units(scene: Scene) -> tuple[IntArray, IntArray, IntArray]:
    """All units, as one run per segment."""
    number = np.arange(len(scene.units))
    return number, np.zeros(len(number), np.int64), scene.units - 1


def _run(
    kernel: Callable[..., int],
    arrays: list[Any],
    reach: int,
    triangles: int,
    all_units: tuple[IntArray, IntArray, IntArray],
) -> tuple[IntArray, tuple[IntArray, IntArray, IntArray]]:
    """Call the kernel, again with more room when it runs out; a cell given up may see all units."""
    rows = len(arrays[1])
    stack, pointer = np.zeros(16 * (2 * triangles + 64), np.int64), np.zeros(rows + 1, np.int64)
    out = [np.zeros(max(4096, 64 * rows), np.int64) for _ in range(3)]
    done = kernel(0, pointer, *arrays, reach, stack, *out)
    while done != rows:
        if done < 0:
            row = -1 - done
            begin, count = int(pointer[row]), len(all_units[0])
            while len(out[0]) < begin + count:
                out = [np.concatenate([column, np.zeros_like(column)]) for column in out]
            for column, values in zip(out, all_units, strict=True):
                column[begin : begin + count] = values
            pointer[row + 1] = begin + count
            done = row + 1
        else:
            out = [np.concatenate([column, np.zeros_like(column)]) for column in out]
        done = kernel(done, pointer, *arrays, reach, stack, *out)
    end = int(pointer[-1])
    return pointer, (out[0][:end], out[1][:end], out[2][:end])


def _disjoint(
    row: IntArray, first: IntArray, last: IntArray, total: int
) -> tuple[IntArray, IntArray, IntArray]:
    """The same units as disjoint runs, in the order of rows and units."""
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
