"""Exact visibility: triangular expansion over open space, independent of how the drawing is turned."""

from __future__ import annotations

import numpy as np
import shapely

from mission.geometry import frozen
from mission.planning import Candidates, Visibility
from planner.mesh import Mesh, mesh_of
from planner.shapes import GRID, local_origin, snapped, to_grid, to_shape
from planner.sight import scene_of, sight

MARGIN = 1.0
"""Open space around everything, in metres."""


def exact(candidates: Candidates) -> Visibility:
    """Units within range whose midpoint is in sight; `planner.sight_kernel` has the rule for corners."""
    space, targets = candidates.space, candidates.space.targets
    origin = local_origin(space.floor)
    viewpoints = to_grid(candidates.xy[candidates.kept] - origin)
    scene = scene_of(
        open_space(candidates), targets.a - origin, targets.b - origin, targets.units, targets.occluding
    )
    runs = sight(scene, viewpoints, reach=space.settings.range)
    start = targets.first_unit[:-1][runs.segment]
    return Visibility(
        candidates=candidates,
        pointer=frozen(runs.pointer, np.int64),
        segment=frozen(runs.segment, np.int64),
        first=frozen(start + runs.low, np.int64),
        last=frozen(start + runs.high, np.int64),
        method="exact",
    )


def open_space(candidates: Candidates) -> Mesh:
    """A mesh of everything that light crosses: a frame around the floor, minus the occluders."""
    space = candidates.space
    origin = local_origin(space.floor)
    occluders = to_shape(space.occluders, origin)
    everything = np.concatenate([space.targets.a, space.targets.b, candidates.xy]) - origin
    low = np.minimum(
        everything.min(axis=0), shapely.bounds(occluders)[:2] if not occluders.is_empty else np.inf
    )
    high = np.maximum(
        everything.max(axis=0), shapely.bounds(occluders)[2:] if not occluders.is_empty else -np.inf
    )
    frame = snapped(shapely.box(*(low - MARGIN), *(high + MARGIN)))
    return mesh_of(shapely.difference(frame, occluders, grid_size=GRID))
