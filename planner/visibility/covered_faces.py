"""Faces before which another solid lies: of two beams side by side the sides between them are not seen."""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.stages import Targets

BEFORE_M = (0.005, 0.04, 0.08)
"""Distances from a face at which other solids are looked for: nearer ones than the grid of rays can tell."""
UPRIGHT = 0.05
"""Vertical part of the normal of a triangle up to which it is upright."""
LEVEL_M = 1e-3
"""Surfaces this near to one another in height are at one height."""


def covered_faces(targets: Targets, triangles: FloatArray, outward: FloatArray, z: FloatArray) -> BoolArray:
    """True for heights z (n, k) at which a solid of triangles (m, 3, 3) lies right before a unit's face.

    `outward` is the direction to which the face of each unit looks (n, 2), or 0, 0 where it has two sides.
    A point is in a solid if the surface below it is an underside.
    """
    found, one_sided = np.zeros(z.shape, dtype=bool), np.flatnonzero(outward.any(axis=1))
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    flat = np.abs(normal[:, 2]) > UPRIGHT * np.linalg.norm(normal, axis=1)
    triangles, normal = triangles[flat], normal[flat]
    if not len(one_sided) or not len(triangles):
        return found
    tree = shapely.STRtree(shapely.polygons(triangles[:, :, :2]))
    for away in BEFORE_M:
        at = targets.unit_xy[one_sided] + away * outward[one_sided]
        point, face = tree.query(shapely.points(at), predicate="intersects")
        over = np.einsum("nd,nd->n", normal[face, :2], at[point] - triangles[face, 0, :2])
        level = triangles[face, 0, 2] - over / normal[face, 2]
        for k in range(z.shape[1]):
            found[one_sided, k] |= _in_solid(point, level, normal[face, 2] < 0, z[one_sided, k])
    return found


def _in_solid(point: np.ndarray, level: FloatArray, is_under: BoolArray, z: FloatArray) -> BoolArray:
    """True for points at heights z (n,) of which the surface below, at a level (m,), is an underside."""
    below = level < z[point] - LEVEL_M
    highest, highest_under = np.full(len(z), -np.inf), np.full(len(z), -np.inf)
    np.maximum.at(highest, point[below], level[below])
    np.maximum.at(highest_under, point[below & is_under], level[below & is_under])
    found: BoolArray = np.isfinite(highest_under) & (highest_under >= highest - LEVEL_M)
    return found
