"""Targets as strips: every target unit with the height of its element, cut into cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import Targets
from stopgo.planner.scan_simulation.extrusion import BEAM_KIND, NONE, ExtrudedFloor, heights_of

CELL_M = 0.1
"""Height of a cell; it is as wide as its unit."""
PIECE_M = 0.005
"""Length of the pieces in which faces are looked up."""
FLUSH_M = 2e-3
"""Largest distance between a target's face and the same side of an element."""
PARALLEL = 0.02
"""Sine of the largest angle between them."""
UNDER_M = 0.1
"""Width of the underside strip along a beam's edge that counts for the edge's units."""
PATCH_M = 0.025
"""Side of the squares in which undersides are looked up."""


@dataclass(frozen=True, eq=False)
class Strips:
    """Cells of the target units; unit k has cells `first_cell[k]` to before `first_cell[k + 1]`."""

    first_cell: IntArray
    """(units + 1,)."""
    low: FloatArray
    """Lower height of each unit's strip (units,)."""
    tall: FloatArray
    """Height of each unit's strip (units,)."""
    area: FloatArray
    """Area of each cell, m² (cells,)."""
    middle: FloatArray
    """Centre of each cell, from the solids' origin (cells, 3)."""
    normal: FloatArray
    """Normal of each cell (cells, 3); it may point to either side."""
    under: BoolArray
    """True for units whose last cell is an underside (units,)."""
    first_piece: IntArray
    """First piece of each upright face (faces + 1,)."""
    piece_unit: IntArray
    """Unit on the left and on the right of each piece (pieces, 2), else NONE."""
    patch: IntArray
    """Squares of undersides, ascending (p,)."""
    patch_unit: IntArray

    @property
    def cells(self) -> int:
        return len(self.area)

    @property
    def most(self) -> int:
        """Largest number of cells in a strip."""
        return int(np.diff(self.first_cell).max(initial=0))

    @property
    def unit_of_cell(self) -> IntArray:
        return frozen(np.repeat(np.arange(len(self.low)), np.diff(self.first_cell)), np.int64)

    def units_of(self, cell: IntArray) -> IntArray:
        """Unit of some cells (n,)."""
        return np.searchsorted(self.first_cell, cell, side="right") - 1

    def under_at(self, xy: FloatArray) -> IntArray:
        """Unit of the underside at each position (n, 2), else NONE."""
        if not len(self.patch):
            return np.full(len(xy), NONE)
        key = patches_at(xy)
        place = np.minimum(np.searchsorted(self.patch, key), len(self.patch) - 1)
        return np.where(self.patch[place] == key, self.patch_unit[place], NONE)


def strips_of(solids: ExtrudedFloor, targets: Targets, floor: FloorPlan, ceiling: float) -> Strips:
    """The strips of all targets, with the lookup from sides of the solids to units."""
    element = targets.element[targets.unit_segment]
    spans = np.array([heights_of(item, ceiling) for item in floor.elements]).reshape(-1, 2)
    is_beam = np.array([item.kind == BEAM_KIND for item in floor.elements], dtype=bool)[element]
    low, high = spans[element].T
    rows = np.maximum(1, np.ceil((high - low) / CELL_M - 1e-9)).astype(np.int64) + is_beam
    first = np.concatenate([[0], np.cumsum(rows)])
    unit = np.repeat(np.arange(targets.total), rows)
    row = np.arange(first[-1]) - first[unit]
    below = is_beam[unit] & (row == rows[unit] - 1)
    top = np.minimum(low[unit] + (row + 1) * CELL_M, high[unit])
    bottom = low[unit] + row * CELL_M
    z = np.where(below, low[unit], (top + bottom) / 2)
    along = (targets.b - targets.a)[targets.unit_segment]
    along = along / np.hypot(*along.T)[:, None]
    side = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(along))])[unit]
    first_piece, piece_unit = _pieces(solids, targets)
    patch, patch_unit = _patches(targets, is_beam, solids.origin)
    return Strips(
        first_cell=frozen(first, np.int64),
        low=frozen(low),
        tall=frozen(high - low),
        area=frozen(targets.unit_length[unit] * np.where(below, UNDER_M, top - bottom)),
        middle=frozen(np.column_stack([(targets.unit_xy - solids.origin)[unit], z])),
        normal=frozen(np.where(below[:, None], (0.0, 0.0, 1.0), side)),
        under=frozen(is_beam, np.bool_),
        first_piece=frozen(first_piece, np.int64),
        piece_unit=frozen(piece_unit, np.int64),
        patch=frozen(patch, np.int64),
        patch_unit=frozen(patch_unit, np.int64),
    )


