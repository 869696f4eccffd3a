"""Triangles of a model that stop the laser on one floor: also ceilings, lintels and furniture."""

from __future__ import annotations

import numpy as np

from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import frozen
from stopgo.planner.floors.ifc.class_kinds import IGNORED
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model

PASSED = ("doors", "windows", "spaces", "openings", IGNORED)
"""Roles that the laser passes: leaves stand open, and glass hides nothing, as in the plan."""
BELOW = 0.2
"""Solids down to this far below the floor count, metres."""


def laser_solids(level: Level, model: Model) -> ModelSolids:
    """Return the triangles between a floor and the next one, in metres above the floor."""
    roles = sorted({item.role for item in model.described.products}.difference(PASSED))
    ceiling = level.ceiling - level.z
    kept = []
    for product, mesh in model.of_role(*roles):
        if product.transparent or mesh.z[0] > level.ceiling or mesh.z[1] < level.z - BELOW:
            continue
        heights = mesh.triangles[..., 2]
        near = (heights.max(axis=1) >= level.z - BELOW) & (heights.min(axis=1) <= level.ceiling)
        kept.append(mesh.triangles[near])
    found = np.concatenate(kept) if kept else np.empty((0, 3, 3))
    return ModelSolids(frozen(found - (0.0, 0.0, level.z)), ceiling)
