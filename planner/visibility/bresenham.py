"""The paper's visibility: Bresenham's line over a binary occupancy map (paper, 3.3). For comparison.

A raster is wrong where lines of sight graze walls, and more so where the drawing is at an angle to it. So
the paper first rotates the drawing to its main axes. The default method, `exact`, needs neither.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.mission.stages import Candidates, Visibility
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import SLACK, local_origin
from stopgo.planner.visibility.bresenham_kernel import clear_lines
from stopgo.planner.visibility.raster import Raster, raster_of
from stopgo.planner.visibility.unit_ranges import visibility_of

LARGE = 10_000_000
"""Cells to walk, to units at the end of the range, from which on the interpreted kernel takes seconds."""


def bresenham(candidates: Candidates, *, aligned: bool = True) -> Visibility:
    """Units within range whose line from the candidate's cell to the unit's cell is free.

    The walk goes from the candidate to the unit. Any occupied cell on it blocks, the candidate's own
    included. The unit's own cell does not block if the unit lies on an occluder. So a wall at a flat
    angle hides behind its own other cells, as in the paper's raster.

    Parameters
    ----------
    aligned
        True: the raster lies along the main axes of the floor's outline, as in the paper. False: along
        the axes of the drawing.
    """
    raster = raster_of(candidates, aligned=aligned)
    method = "bresenham" if aligned else "bresenham, not aligned"
    return visibility_of(candidates, _seen_by_each(candidates, raster), method=method)


def _seen_by_each(candidates: Candidates, raster: Raster) -> Iterator[IntArray]:
    """Units that each kept candidate sees, ascending."""
    targets, reach = candidates.targets, candidates.settings.range
    origin = local_origin(candidates.floor)
    units, viewpoints = targets.unit_xy - origin, candidates.xy[candidates.kept] - origin
    unit_cells, own = raster.cells_of(units), targets.occluding[targets.unit_segment]
    walk = _walk(raster, steps=len(units) * len(viewpoints) * reach / raster.cell)
    for point, cell in zip(viewpoints, raster.cells_of(viewpoints), strict=True):
        near = np.flatnonzero(np.hypot(*(units - point).T) <= reach + SLACK)
        yield near[walk(cell, unit_cells[near], own[near])]


def _walk(raster: Raster, *, steps: float) -> Callable[[IntArray, IntArray, BoolArray], BoolArray]:
    """`clear_lines` over this raster."""
    width, cells = raster.occupied.shape[1], raster.occupied.ravel().view(np.uint8)
    kernel = compiled(clear_lines, large=steps > LARGE)
    mark: Callable[..., None] = kernel or clear_lines
    given: Any = cells.tobytes() if kernel is None else cells

    def walk(start: IntArray, ends: IntArray, own: BoolArray) -> BoolArray:
        clear = np.zeros(len(ends), dtype=np.uint8)
        columns: list[Any] = [np.ascontiguousarray(column) for column in (*ends.T, own.view(np.uint8))]
        if kernel is None:
            columns = [column.tolist() for column in columns]
        mark(given, width, int(start[0]), int(start[1]), *columns, clear)
        return clear.astype(bool)

    return walk