def _pieces(solids: ExtrudedFloor, targets: Targets) -> tuple[IntArray, IntArray]:
    """Pieces of the upright faces, and the units on both sides of each."""
    along = solids.b - solids.a
    length = np.hypot(*along.T)
    first = np.concatenate([[0], np.cumsum(np.ceil(length / PIECE_M).astype(np.int64))])
    units = np.full((first[-1], 2), NONE)
    face, segment, away = _flush(solids, targets)
    for f, s in zip(
        *(item[np.argsort(-away, kind="stable")].tolist() for item in (face, segment)), strict=True
    ):
        u, a, b = along[f] / length[f], targets.a[s] - solids.origin, targets.b[s] - solids.origin
        ends = sorted([float((a - solids.a[f]) @ u), float((b - solids.a[f]) @ u)])
        low, high = np.clip(np.round(np.array(ends) / PIECE_M), 0, first[f + 1] - first[f]).astype(int)
        if low >= high:
            continue
        at = solids.a[f] + ((np.arange(low, high) + 0.5) * PIECE_M)[:, None] * u
        fraction = (at - a) @ (b - a) / ((b - a) @ (b - a))
        count, begin = int(targets.units[s]), int(targets.first_unit[s])
        found = begin + np.clip((fraction * count).astype(np.int64), 0, count - 1)
        sides = [0, 1] if not targets.occluding[s] else [0] if (b - a) @ u > 0 else [1]
        units[first[f] + low : first[f] + high, sides] = found[:, None]
    return first, units


def _flush(solids: ExtrudedFloor, targets: Targets) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs of upright faces and target segments that coincide, and their distance."""
    lines = shapely.linestrings(np.stack([solids.a, solids.b], axis=1))
    wanted = shapely.linestrings(np.stack([targets.a, targets.b], axis=1) - solids.origin)
    face, segment = shapely.STRtree(wanted).query(lines, predicate="dwithin", distance=FLUSH_M)
    one, other = (solids.b - solids.a)[face], (targets.b - targets.a)[segment]
    across = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    along = np.abs(across) <= PARALLEL * np.hypot(*one.T) * np.hypot(*other.T)
    face, segment = face[along], segment[along]
    return face, segment, shapely.distance(lines[face], wanted[segment])


def _patches(targets: Targets, is_beam: BoolArray, origin: FloatArray) -> tuple[IntArray, IntArray]:
    """Squares along the edges of beams, and the unit of each; where two overlap, the first."""
    unit = np.flatnonzero(is_beam)
    if not len(unit):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    along = (targets.b - targets.a)[targets.unit_segment[unit]]
    along = along / np.hypot(*along.T)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    middle, half = targets.unit_xy[unit] - origin, targets.unit_length[unit, None] / 2
    offsets = np.arange(-UNDER_M, UNDER_M + 1e-9, PATCH_M / 2)
    key, owner = [], []
    for offset in offsets[np.argsort(np.abs(offsets), kind="stable")]:
        for fraction in (0.0, -0.5, 0.5):
            key.append(patches_at(middle + fraction * half * along + offset * across))
            owner.append(unit)
    patches, first = np.unique(np.concatenate(key), return_index=True)
    return patches, np.concatenate(owner)[first]


def patches_at(xy: FloatArray) -> IntArray:
    """Number of the square that contains each position (n, 2)."""
    x, y = np.floor(xy / PATCH_M).astype(np.int64).T
    numbers: IntArray = x * 2**24 + y
    return numbers
