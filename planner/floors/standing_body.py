"""A body of a building model in the robot's height, against which finished plans are checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray

_ASIDE = (1.7e-6, 2.9e-6)


@dataclass(frozen=True, eq=False)
class StandingBody:
    """Faces of a body in plan, and its triangles."""

    name: str
    """Class, GlobalId and name."""
    faces: tuple[shapely.Geometry, ...]
    """Parts of its faces in the robot's height, in plan."""
    triangles: FloatArray
    """(n, 3, 3), metres."""
    height: float
    """Height in the middle of the robot, metres."""

    @cached_property
    def _box(self) -> tuple[float, float, float, float]:
        """Least and greatest x and y of the body, metres: x0, y0, x1, y1."""
        low, high = self.triangles[..., :2].min(axis=(0, 1)), self.triangles[..., :2].max(axis=(0, 1))
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def encloses(self, x: float, y: float) -> bool:
        """True if the point at the robot's middle lies in the body: a ray upwards leaves it.

        The ray is moved by micrometres, so that it meets no edge of two triangles: it would count neither.
        """
        at = (x + _ASIDE[0], y + _ASIDE[1], self.height)
        if not len(self.triangles):
            return False
        x0, y0, x1, y1 = self._box
        if not (x0 <= at[0] <= x1 and y0 <= at[1] <= y1):
            return False
        a, b, c = (self.triangles[:, corner] - at for corner in range(3))
        ab, bc, ca = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((a, b), (b, c), (c, a)))
        met = ((ab > 0) & (bc > 0) & (ca > 0)) | ((ab < 0) & (bc < 0) & (ca < 0))
        area = np.where(met, ab + bc + ca, 1.0)
        z = (bc * a[:, 2] + ca * b[:, 2] + ab * c[:, 2]) / area
        return bool((met & (z > 0)).sum() % 2)
