"""Stop + solids -> scan: points on every cell of the targets, and a thinned cloud for registration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.casting import Hits, RayFan, RayRuns, SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor
from stopgo.planner.scan_simulation.ray_runs import ranges
from stopgo.planner.scan_simulation.strips import CELL_M, Strips

CLOUD_DEG = 0.4
"""Angle between the rays kept in the cloud, where their points are dense enough."""
SPARSE_M = 0.03
"""Point spacing above which all rays are kept: on surfaces far away or at a flat angle."""


@dataclass(frozen=True, eq=False)
class ScannerPose:
    """Pose of a scanner, in metres from the solids' origin."""

    position: FloatArray
    """(3,)."""
    heading: float
    open_door: int = NONE
    """The closed door in whose doorway the scanner is, and which it keeps open; else NONE."""
    number: int = 0


@dataclass(frozen=True, eq=False)
class ScanCount:
    """Hits of one scan."""

    cell: IntArray
    """Cells with points, ascending."""
    points: IntArray
    """Number of points on each."""
    columns: IntArray
    """Number of vertical lines on which they lie; 0 on undersides."""
    away: FloatArray
    """Distance from the scanner to the centre of each, metres."""
    incidence: FloatArray
    """Angle between the ray and the surface normal at each, radians."""
    in_plan: FloatArray
    """The same angle between their directions in the plan, as a plan's limit has it; 0 on undersides."""
    cloud: FloatArray
    """Some of the points, relative to the scanner, with noise (n, 3)."""


def scene_at(solids: ExtrudedFloor, pose: ScannerPose, *, see_through: bool = False) -> SolidScene:
    """The solids around a scanner; `see_through` ones too if asked for."""
    return SolidScene(solids, pose.position, see_through=see_through, open_door=pose.open_door)


def scanned(scene: SolidScene, strips: Strips, pose: ScannerPose, simulation: Simulation) -> ScanCount:
    """Simulate one scan, block by block; the same seed gives the same noise."""
    random, solids = np.random.default_rng([simulation.seed, pose.number]), scene.solids
    more = scene_at(solids, pose, see_through=True) if solids.passed.any() else None
    counts = _CellCounts(strips, scene, simulation)
    fan = RayFan.of(simulation, pose.heading)
    every = max(1, round(CLOUD_DEG / simulation.step_deg))
    cloud = []
    for block in fan.blocks():
        runs = scene.runs(fan, block)
        counts.take(runs)
        if more is not None:
            beyond = more.runs(fan, block)
            counts.take(beyond._replace(met=np.where(_passed(solids, beyond.met), beyond.met, NONE)))
        cloud.append(_cloud(scene, runs, every, simulation, random))
    cell = np.flatnonzero(counts.hit)
    towards = strips.middle[cell] - pose.position
    return ScanCount(
        cell=frozen(cell, np.int64),
        points=frozen(counts.points[cell], np.int64),
        columns=frozen(counts.columns[cell], np.int64),
        away=frozen(np.linalg.norm(towards, axis=1)),
        incidence=frozen(incidence(towards, strips.normal[cell])),
        in_plan=frozen(incidence(towards[:, :2], strips.normal[cell, :2])),
        cloud=frozen(np.concatenate(cloud)),
    )


def _passed(solids: ExtrudedFloor, met: Hits) -> Hits:
    return np.append(solids.passed, False)[met]


def _cloud(
    scene: SolidScene,
    runs: RayRuns,
    every: int,
    simulation: Simulation,
    random: np.random.Generator,
) -> FloatArray:
    """Measured ends of a block's rays, relative to the scanner (n, 3): few where dense enough, else all."""
    met, first = runs.hits, -runs.block.start % every
    few = met.reshape(runs.shape)[first::every, ::every]
    sparse, hit = np.zeros(few.shape, dtype=bool), few != NONE
    column, row = (every * part for part in np.nonzero(hit))
    towards, few_met = runs.towards((column + first) * runs.shape[1] + row), few[hit]
    far = scene.distances(few_met, towards)
    sparse[hit] = is_sparse(far, np.abs(np.einsum("ij,ij->i", towards, scene.solids.normal[few_met])))
    kept = np.flatnonzero(spread(sparse, runs.shape, first, every).ravel() & (met != NONE))
    towards = runs.towards(kept)
    far = scene.distances(met[kept], towards)
    if not far.max(initial=0.0) * (1 + 1e-9) < simulation.joining_m:  # along the floor it is no farther
        near = _within(far, towards, simulation.joining_m, slant=simulation.slant)
        far, towards = far[near], towards[near]
    far += random.normal(0.0, simulation.noise_m, len(far))
    found: FloatArray = far[:, None] * towards
    return found


def is_sparse(far: FloatArray, slope: FloatArray) -> BoolArray:
    """True where points of a thinned cloud are too far apart, by distance and cosine of incidence (n,)."""
    found: BoolArray = np.isfinite(far) & (far * math.radians(CLOUD_DEG) > SPARSE_M * slope)
    return found


