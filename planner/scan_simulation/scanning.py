"""Stop + solids -> its scan: points on every cell of the targets, and a thinned cloud for registration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.casting import Met, RayFan, SolidScene, distances
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor
from stopgo.planner.scan_simulation.strips import CELL_M, Strips

CLOUD_DEG = 0.4
"""Between the rays that are kept as a cloud, where their points lie dense enough."""
SPARSE_M = 0.03
"""Where points of these rays lie farther apart on a surface, far or flatly seen, all rays are kept."""


@dataclass(frozen=True, eq=False)
class ScannerPose:
    """Where a scanner stands, in metres from the solids' origin."""

    place: FloatArray
    """(3,)."""
    heading: float
    open_door: int = NONE
    """The closed door in whose doorway it stands: it keeps it open."""
    number: int = 0


@dataclass(frozen=True, eq=False)
class ScanCount:
    """What a scan met."""

    cell: IntArray
    """Cells with points, ascending."""
    points: IntArray
    """How many there are on each."""
    columns: IntArray
    """On how many upright lines they lie; 0 on undersides."""
    away: FloatArray
    """From the scanner to the middle of each, metres."""
    incidence: FloatArray
    """Between the ray and the perpendicular at each, radians."""
    cloud: FloatArray
    """Some of all points, from the scanner, with noise (n, 3)."""


def scanned(solids: ExtrudedFloor, strips: Strips, stand: ScannerPose, simulation: Simulation) -> ScanCount:
    """One scan, block by block; the same seed gives the same noise."""
    random = np.random.default_rng([simulation.seed, stand.number])
    scene = SolidScene(solids, stand.place, see_through=False, open_door=stand.open_door)
    more = (
        SolidScene(solids, stand.place, see_through=True, open_door=stand.open_door)
        if solids.passed.any()
        else None
    )
    counting = _Counting(solids, strips, stand.place, simulation)
    turn = RayFan.of(simulation, stand.heading)
    every = max(1, round(CLOUD_DEG / simulation.step_deg))
    cloud = []
    for block in turn.blocks():
        ways = turn.ways(block)
        met = scene.cast(ways)
        counting.take(met, turn, block, ways)
        if more is not None:
            beyond = more.cast(ways)
            counting.take(np.where(_passed(solids, beyond), beyond, NONE), turn, block, ways)
        kept = _kept(solids, stand.place, met, ways, -block.start % every, every)
        cloud.append(_points(solids, stand.place, met[kept], ways[kept], simulation, random))
    cell = np.flatnonzero(counting.points)
    return ScanCount(
        cell=frozen(cell, np.int64),
        points=frozen(counting.points[cell], np.int64),
        columns=frozen(counting.columns[cell], np.int64),
        away=frozen(np.linalg.norm(strips.middle[cell] - stand.place, axis=1)),
        incidence=frozen(_incidence(strips, cell, stand.place)),
        cloud=frozen(np.concatenate(cloud)),
    )


def _passed(solids: ExtrudedFloor, met: Met) -> Met:
    return np.append(solids.passed, False)[met]


