"""Stop + solids of a model -> scan: rays at the model's own triangles, furniture and ceilings included."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.casting import RayFan
from stopgo.planner.scan_simulation.scanning import (
    CLOUD_DEG,
    ScanCount,
    ScannerPose,
    incidence,
    is_sparse,
    spread,
)
from stopgo.planner.scan_simulation.strips import CELL_M, Strips

ON_SURFACE_M = 0.02
"""A hit this far before or behind a cell's plane, along its normal, is on the cell."""
GRAZING = 1e-3
"""Cosine of the incidence at which a ray shows nothing of a surface."""
PROBE_M = 0.05
"""Distance from which a cell's surface is looked for."""
UPRIGHT = 0.05
"""Height of an upright surface's normal, at most: up to 3° from upright."""
NONE = -1


class ModelScene:
    """The triangles of a model in Embree, in metres from the floor's origin."""

    def __init__(self, solids: ModelSolids, origin: FloatArray) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners = solids.triangles - (*origin, 0.0)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(across, axis=1)
        kept = size > 1e-9
        self._a, self._normal = corners[kept, 0], across[kept] / size[kept, None]
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.ascontiguousarray(corners[kept], dtype=np.float32))

    def away(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Distance to the first triangle along each ray (n,); infinite where there is none."""
        return self._away(self._met(origins, directions), origins, directions)

    def _met(self, origins: FloatArray, directions: FloatArray) -> IntArray:
        """First triangle along each ray (n,), else NONE."""
        met: IntArray = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
        )
        return met

    def _away(self, met: IntArray, origins: FloatArray, directions: FloatArray) -> FloatArray:
        found = np.full(len(directions), np.inf)
        hit = met != NONE
        normal, a = self._normal[met[hit]], self._a[met[hit]]
        offset = np.einsum("ij,ij->i", normal, a - origins[hit])
        slope = np.einsum("ij,ij->i", normal, directions[hit])
        found[hit] = offset / np.where(slope == 0, np.nan, slope)
        return np.nan_to_num(found, nan=np.inf)

    def measured(self, position: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance to the first triangle along each ray from a position, and cosine of the incidence (n,).

        Both are infinite and 1 where there is no triangle.
        """
        origins = np.broadcast_to(position, directions.shape)
        met = self._met(origins, directions)
        slope = np.abs(np.einsum("ij,ij->i", self._normal[met], directions))
        return self._away(met, origins, directions), np.where(met == NONE, 1.0, slope)

    def reached(self, position: FloatArray, towards: FloatArray, normal: FloatArray) -> BoolArray:
        """True for points (n, 3), from a position, at which a ray meets their surfaces of these normals."""
        far = np.linalg.norm(towards, axis=1)
        directions = towards / np.maximum(far, 1e-9)[:, None]
        away = self.away(np.broadcast_to(position, directions.shape), directions)
        cosine = np.abs(np.einsum("ij,ij->i", directions, normal))
        found: BoolArray = (np.abs(away - far) * cosine <= ON_SURFACE_M) & (cosine > GRAZING)
        return found

    def existing(self, strips: Strips) -> BoolArray:
        """True for cells that have a surface in the model (cells,): no opening of the wall is there."""
        found = np.zeros(strips.cells, dtype=bool)
        for side in (1.0, -1.0):
            away = self.away(strips.middle + side * PROBE_M * strips.normal, -side * strips.normal)
            found |= np.abs(away - PROBE_M) <= ON_SURFACE_M
        return found

    def normals(self, points: FloatArray, outward: FloatArray) -> FloatArray:
        """Normals (n, 3) of the surfaces at points, looked for from both sides; 0 where there is none.

        Where an upright and a sloping surface meet, the upright one counts.
        """
        found = np.zeros(points.shape)
        for side in (1.0, -1.0):
            origins, directions = points + side * PROBE_M * outward, -side * outward
            met = self._met(origins, directions)
            on = np.abs(self._away(met, origins, directions) - PROBE_M) <= ON_SURFACE_M
            better = on & (~found.any(axis=1) | (np.abs(self._normal[met, 2]) < np.abs(found[:, 2])))
            found[better] = self._normal[met[better]]
        return found


def sloped(strips: Strips, scene: ModelScene, height: float) -> tuple[Strips, BoolArray]:
    """The strips with those of sloping surfaces laid on them, and True for the units of these (units,).

    A plan draws a sloping wall or a roof as its section at this height. An upright strip meets the
    surface there alone; laid on the slope it is what the scanner sees of that unit.
    """
    first = strips.first_cell[:-1]
    level = np.clip(height, strips.low, strips.low + strips.tall)
    at = np.column_stack([strips.middle[first, :2], level])
    normal = scene.normals(at, strips.normal[first])
    across = np.einsum("ij,ij->i", normal, strips.normal[first])
    slope = (np.abs(normal[:, 2]) > UPRIGHT) & (np.abs(across) > UPRIGHT) & ~strips.under
    unit = strips.unit_of_cell
    own = slope[unit]
    above = strips.middle[own, 2] - level[unit[own]]
    aside = -above * normal[unit[own], 2] / across[unit[own]]
    middle, normals = strips.middle.copy(), strips.normal.copy()
    middle[own] += aside[:, None] * strips.normal[own]
    normals[own] = normal[unit[own]]
    return replace(strips, middle=frozen(middle), normal=frozen(normals)), slope


def scanned_model(scene: ModelScene, strips: Strips, pose: ScannerPose, simulation: Simulation) -> ScanCount:
    """Simulate one scan: a ray to the centre of every cell in range, and a thinned cloud.

    A cell so narrow, or seen so flat, that it falls between two columns of rays has no points.
    """
    towards = strips.middle - pose.position
    far = np.linalg.norm(towards, axis=1)
    directions = towards / np.maximum(far, 1e-9)[:, None]
    cosine = np.abs(np.einsum("ij,ij->i", directions, strips.normal))
    cell = np.flatnonzero(in_reach(towards, pose, simulation) & (cosine > GRAZING))
    on = scene.reached(pose.position, towards[cell], strips.normal[cell])
    width = _widths(strips, cell)
    columns = _columns_on(towards[cell], strips.normal[cell], width, pose, simulation)
    on &= columns > 0
    cell, columns = cell[on], columns[on]
    spacing = far[cell] * math.radians(simulation.step_deg)
    return ScanCount(
        cell=frozen(cell, np.int64),
        points=frozen(np.maximum(1, strips.area[cell] * cosine[cell] / spacing**2), np.int64),
        columns=frozen(columns, np.int64),
        away=frozen(far[cell]),
        incidence=frozen(np.arccos(np.clip(cosine[cell], 0.0, 1.0))),
        in_plan=frozen(incidence(towards[cell, :2], strips.normal[cell, :2])),
        cloud=frozen(_cloud(scene, pose, simulation)),
    )


def _widths(strips: Strips, cell: IntArray) -> FloatArray:
    """Widths of cells along the floor (n,): those of their units, whose first cells are as high as any."""
    unit = strips.units_of(cell)
    width: FloatArray = strips.area[strips.first_cell[unit]] / np.minimum(strips.tall[unit], CELL_M)
    return width


def _columns_on(
    towards: FloatArray, normal: FloatArray, width: FloatArray, pose: ScannerPose, simulation: Simulation
) -> IntArray:
    """Number of the scan's columns of rays that meet each cell (n,); for undersides, 1."""
    level = np.hypot(normal[:, 0], normal[:, 1])
    along = np.column_stack([-normal[:, 1], normal[:, 0]]) / np.maximum(level, 1e-9)[:, None]
    fan = RayFan.of(simulation, pose.heading)
    step = math.radians(simulation.step_deg)
    middle = np.arctan2(towards[:, 1], towards[:, 0])
    passed = []
    for side in (-0.5, 0.5):
        end = towards[:, :2] + side * width[:, None] * along
        turned = np.arctan2(end[:, 1], end[:, 0]) - middle
        turned = np.remainder(turned + np.pi, 2 * np.pi) - np.pi
        at = np.remainder(middle - fan.azimuth[0], 2 * np.pi) + turned
        passed.append(np.floor(at / step))
    count = np.abs(passed[1] - passed[0]).astype(np.int64)
    return np.where(level > UPRIGHT, count, 1)


def in_reach(towards: FloatArray, pose: ScannerPose, simulation: Simulation) -> BoolArray:
    """True for cells in the scanner's range, field of view and above its blind cone."""
    level = np.hypot(towards[:, 0], towards[:, 1])
    reach = np.linalg.norm(towards, axis=1) if simulation.slant else level
    aside = np.arctan2(towards[:, 1], towards[:, 0]) - pose.heading
    turned = np.abs(np.remainder(aside + np.pi, 2 * np.pi) - np.pi)
    steepest = math.radians(90 - simulation.cone_deg / 2)
    good: BoolArray = (reach <= simulation.range_m) & (level >= simulation.near_m)
    good &= turned <= math.radians(simulation.fov_deg) / 2 + 1e-9
    good &= np.arctan2(towards[:, 2], np.maximum(level, 1e-9)) >= -steepest
    return good


def _cloud(scene: ModelScene, pose: ScannerPose, simulation: Simulation) -> FloatArray:
    """Measured ends of rays, relative to the scanner (n, 3): few where points are dense enough, else all."""
    random = np.random.default_rng([simulation.seed, pose.number])
    fan = RayFan.of(simulation, pose.heading)
    every = max(1, round(CLOUD_DEG / simulation.step_deg))
    found = []
    for block in fan.blocks():
        directions = fan.directions(block)
        first = -block.start % every
        few = directions[first::every, ::every]
        far, slope = scene.measured(pose.position, few.reshape(-1, 3))
        kept = spread(is_sparse(far, slope).reshape(few.shape[:2]), directions.shape[:2], first, every)
        towards = directions[kept]
        away, _ = scene.measured(pose.position, towards)
        level = 1.0 if simulation.slant else np.hypot(towards[:, 0], towards[:, 1])
        near = (away > 0) & (away * level <= simulation.joining_m)
        measured = away[near] + random.normal(0.0, simulation.noise_m, int(near.sum()))
        found.append(measured[:, None] * towards[near])
    return np.concatenate(found)
