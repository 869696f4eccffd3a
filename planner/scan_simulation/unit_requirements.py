"""Scan + limits of the plan -> the units that the measured points show as well as the plan requires."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document.limits import limits_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.planner.scan_simulation.scanning import ScanCount
from stopgo.planner.scan_simulation.strips import CELL_M, Strips

SLACK_DEG = 0.5
"""Tolerance of angles, which are those of a cell's centre, up to 5 cm off the unit's midpoint."""


@dataclass(frozen=True, eq=False)
class UnitRequirements:
    """Requirements on a unit's points: any point, or certain cells at a density and an angle."""

    strips: Strips
    cells: BoolArray
    """True for cells that must meet the limits (cells,); for none if any point suffices."""
    steepest: float | None
    """Largest angle from the surface normal, radians; None without a limit."""
    spacing: float | None
    """Largest distance between neighbouring points, metres; None without a limit."""
    needed: IntArray
    """Number of cells that each unit must show (units,)."""
    in_plan: bool
    """True if angles are those in the plan."""

    @classmethod
    def of(cls, settings: Settings, strips: Strips) -> UnitRequirements:
        """The requirements of a plan's limits: at one height, or from the floor to `wall_height`.

        One height is the scanner's, or any other where that is hidden; angles are those in the plan.
        Beams need only points.
        """
        limits = limits_of(settings)
        unit = strips.unit_of_cell
        none = limits.max_incidence is None and limits.spacing is None
        cells = ~strips.under[unit] & (not none)
        if settings.wall_height is not None:
            row = np.arange(strips.cells) - strips.first_cell[unit]
            cells &= strips.low[unit] + (row + 1) * CELL_M <= settings.wall_height + 1e-9
        needed = np.bincount(unit, cells, minlength=len(strips.low)).astype(np.int64)
        if settings.wall_height is None:
            needed = np.minimum(needed, 1)
        steepest = None if limits.max_incidence is None else limits.max_incidence + math.radians(SLACK_DEG)
        return cls(strips, cells, steepest, limits.spacing, needed, settings.wall_height is None)

    def shown(self, scan: ScanCount) -> BoolArray:
        """True for each unit that a scan shows as required (units,)."""
        unit = self.strips.units_of(scan.cell)
        good = self.cells[scan.cell] & self._steep(scan) & self._dense(scan, unit)
        many = np.bincount(unit, good, minlength=len(self.needed))
        any_point = np.bincount(unit, minlength=len(self.needed)) > 0
        found: BoolArray = any_point & (many >= self.needed)
        return found

    def _steep(self, scan: ScanCount) -> BoolArray | bool:
        angle = scan.in_plan if self.in_plan else scan.incidence
        return True if self.steepest is None else angle <= self.steepest

    def _dense(self, scan: ScanCount, unit: IntArray) -> BoolArray | bool:
        """True where points are dense enough in both directions; one more point may lie next to a cell."""
        if self.spacing is None:
            return True
        columns = np.maximum(scan.columns, 1)
        height = np.minimum(CELL_M, self.strips.area[scan.cell] / self._width[unit])
        across, up = self._width[unit] / (columns + 1), height / (scan.points / columns + 1)
        return np.maximum(across, up) <= self.spacing

    @property
    def _width(self) -> FloatArray:
        """Width of each unit, from the area of its first cell (units,)."""
        first = self.strips.first_cell[:-1]
        tall = np.minimum(CELL_M, self.strips.tall)
        found: FloatArray = self.strips.area[first] / tall
        return found