def _kept(
    solids: ExtrudedFloor, place: FloatArray, met: Met, ways: FloatArray, first: int, every: int
) -> BoolArray:
    """Which rays (columns, rows) the cloud keeps: few where these lie dense, all where they do not.

    `first` is the first column of which some are kept in any case.
    """
    few, towards = met[first::every, ::every], ways[first::every, ::every]
    hit = few != NONE
    far = distances(solids, place, few[hit], towards[hit])
    slope = np.abs(np.einsum("ij,ij->i", towards[hit], solids.normal[few[hit]]))
    sparse = np.zeros(few.shape, dtype=bool)
    sparse[hit] = far * math.radians(CLOUD_DEG) > SPARSE_M * slope
    kept: BoolArray = np.zeros(met.shape, dtype=bool)
    if len(few):
        columns, rows = (np.arange(count) for count in met.shape)
        kept[:] = sparse[np.maximum(columns - first, 0) // every][:, rows // every]
        kept[first::every, ::every] = True
    return kept


def _points(
    solids: ExtrudedFloor,
    place: FloatArray,
    met: IntArray,
    ways: FloatArray,
    simulation: Simulation,
    random: np.random.Generator,
) -> FloatArray:
    """Where rays end, as measured, from the scanner (n, 3)."""
    hit = met != NONE
    far = distances(solids, place, met[hit], ways[hit])
    near = _within(far, ways[hit], simulation.joining_m, slant=simulation.slant)
    far = far[near] + random.normal(0.0, simulation.noise_m, int(near.sum()))
    found: FloatArray = far[:, None] * ways[hit][near]
    return found


def _within(far: FloatArray, ways: FloatArray, reach: float, *, slant: bool) -> BoolArray:
    """Whether what lies so far along each way (n, 3) is within range."""
    level = 1.0 if slant else np.hypot(ways[:, 0], ways[:, 1])
    found: BoolArray = far * level <= reach
    return found


def _incidence(strips: Strips, cell: IntArray, place: FloatArray) -> FloatArray:
    way = strips.middle[cell] - place
    cosine = np.abs(np.einsum("ij,ij->i", way, strips.normal[cell])) / np.linalg.norm(way, axis=1)
    found: FloatArray = np.arccos(np.clip(cosine, 0.0, 1.0))
    return found


class _Counting:
    """Points on each cell, as blocks come.

    On an upright face the rays of one column lie on one upright line: what holds for the column is worked
    out once, and how many rays fall on a cell follows from the elevations of its edges.
    """

    def __init__(
        self, solids: ExtrudedFloor, strips: Strips, place: FloatArray, simulation: Simulation
    ) -> None:
        self._solids, self._strips, self._place = solids, strips, place
        self._simulation, self._reach = simulation, simulation.range_m
        self._face = np.append(solids.face, NONE)
        self._under = np.append(solids.under, NONE)
        way = solids.b - solids.a
        self._length = np.hypot(*way.T)
        self._way = way / self._length[:, None]
        self.points = np.zeros(strips.cells, np.int64)
        self.columns = np.zeros(strips.cells, np.int64)

    def take(self, met: Met, turn: RayFan, block: slice, ways: FloatArray) -> None:
        self._take_upright(self._face[met], turn, turn.azimuth[block])
        if len(self._strips.patch):
            self._take_under(met, ways)

    def _take_upright(self, face: IntArray, turn: RayFan, azimuth: FloatArray) -> None:
        column, begin, end, face = _runs(face)
        towards = np.column_stack([np.cos(azimuth), np.sin(azimuth)])[column]
        along, to = self._way[face], self._solids.a[face] - self._place[:2]
        with np.errstate(divide="ignore", invalid="ignore"):
            away = _cross(to, along) / _cross(towards, along)
        at = np.einsum("ij,ij->i", away[:, None] * towards - to, along)
        unit = self._unit(face, at, np.where(_cross(along, -to) > 0, 0, 1))
        good = (unit != NONE) & (away >= self._simulation.near_m) & (away <= self._reach)
        column, begin, end, away, unit = (item[good] for item in (column, begin, end, away, unit))
        if self._simulation.slant:
            steepest = np.arccos(np.clip(away / self._reach, 0.0, 1.0))
            begin = np.maximum(begin, np.searchsorted(turn.elevation, -steepest))
            end = np.minimum(end, np.searchsorted(turn.elevation, steepest, side="right"))
        self._count(unit, away, begin, end, turn.elevation)

    def _unit(self, face: IntArray, at: FloatArray, side: IntArray) -> IntArray:
        """Unit at a length along a face, on one of its sides."""
        first = self._strips.first_piece
        pieces = first[face + 1] - first[face]
        at = np.where(np.isfinite(at), at, 0.0)
        piece = np.clip((at * pieces / self._length[face]).astype(np.int64), 0, pieces - 1)
        return np.asarray(self._strips.piece_unit[first[face] + piece, side])

    def _count(
        self, unit: IntArray, away: FloatArray, begin: IntArray, end: IntArray, elevation: FloatArray
    ) -> None:
        """Rays from row `begin` to before `end` that fall on each cell of a unit's strip."""
        strips = self._strips
        rows = np.diff(strips.first_cell)[unit] - strips.under[unit]
        edge = strips.low[unit] - self._place[2]
        before = np.searchsorted(elevation, np.arctan2(edge, away))
        for row in range(strips.most):
            edge = edge + CELL_M
            last = row == rows - 1
            after = np.where(last, len(elevation), np.searchsorted(elevation, np.arctan2(edge, away)))
            many = np.maximum(np.minimum(after, end) - np.maximum(before, begin), 0)
            kept = (row < rows) & (many > 0)
            np.add.at(self.points, strips.first_cell[unit[kept]] + row, many[kept])
            np.add.at(self.columns, strips.first_cell[unit[kept]] + row, 1)
            before = after

    def _take_under(self, met: Met, ways: FloatArray) -> None:
        hit = self._under[met] != NONE
        towards = ways[hit]
        far = distances(self._solids, self._place, met[hit], towards)
        unit = self._strips.under_at(self._place[:2] + far[:, None] * towards[:, :2])
        good = (unit != NONE) & _within(far, towards, self._reach, slant=self._simulation.slant)
        np.add.at(self.points, self._strips.first_cell[unit[good] + 1] - 1, 1)


def _runs(face: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Rays of one column that meet the same face column, first row, row after the last."""
    columns, rows = face.shape
    begins = np.ones((columns, rows), dtype=bool)
    begins[:, 1:] = face[:, 1:] != face[:, :-1]
    start = np.flatnonzero(begins)
    behind = np.append(start[1:], face.size)
    met = face.ravel()[start]
    kept = met != NONE
    start, behind, met = start[kept], behind[kept], met[kept]
    column = start // rows
    return column, start - column * rows, behind - column * rows, met


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    found: FloatArray = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return found


def stand_of(stop: Stop, *, origin: FloatArray, height: float, number: int) -> ScannerPose:
    """A stop as the stand of a scanner."""
    return ScannerPose(frozen([stop.x - origin[0], stop.y - origin[1], height]), stop.heading, number=number)
