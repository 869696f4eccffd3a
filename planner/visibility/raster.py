"""The paper's binary occupancy map: square cells of d_dis, occupied where something occludes (3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import Candidates
from stopgo.planner.geometry.room_grid import main_axes
from stopgo.planner.geometry.shapes import local_origin, segments_of, to_shape

MARGIN = 2.25
"""Free cells around everything. The quarter keeps faces and units, which often lie on multiples of half
a cell, off the borders between cells, where floating-point noise would decide."""
LARGEST = 400_000_000
"""Cells above which no map is made."""


@dataclass(frozen=True, eq=False)
class Raster:
    """Cells in a frame along `axes`, counted from `corner`; metres, in the floor's local frame."""

    axes: FloatArray
    """Rows: directions of the columns and the rows of cells (2, 2)."""
    corner: FloatArray
    """The outer corner of cell (0, 0), along `axes` (2,)."""
    cell: float
    occupied: BoolArray
    """(height, width)."""

    def cells_of(self, local: FloatArray) -> IntArray:
        """Column and row of the cell that holds each local point (n, 2)."""
        return _cells(local @ self.axes.T - self.corner, self.cell)


def raster_of(candidates: Candidates, *, aligned: bool) -> Raster:
    """The map of a floor's occluders, along the main axes of its outline or along those of the drawing.

    A cell is occupied if an occluder's boundary runs through it or its middle lies inside an occluder.
    """
    space = candidates.space
    origin, cell = local_origin(space.floor), space.settings.d_dis
    axes = main_axes(to_shape(space.floor.outline, origin)) if aligned else np.eye(2)
    edges = segments_of(to_shape(space.occluders, origin)) @ axes.T
    seen = np.concatenate([space.targets.unit_xy, candidates.xy[candidates.kept]]) - origin
    everything = np.concatenate([edges.reshape(-1, 2), seen @ axes.T])
    corner = everything.min(axis=0) - MARGIN * cell
    size = _cells(everything.max(axis=0) - corner, cell) + 1 + int(np.ceil(MARGIN))
    _check_size(space.floor.name, int(size.prod()), cell)
    return Raster(axes, corner, cell, _occupied((edges - corner) / cell, size))


def _check_size(name: str, cells: int, cell: float) -> None:
    if cells > LARGEST:
        raise InputError(
            f"{name}: visibility = bresenham needs {cells} cells of {cell:g} m, at most {LARGEST}; "
            "raise --d-dis or use --visibility exact"
        )


def _occupied(edges: FloatArray, size: IntArray) -> BoolArray:
    """The map (height, width) of closed rings given as edges (n, 2, 2) in cells."""
    occupied = inside_of(edges, width=int(size[0]), height=int(size[1]))
    columns, rows = crossed_by(edges).T
    occupied[rows, columns] = True
    return occupied


def _cells(xy: FloatArray, cell: float) -> IntArray:
    return np.floor(xy / cell).astype(np.int64)


def inside_of(edges: FloatArray, *, width: int, height: int) -> BoolArray:
    """Cells whose middle lies inside closed rings, given as edges (n, 2, 2) in cells: even-odd rule."""
    x, y = edges[:, 0].T - 0.5
    along_x, along_y = (edges[:, 1] - edges[:, 0]).T
    low, high = np.ceil(np.minimum(y, y + along_y)), np.ceil(np.maximum(y, y + along_y))
    edge, step = _counted((high - low).astype(np.int64))
    row = low[edge] + step
    crossing = x[edge] + (row - y[edge]) / along_y[edge] * along_x[edge]
    turns = np.zeros((height, width), dtype=np.uint8)
    np.bitwise_xor.at(turns, (row.astype(np.int64), np.ceil(crossing).astype(np.int64)), 1)
    return np.bitwise_xor.accumulate(turns, axis=1).astype(bool)


def _counted(numbers: IntArray) -> tuple[IntArray, IntArray]:
    """For each k, `numbers[k]` times k; and the count 0, 1, 2 … within each."""
    which = np.repeat(np.arange(len(numbers)), numbers)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(numbers) - numbers, numbers)


def crossed_by(edges: FloatArray) -> IntArray:
    """Column and row of every cell that edges (n, 2, 2), in cells, run through; some more than once.

    An edge is cut where it crosses a border between cells; each piece lies in the cell of its middle.
    """
    every = np.arange(len(edges))
    cuts = [(every, np.zeros(len(edges))), (every, np.ones(len(edges)))]
    cuts += [_border_cuts(edges[:, :, axis]) for axis in range(2)]
    edge, fraction = (np.concatenate(column) for column in zip(*cuts, strict=True))
    order = np.lexsort((fraction, edge))
    edge, fraction = edge[order], fraction[order]
    same = np.flatnonzero(np.diff(edge) == 0)
    edge, middle = edge[same], (fraction[same] + fraction[same + 1]) / 2
    start, end = edges[edge, 0], edges[edge, 1]
    return _cells(start + middle[:, None] * (end - start), 1.0)


def _border_cuts(along: FloatArray) -> tuple[IntArray, FloatArray]:
    """Crossings of edges (n, 2), given by one coordinate, with whole numbers: edge and fraction of it."""
    low, high = np.floor(along.min(axis=1)), np.floor(along.max(axis=1))
    edge, step = _counted((high - low).astype(np.int64))
    start, end = along[edge].T
    return edge, (low[edge] + 1 + step - start) / (end - start)