def spread(sparse: BoolArray, shape: tuple[int, ...], first: int, every: int) -> BoolArray:
    """Rays (columns, rows) that are kept: all around those that are `sparse`, else one of `every`."""
    kept: BoolArray = np.zeros(shape, dtype=bool)
    if len(sparse):
        columns, rows = (np.arange(count) for count in shape)
        kept[:] = sparse[np.maximum(columns - first, 0) // every][:, rows // every]
        kept[first::every, ::every] = True
    return kept


def _within(far: FloatArray, directions: FloatArray, reach: float, *, slant: bool) -> BoolArray:
    """True for hits at these distances along the directions (n, 3) that are within range."""
    level = 1.0 if slant else np.hypot(directions[:, 0], directions[:, 1])
    found: BoolArray = far * level <= reach
    return found


def incidence(towards: FloatArray, normal: FloatArray) -> FloatArray:
    """Angle between rays and surface normals (n, 2 or 3), which may point to either side, in radians (n,)."""
    size = np.linalg.norm(towards, axis=1) * np.linalg.norm(normal, axis=1)
    cosine = np.abs(np.einsum("ij,ij->i", towards, normal)) / np.maximum(size, 1e-12)
    found: FloatArray = np.where(size > 1e-12, np.arccos(np.clip(cosine, 0.0, 1.0)), 0.0)
    return found


class _CellCounts:
    """Points on each cell, counted block by block.

    On an upright face the rays of one column lie on one vertical line. So the column's hit is computed
    once, and the number of rays on each cell follows from the elevations of the cell's edges.
    """

    def __init__(self, strips: Strips, scene: SolidScene, simulation: Simulation) -> None:
        solids = scene.solids
        self._solids, self._strips, self._scene, self._position = solids, strips, scene, scene.position
        self._simulation, self._reach = simulation, simulation.range_m
        self._face = np.append(solids.face, NONE)
        self._under = np.append(solids.under, NONE)
        along = solids.b - solids.a
        self._length = np.hypot(*along.T)
        self._along = along / self._length[:, None]
        self.points = np.zeros(strips.cells, np.int64)
        self.columns = np.zeros(strips.cells, np.int64)
        self.hit = np.zeros(strips.cells, dtype=bool)

    def take(self, runs: RayRuns) -> None:
        self._take_upright(runs, runs.fan.elevation)
        if len(self._strips.patch):
            self._take_under(runs)

    def _take_upright(self, runs: RayRuns, elevation: FloatArray) -> None:
        column, begin, end, face = _on_faces(runs, self._face[runs.met])
        azimuth = runs.fan.azimuth[runs.block]
        towards = np.column_stack([np.cos(azimuth), np.sin(azimuth)])[column]
        along, to = self._along[face], self._solids.a[face] - self._position[:2]
        with np.errstate(divide="ignore", invalid="ignore"):
            away = _cross(to, along) / _cross(towards, along)
        at = np.einsum("ij,ij->i", away[:, None] * towards - to, along)
        unit = self._unit(face, at, np.where(_cross(along, -to) > 0, 0, 1))
        good = (unit != NONE) & (away >= self._simulation.near_m) & (away <= self._reach)
        column, begin, end, away, unit = (item[good] for item in (column, begin, end, away, unit))
        if self._simulation.slant:
            steepest = np.arccos(np.clip(away / self._reach, 0.0, 1.0))
            begin = np.maximum(begin, np.searchsorted(elevation, -steepest))
            end = np.minimum(end, np.searchsorted(elevation, steepest, side="right"))
        self._count(unit, away, begin, end, elevation)

    def _unit(self, face: IntArray, at: FloatArray, side: IntArray) -> IntArray:
        """Unit at a distance along a face, on one of its sides."""
        first = self._strips.first_piece
        pieces = first[face + 1] - first[face]
        at = np.where(np.isfinite(at), at, 0.0)
        piece = np.clip((at * pieces / self._length[face]).astype(np.int64), 0, pieces - 1)
        return np.asarray(self._strips.piece_unit[first[face] + piece, side])

    def _count(
        self, unit: IntArray, away: FloatArray, begin: IntArray, end: IntArray, elevation: FloatArray
    ) -> None:
        """Count the rays from row `begin` to before `end` on each cell of a unit's strip."""
        strips = self._strips
        rows = np.diff(strips.first_cell)[unit] - strips.under[unit]
        edge = strips.low[unit] - self._position[2]
        before = np.searchsorted(elevation, np.arctan2(edge, away))
        for row in range(strips.most):
            edge = edge + CELL_M
            last = row == rows - 1
            after = np.where(last, len(elevation), np.searchsorted(elevation, np.arctan2(edge, away)))
            many = np.maximum(np.minimum(after, end) - np.maximum(before, begin), 0)
            kept = (row < rows) & (many > 0)
            cell = strips.first_cell[unit[kept]] + row
            np.add.at(self.points, cell, many[kept])
            np.add.at(self.columns, cell, 1)
            self.hit[cell] = True
            before = after

    def _take_under(self, runs: RayRuns) -> None:
        under = np.flatnonzero(self._under[runs.met] != NONE)
        of, ray = ranges(runs.start[under], np.append(runs.start, runs.rays)[under + 1])
        towards = runs.towards(ray)
        far = self._scene.distances(runs.met[under[of]], towards)
        unit = self._strips.under_at(self._position[:2] + far[:, None] * towards[:, :2])
        good = (unit != NONE) & _within(far, towards, self._reach, slant=self._simulation.slant)
        cell = self._strips.first_cell[unit[good] + 1] - 1
        np.add.at(self.points, cell, 1)
        self.hit[cell] = True


def _on_faces(runs: RayRuns, face: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Rays of one column on the same upright face: column, first row, row after the last, face."""
    rows = runs.shape[1]
    begins = runs.start % rows == 0
    begins[1:] |= face[1:] != face[:-1]
    start, met = runs.start[begins], face[begins]
    behind = np.append(start[1:], runs.rays)
    kept = met != NONE
    start, behind, met = start[kept], behind[kept], met[kept]
    column = start // rows
    return column, start - column * rows, behind - column * rows, met


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    found: FloatArray = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return found


def pose_of(stop: Stop, *, origin: FloatArray, height: float, number: int) -> ScannerPose:
    """The scanner's pose at a stop."""
    return ScannerPose(frozen([stop.x - origin[0], stop.y - origin[1], height]), stop.heading, number=number)
