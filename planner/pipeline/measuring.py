"""Points of a scanner -> what they show of a floor's targets, and of what stands there unplanned."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from scipy.ndimage import label
from scipy.spatial import cKDTree

from stopgo.mission.comparing.measured import Measured, Unplanned
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, bounds, frozen
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.coverage_totals import ledger_of
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, hull_of

TOLERANCE_M = 0.05
"""A unit is measured if a point lies as near to its face."""
WIDEST_M = 0.3
"""Points farther from a face than this are not of it."""
BINS = 60
CELL_M = 0.1
LEAST_SWEEPS = 3
"""What is hit in fewer sweeps at one place may have walked by."""
LEAST_CELLS = 2
MARGIN_M = 0.05


def measured(
    planned: PlannedFloor,
    sweeps: Iterable[FloatArray],
    *,
    tolerance: float = TOLERANCE_M,
    least_sweeps: int = LEAST_SWEEPS,
) -> Measured:
    """Lay sweeps of points (n, 2) in the mission's frame on the floor, one after another.

    A point belongs to the nearest unit; how far off it is, is its distance from the face. Where points lie
    far from everything that is drawn, in `least_sweeps` of them or more, there is something unplanned.
    """
    tally = _SeenTally(planned.space, tolerance)
    for points in sweeps:
        tally.take(points)
    return Measured(
        ledger=ledger_of(planned.seen),
        hit=frozen(tally.hit, np.bool_),
        tolerance_m=tolerance,
        points=tally.points,
        edges_m=frozen(tally.edges),
        histogram=frozen(tally.histogram, np.int64),
        unplanned=tuple(_unplanned(tally, planned.space, least_sweeps)),
    )


class _SeenTally:
    """Counts, as sweeps come; all that is kept is as large as the floor."""

    def __init__(self, space: NavigableSpace, tolerance: float) -> None:
        targets = space.targets
        self._targets, self._tolerance = targets, tolerance
        self._tree = cKDTree(targets.unit_xy)
        along = targets.b - targets.a
        self._along = along / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
        self.hit: BoolArray = np.zeros(targets.total, bool)
        self.points = 0
        self.edges = np.linspace(-WIDEST_M, WIDEST_M, BINS + 1)
        self.histogram: IntArray = np.zeros((len(space.floor.elements), BINS), np.int64)
        rings = [polygon.exterior for polygon in space.floor.outline]
        low_x, low_y, high_x, high_y = bounds(rings)
        self.corner = np.array([low_x, low_y])
        shape = np.ceil((np.array([high_x, high_y]) - self.corner) / CELL_M).astype(int) + 1
        self.cells: IntArray = np.zeros(shape, np.int64)
        """In how many sweeps each cell of the floor held points far from every target."""

    def take(self, points: FloatArray) -> None:
        points = points[np.isfinite(points).all(axis=1)]
        self.points += len(points)
        if not len(points):
            return
        away, unit = self._tree.query(points, distance_upper_bound=WIDEST_M + self._targets.unit_length.max())
        near = np.isfinite(away)
        self._near(points[near], unit[near])
        self._far(points[~near])

    def _near(self, points: FloatArray, unit: IntArray) -> None:
        segment = self._targets.unit_segment[unit]
        along, to = self._along[segment], points - self._targets.unit_xy[unit]
        off = along[:, 1] * to[:, 0] - along[:, 0] * to[:, 1]  # to the right of a -> b: outside
        beside = np.abs((along * to).sum(axis=1)) - self._targets.unit_length[unit] / 2
        own = beside <= self._tolerance
        self.hit[unit[own & (np.abs(off) <= self._tolerance)]] = True
        kept = own & (np.abs(off) < WIDEST_M)
        bins = np.searchsorted(self.edges, off[kept], side="right") - 1
        np.add.at(self.histogram, (self._targets.element[segment[kept]], np.clip(bins, 0, BINS - 1)), 1)

    def _far(self, points: FloatArray) -> None:
        index = np.floor((points - self.corner) / CELL_M).astype(np.int64)
        inside = ((index >= 0) & (index < self.cells.shape)).all(axis=1)
        cells = np.unique(index[inside], axis=0)
        self.cells[cells[:, 0], cells[:, 1]] += 1


def _unplanned(tally: _SeenTally, space: NavigableSpace, least: int) -> list[Unplanned]:
    """Groups of cells that hang together, on floor where nothing is drawn near."""
    cells = np.argwhere(tally.cells >= least)
    if not len(cells):
        return []
    origin = local_origin(space.floor)
    middles = shapely.points(tally.corner + (cells + 0.5) * CELL_M - origin)
    drawn = to_shape((*space.obstacles, *space.occluders), origin)
    free = shapely.distance(middles, drawn) > WIDEST_M
    free &= shapely.contains(to_shape(space.ground or space.floor.outline, origin), middles)
    mask = np.zeros(tally.cells.shape, bool)
    mask[tuple(cells[free].T)] = True
    groups, count = label(mask, structure=np.ones((3, 3)))
    found = []
    for number in range(1, count + 1):
        own = np.argwhere(groups == number)
        if len(own) >= LEAST_CELLS:
            corners = (
                tally.corner
                + np.concatenate([own, own + 1, own + np.array([0, 1]), own + np.array([1, 0])]) * CELL_M
            )
            hits = int(tally.cells[tuple(own.T)].max())
            found.append(Unplanned(hull_of(corners, margin=MARGIN_M), hits))
    return sorted(found, key=lambda item: -item.hits)
