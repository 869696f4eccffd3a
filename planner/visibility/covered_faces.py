"""Faces before which another solid lies: of two beams side by side the sides between them are not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.stages import Targets

LEVEL_M = 1e-3
"""Surfaces this near to one another in height are at one height."""


def covered_faces(
    targets: Targets, lying: FloatArray, outward: FloatArray, z: FloatArray, *, before_m: Sequence[float]
) -> BoolArray:
    """True for heights z (n, k) at which a solid lies at one of the distances `before_m` from a unit's face.

    `lying` are the triangles of all solids that are not upright (m, 3, 3). `outward` is the direction to
    which the face of each unit looks (n, 2), or 0, 0 where it has two sides. A point is in a solid if the
    surface below it is an underside.
    """
    found, one_sided = np.zeros(z.shape, dtype=bool), np.flatnonzero(outward.any(axis=1))
    normal = np.cross(lying[:, 1] - lying[:, 0], lying[:, 2] - lying[:, 0])
    lying, normal = lying[normal[:, 2] != 0], normal[normal[:, 2] != 0]
    if not len(one_sided) or not len(lying):
        return found
    tree = shapely.STRtree(shapely.polygons(lying[:, :, :2]))
    for away in before_m:
        at = targets.unit_xy[one_sided] + away * outward[one_sided]
        point, face = tree.query(shapely.points(at), predicate="intersects")
        over = np.einsum("nd,nd->n", normal[face, :2], at[point] - lying[face, 0, :2])
        level = lying[face, 0, 2] - over / normal[face, 2]
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
