"""Scanner + solids -> first hits of its rays, block by block, so that any angular step fits in memory."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor
from stopgo.planner.scan_simulation.ray_runs import SurfaceLines

MOST_RAYS = 1_000_000
"""Rays cast at a time."""
TOUCHING_M = 0.01
"""A hit this close before a point is on the point's own surface."""
Hits = IntArray
"""Number of the first triangle that each ray hits, or NONE."""


@dataclass(frozen=True, eq=False)
class RayFan:
    """The directions of a scan: columns by azimuth, rows by elevation."""

    azimuth: FloatArray
    """Radians counter-clockwise from +x (c,)."""
    elevation: FloatArray
    """Radians above the horizontal, ascending (r,)."""
    step: float
    """Radians between two neighbours."""

    @classmethod
    def of(cls, simulation: Simulation, heading: float) -> RayFan:
        """All directions of a scan that looks along a heading (radians)."""
        across = round(simulation.fov_deg / simulation.step_deg)
        upwards = round((180 - simulation.cone_deg / 2) / simulation.step_deg)
        begin = heading - math.radians(simulation.fov_deg) / 2
        step = math.radians(simulation.step_deg)
        # half a step of offset: rays hit walls along the axes instead of grazing them
        azimuth = begin + (np.arange(across) + 0.5) * step
        return cls(frozen(azimuth), frozen(np.pi / 2 - (np.arange(upwards)[::-1] + 0.5) * step), step)

    def blocks(self) -> Iterator[slice]:
        """Columns of at most MOST_RAYS rays each."""
        size = max(1, MOST_RAYS // len(self.elevation))
        for begin in range(0, len(self.azimuth), size):
            yield slice(begin, min(begin + size, len(self.azimuth)))

    def directions(self, columns: slice) -> FloatArray:
        """Unit vectors (columns, rows, 3)."""
        shape = (len(self.azimuth[columns]), len(self.elevation))
        return self.towards(columns, np.arange(shape[0] * shape[1])).reshape(*shape, 3)

    def towards(self, columns: slice, ray: IntArray) -> FloatArray:
        """Unit vectors of some rays of a block (n, 3), numbered column by column, ascending."""
        azimuth, level = self.azimuth[columns], np.cos(self.elevation)
        first = np.arange(len(azimuth) + 1) * len(level)
        column = np.repeat(np.arange(len(azimuth)), np.diff(np.searchsorted(ray, first)))
        row = ray - first[column]
        found = np.empty((len(ray), 3))
        found[:, 0] = np.cos(azimuth)[column] * level[row]
        found[:, 1] = np.sin(azimuth)[column] * level[row]
        found[:, 2] = np.sin(self.elevation)[row]
        return found


class RayRuns(NamedTuple):
    """Runs of rays of a block that meet the same triangle, in the order of the rays."""

    fan: RayFan
    block: slice
    start: IntArray
    """First ray of each (n,), numbered column by column; every column begins with one."""
    met: Hits
    """(n,)."""

    @property
    def shape(self) -> tuple[int, int]:
        """Columns and rows of the block."""
        return len(self.fan.azimuth[self.block]), len(self.fan.elevation)

    @property
    def rays(self) -> int:
        """Number of all rays."""
        return math.prod(self.shape)

    @property
    def hits(self) -> Hits:
        """The triangle that each ray meets (rays,)."""
        return np.repeat(self.met, np.diff(self.start, append=self.rays))

    def towards(self, ray: IntArray) -> FloatArray:
        """Unit vectors of some rays (n, 3)."""
        return self.fan.towards(self.block, ray)


class SolidScene:
    """Solids around a scanner in Embree, with the scanner at 0, where single precision is finest."""

    def __init__(
        self, solids: ExtrudedFloor, position: FloatArray, *, see_through: bool, open_door: int
    ) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        opened = (solids.door == open_door) & (solids.door != NONE)
        self.solids, self.position = solids, position
        self._offset = np.einsum("ij,ij->i", solids.normal, solids.corners[:, 0] - position)
        solid = np.flatnonzero((solids.passed <= see_through) & ~opened)
        faces = solid[solid < len(solids.a)]
        self._lines = _lines(solids, faces, position)
        self._number = np.append(solid, NONE)
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.ascontiguousarray(solids.corners[solid] - position, dtype=np.float32))

    def cast(self, directions: FloatArray) -> Hits:
        """First hits of rays along `directions` (columns, rows, 3)."""
        flat = np.ascontiguousarray(directions.reshape(-1, 3), dtype=np.float32)
        met = self._scene.run(np.zeros_like(flat), flat)
        found: Hits = self._number[met].reshape(directions.shape[:2])
        return found

    def runs(self, fan: RayFan, block: slice) -> RayRuns:
        """Runs of a block's rays; of each run the middle ray is cast."""
        azimuth = fan.azimuth[block]
        start = self._lines.run_starts(azimuth, fan.elevation, fan.step)
        middle = (start + np.append(start[1:], len(azimuth) * len(fan.elevation))) // 2
        return RayRuns(fan, block, start, self.cast(fan.towards(block, middle)[:, None])[:, 0])

    def distances(self, triangle: IntArray, directions: FloatArray) -> FloatArray:
        """Distance along each ray to its triangle (n,): Embree found the triangle, this is exact."""
        along = np.einsum("ij,ij->i", directions, self.solids.normal[triangle])
        found: FloatArray = self._offset[triangle] / along
        return found

    def unobstructed(self, points: FloatArray) -> BoolArray:
        """True for points (n, 3), relative to the scanner, with nothing between them and the scanner."""
        far = np.linalg.norm(points, axis=1)
        directions = points / far[:, None]
        met = self.cast(directions[:, None])[:, 0]
        hit = met != NONE
        clear = np.ones(len(points), dtype=bool)
        away = self.distances(met[hit], directions[hit])
        clear[hit] = away > far[hit] - TOUCHING_M
        return clear


def _lines(solids: ExtrudedFloor, faces: IntArray, position: FloatArray) -> SurfaceLines:
    """Some faces of solids, and all edges of their level triangles, around a position."""
    edges = solids.level_edges - position
    level = edges[:, 0, 2]
    return SurfaceLines(
        a=np.concatenate([solids.a[faces] - position[:2], edges[:, 0, :2]]),
        b=np.concatenate([solids.b[faces] - position[:2], edges[:, 1, :2]]),
        low=np.append(solids.low[faces] - position[2], level),
        high=np.append(solids.high[faces] - position[2], level),
        levels=np.unique(level),
    )
