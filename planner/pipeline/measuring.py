"""Scanner points -> measured coverage of a floor's targets, and unplanned obstacles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import shapely
from scipy.ndimage import label
from scipy.spatial import cKDTree

from stopgo.mission.comparing.measured import Measured, Unplanned
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, bounds, frozen
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.coverage_totals import CoverageTotals, totals_of_plan
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.pipeline.cloud_registration import misplaced_m
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, hull_of

TOLERANCE_M = 0.05
"""A unit is measured if a point lies at most this far from its face."""
WIDEST_M = 0.3
"""Points farther from a face than this do not belong to it."""
BINS = 60
ABOVE = ("beams",)
"""Kinds of elements above the heights at which clouds are compared."""
CELL_M = 0.1
CELL_CORNERS = np.array([(0, 0), (1, 1), (0, 1), (1, 0)])
LEAST_SWEEPS = 3
"""An object hit in fewer sweeps at one position may be a person who walks by."""
LEAST_CELLS = 2
MARGIN_M = 0.05


def measured(
    planned: PlannedFloor,
    sweeps: Iterable[FloatArray],
    *,
    tolerance: float = TOLERANCE_M,
    least_sweeps: int = LEAST_SWEEPS,
    surveyed: bool = False,
) -> Measured:
    """Compare sweeps of points (n, 2) in the mission's frame with the floor, one after another.

    A point belongs to the nearest unit; its error is its distance from the face. Points far from every
    drawn element, in `least_sweeps` sweeps or more, are an unplanned obstacle. Clouds of the surveying
    scanner (`surveyed`) must lie on the floor, and need not hit what is above their heights.
    """
    counts = _SweepCounts(planned.space, tolerance)
    misplaced = []
    for points in sweeps:
        counts.add(points)
        away_m = misplaced_m(points, counts.units, tolerance) if surveyed else None
        misplaced += [] if away_m is None else [away_m]
    totals = totals_of_plan(planned.seen)
    return Measured(
        totals=_at_scan_height(totals) if surveyed else totals,
        hit=frozen(counts.hit, np.bool_),
        tolerance_m=tolerance,
        points=counts.points,
        edges_m=frozen(counts.edges),
        histogram=frozen(counts.histogram, np.int64),
        unplanned=tuple(_unplanned(counts, planned.space, least_sweeps)),
        misplaced_m=tuple(misplaced) if surveyed else None,
        part=planned.stops_see if planned.is_part else None,
    )


def _at_scan_height(totals: CoverageTotals) -> CoverageTotals:
    """Return the totals without elements that lie above head height."""
    above = np.array([item.kind in ABOVE for item in totals.elements], bool)
    return replace(totals, visible=frozen(totals.visible & ~above[totals.element], np.bool_))


class _SweepCounts:
    """Counts that grow with the sweeps; their memory depends only on the size of the floor."""

    def __init__(self, space: NavigableSpace, tolerance: float) -> None:
        targets = space.targets
        self._targets, self._tolerance = targets, tolerance
        self.units = cKDTree(targets.unit_xy)
        along = targets.b - targets.a
        self._along = along / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
        self.hit: BoolArray = np.zeros(targets.total, bool)
        self.points, self.sweeps = 0, 0
        self.edges = np.linspace(-WIDEST_M, WIDEST_M, BINS + 1)
        self.histogram: IntArray = np.zeros((len(space.floor.elements), BINS), np.int64)
        rings = [polygon.exterior for polygon in space.floor.outline]
        low_x, low_y, high_x, high_y = bounds(rings)
        self.corner = np.array([low_x, low_y])
        shape = np.ceil((np.array([high_x, high_y]) - self.corner) / CELL_M).astype(int) + 1
        self.cells: IntArray = np.zeros(shape, np.int64)
        """Number of sweeps in which each cell of the floor held points far from every target."""

    def add(self, points: FloatArray) -> None:
        points = points[np.isfinite(points).all(axis=1)]
        self.points, self.sweeps = self.points + len(points), self.sweeps + 1
        if not len(points):
            return
        distance, unit = self.units.query(
            points, distance_upper_bound=WIDEST_M + self._targets.unit_length.max()
        )
        near = np.isfinite(distance)
        self._count_near(points[near], unit[near])
        self._count_far(points[~near])

    def _count_near(self, points: FloatArray, unit: IntArray) -> None:
        segment = self._targets.unit_segment[unit]
        along, to = self._along[segment], points - self._targets.unit_xy[unit]
        off = along[:, 1] * to[:, 0] - along[:, 0] * to[:, 1]  # to the right of a -> b: outside
        past_end = np.abs((along * to).sum(axis=1)) - self._targets.unit_length[unit] / 2
        own = past_end <= self._tolerance
        self.hit[unit[own & (np.abs(off) <= self._tolerance)]] = True
        close = own & (np.abs(off) < WIDEST_M)
        bins = np.searchsorted(self.edges, off[close], side="right") - 1
        np.add.at(self.histogram, (self._targets.element[segment[close]], np.clip(bins, 0, BINS - 1)), 1)

    def _count_far(self, points: FloatArray) -> None:
        index = np.floor((points - self.corner) / CELL_M).astype(np.int64)
        inside = ((index >= 0) & (index < self.cells.shape)).all(axis=1)
        cells = np.unique(index[inside], axis=0)
        self.cells[cells[:, 0], cells[:, 1]] += 1


def _unplanned(counts: _SweepCounts, space: NavigableSpace, least: int) -> list[Unplanned]:
    """Connected groups of cells, on floor without a drawn element nearby."""
    cells = np.argwhere(counts.cells >= least)
    if not len(cells):
        return []
    origin = local_origin(space.floor)
    middles = shapely.points(counts.corner + (cells + 0.5) * CELL_M - origin)
    drawn = to_shape((*space.obstacles, *space.occluders), origin)
    free = shapely.distance(middles, drawn) > WIDEST_M
    free &= shapely.contains(to_shape(space.ground or space.floor.outline, origin), middles)
    mask = np.zeros(counts.cells.shape, bool)
    mask[tuple(cells[free].T)] = True
    groups, count = label(mask, structure=np.ones((3, 3)))
    found = []
    for number in range(1, count + 1):
        own = np.argwhere(groups == number)
        if len(own) >= LEAST_CELLS:
            corners = (
                counts.corner
                + np.concatenate([own + beside for beside in CELL_CORNERS], dtype=np.float64) * CELL_M
            )
            hits = int(counts.cells[tuple(own.T)].max())
            found.append(Unplanned(hull_of(corners, margin=MARGIN_M), hits, counts.sweeps))
    return sorted(found, key=lambda item: -item.hits)
