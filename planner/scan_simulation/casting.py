"""Scanner + solids -> what its rays meet, a block of turns at a time: no step is too fine for the memory."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor

MOST_RAYS = 1_000_000
"""Rays that are cast at a time."""
TOUCHING_M = 0.01
"""What a ray meets so shortly before a point is the point's own surface."""
Met = IntArray
"""Number of the triangle that each ray meets first, or NONE (columns, rows)."""


@dataclass(frozen=True, eq=False)
class RayFan:
    """The directions of a scan: columns turn about the vertical, rows rise."""

    azimuth: FloatArray
    """Radians counter-clockwise from +x (c,)."""
    elevation: FloatArray
    """Radians above the horizontal, ascending (r,)."""

    @classmethod
    def of(cls, simulation: Simulation, heading: float) -> RayFan:
        """All directions of a scan that looks along a heading (radians)."""
        across = round(simulation.fov_deg / simulation.step_deg)
        upwards = round((180 - simulation.cone_deg / 2) / simulation.step_deg)
        begin = heading - math.radians(simulation.fov_deg) / 2
        step = math.radians(simulation.step_deg)
        # half a step aside: walls along the axes are met, not grazed
        azimuth = begin + (np.arange(across) + 0.5) * step
        return cls(frozen(azimuth), frozen(np.pi / 2 - (np.arange(upwards)[::-1] + 0.5) * step))

    def blocks(self) -> Iterator[slice]:
        """Columns of at most MOST_RAYS rays each."""
        size = max(1, MOST_RAYS // len(self.elevation))
        for begin in range(0, len(self.azimuth), size):
            yield slice(begin, min(begin + size, len(self.azimuth)))

    def ways(self, columns: slice) -> FloatArray:
        """Unit vectors (columns, rows, 3)."""
        azimuth, level = self.azimuth[columns], np.cos(self.elevation)
        ways = np.empty((len(azimuth), len(level), 3))
        ways[:, :, 0] = np.cos(azimuth)[:, None] * level
        ways[:, :, 1] = np.sin(azimuth)[:, None] * level
        ways[:, :, 2] = np.sin(self.elevation)
        return ways


class SolidScene:
    """Solids round a scanner as Embree holds them: the scanner is at 0, where single precision is finest."""

    def __init__(
        self, solids: ExtrudedFloor, place: FloatArray, *, see_through: bool, open_door: int
    ) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        opened = (solids.door == open_door) & (solids.door != NONE)
        self._solids, self._place = solids, place
        kept = np.flatnonzero((solids.passed <= see_through) & ~opened)
        self._number = np.append(kept, NONE)
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, np.ascontiguousarray(solids.corners[kept] - place, dtype=np.float32))

    def cast(self, ways: FloatArray) -> Met:
        """What rays along `ways` (columns, rows, 3) meet."""
        flat = np.ascontiguousarray(ways.reshape(-1, 3), dtype=np.float32)
        met = self._scene.run(np.zeros_like(flat), flat)
        found: Met = self._number[met].reshape(ways.shape[:2])
        return found

    def in_sight(self, points: FloatArray) -> BoolArray:
        """Whether nothing lies before points (n, 3), that are told from the scanner."""
        far = np.linalg.norm(points, axis=1)
        ways = points / far[:, None]
        met = self.cast(ways[:, None])[:, 0]
        hit = met != NONE
        clear = np.ones(len(points), dtype=bool)
        clear[hit] = distances(self._solids, self._place, met[hit], ways[hit]) > far[hit] - TOUCHING_M
        return clear


def distances(solids: ExtrudedFloor, place: FloatArray, triangle: IntArray, ways: FloatArray) -> FloatArray:
    """How far the triangles that rays meet are along them (n,): Embree tells which, we how far, exactly."""
    offset = np.einsum("ij,ij->i", solids.normal, solids.corners[:, 0] - place)
    found: FloatArray = offset[triangle] / np.einsum("ij,ij->i", ways, solids.normal[triangle])
    return found
