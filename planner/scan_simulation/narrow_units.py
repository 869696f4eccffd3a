"""Stop + units between two columns of rays -> a scan with a ray at each of their cells.

A scan has points on a unit only if the unit is wider than two columns are apart, or by chance. A plan that
knows no angular step promises lines of sight, and a unit of a few millimetres is shown by the points next to
it. Such units are scanned by rays of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.scan_simulation.model_scans import in_reach
from stopgo.planner.scan_simulation.scanning import ScanCount, ScannerPose, incidence
from stopgo.planner.scan_simulation.strips import CELL_M, Strips

Reaching = Callable[[FloatArray, FloatArray], BoolArray]
"""Returns true for each point, relative to the scanner (n, 3), that its ray reaches; with normals (n, 3)."""


def aimed_scan(
    unit: IntArray, strips: Strips, pose: ScannerPose, simulation: Simulation, reaching: Reaching
) -> ScanCount:
    """Scan the cells of units (n,) with one column of rays through the middle of each unit."""
    first = strips.first_cell[unit]
    cell = ranges(first, strips.first_cell[unit + 1] - first)
    towards = strips.middle[cell] - pose.position
    kept = in_reach(towards, pose, simulation)
    cell, towards = cell[kept], towards[kept]
    kept = reaching(towards, strips.normal[cell])
    cell, towards = cell[kept], towards[kept]
    away = np.linalg.norm(towards, axis=1)
    level = np.hypot(towards[:, 0], towards[:, 1])
    rows = CELL_M * level / away**2 / math.radians(simulation.step_deg)
    return ScanCount(
        cell=frozen(cell, np.int64),
        points=frozen(np.maximum(1, rows), np.int64),
        columns=frozen(np.ones(len(cell)), np.int64),
        away=frozen(away),
        incidence=frozen(incidence(towards, strips.normal[cell])),
        in_plan=frozen(incidence(towards[:, :2], strips.normal[cell, :2])),
        cloud=frozen(np.empty((0, 3))),
    )
