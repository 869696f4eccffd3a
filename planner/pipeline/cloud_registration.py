"""Registration of clouds to the floor: the shift and turn by which a cloud would lie on it."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from stopgo.mission.geometry import FloatArray

SAMPLE = 2_000
"""Number of points that are examined of each cloud."""
LEAST_POINTS = 50
"""Fewer points of a cloud show nothing."""
FARTHEST_M, STEP_M = 0.5, 0.1
"""Range and step of the shifts that are tried, in x and y."""
LARGEST_TURN, TURN_STEP = math.radians(5.0), math.radians(0.5)
"""Range and step of the turns that are tried, with the best shift."""
BETTER = 1.2
"""A shift counts if it puts this many times as many points on drawn elements."""
LEAST_ON_FLOOR = 0.3
"""Fraction of a cloud's points on drawn elements, below which it is not registered to the floor."""


def misplaced_m(points: FloatArray, units: cKDTree, tolerance_m: float) -> float | None:
    """Return how far a cloud (n, 2) lies off the floor, metres: 0 if it lies on it, NaN if nothing helps.

    That is its shift, and the length by which a turn moves most of it. None means that it has too few points.
    """
    if len(points) < LEAST_POINTS:
        return None
    sample = points[:: max(1, len(points) // SAMPLE)]
    steps = np.arange(-FARTHEST_M, FARTHEST_M + STEP_M / 2, STEP_M)
    shifts = np.array([(0.0, 0.0), *product(steps, steps)])
    near = [_on_floor(sample + shift, units, tolerance_m) for shift in shifts]
    best = int(np.argmax(near))
    off_m = float(np.hypot(*shifts[best]))
    turn, gain = _turn(sample + shifts[best], units, tolerance_m / 2)
    if near[best] >= LEAST_ON_FLOOR and gain > BETTER:
        return off_m + abs(turn) * float(np.median(np.hypot(*(sample - sample.mean(axis=0)).T)))
    if near[best] > BETTER * near[0] and near[best] >= LEAST_ON_FLOOR:
        return off_m
    return 0.0 if near[0] >= LEAST_ON_FLOOR else float("nan")


def _turn(points: FloatArray, units: cKDTree, tolerance_m: float) -> tuple[float, float]:
    """Return the turn about their middle that puts most points (n, 2) on units, and how many times more."""
    middle, found = points.mean(axis=0), [(0.0, _on_floor(points, units, tolerance_m))]
    for turn in np.arange(-LARGEST_TURN, LARGEST_TURN + TURN_STEP / 2, TURN_STEP).tolist():
        cos, sin = math.cos(turn), math.sin(turn)
        moved = (points - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle
        found.append((turn, _on_floor(moved, units, tolerance_m)))
    turn, most = max(found, key=lambda item: item[1])
    return turn, most / max(found[0][1], 1e-9)


def _on_floor(points: FloatArray, units: cKDTree, tolerance_m: float) -> float:
    """Return the fraction of points that lie on a unit."""
    distance, _ = units.query(points, distance_upper_bound=tolerance_m)
    return float(np.isfinite(distance).mean())
