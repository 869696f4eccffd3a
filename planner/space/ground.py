"""Floor -> ground: the drivable surface, the obstacles, and the area where the robot's centre may drive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.planner.geometry.ring_index import RingIndex
from stopgo.planner.geometry.shapes import (
    GRID,
    GROWTH,
    HAIRLINE,
    QUARTER,
    SLACK,
    local_origin,
    polygon_parts,
    segments_of,
    snapped,
    to_shape,
    union,
    widened,
)
from stopgo.planner.geometry.side_work import SideWork
from stopgo.planner.space.gaps import Walls, crossings_through, tight_gaps
from stopgo.planner.space.opening_joins import Crossing, barrier, crossings_of, threshold
from stopgo.planner.space.targets import solid_of


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor in the local frame: the drivable surface and the obstacles."""

    floor: FloorPlan
    origin: FloatArray
    outline: BaseGeometry
    """The floor layer and the floor under inner openings."""
    solids: list[BaseGeometry]
    """Each obstacle by itself, in the floor's order."""
    obstacles: BaseGeometry
    obstacle_rings: RingIndex
    crossings: tuple[Crossing, ...]
    barriers: FloatArray
    """Openings not driven through (k, 2, 2)."""

    @classmethod
    def of(cls, floor: FloorPlan, settings: Settings, *, forked: bool = False) -> Ground:
        origin = local_origin(floor)
        solids = [solid_of(item, origin, HAIRLINE) for item in floor.elements if item.obstacle]
        obstacles = union(solids)  # not snapped: clearances are decided on it
        rings = RingIndex(obstacles)
        crossings = crossings_of(floor, rings, settings, forked=forked)
        inner = [threshold(item) for item in crossings if not item.closed_because]
        slab = to_shape(floor.outline, origin)
        holes = [shapely.Polygon(ring) for part in polygon_parts(slab) for ring in part.interiors]
        outline = union([slab, *inner]).difference(shapely.union_all(holes))
        if outline.area <= 0:
            raise InputError(f"{floor.name}: the floor has no area; check layer FLOOR")
        lines = [barrier(item, origin, rings) for item in crossings if item.closed_because]
        barriers = np.array(lines).reshape(-1, 2, 2)
        return cls(floor, origin, outline, solids, obstacles, rings, crossings, barriers)

    def walls(self, settings: Settings) -> Walls:
        """Everything that a robot's centre keeps clear of: obstacles, barriers, and floor edges."""
        solid = np.concatenate([segments_of(self.obstacles), self.barriers])
        edges = segments_of(self.outline)
        clearance = np.repeat([settings.radius, settings.edge], [len(solid), len(edges)])
        return Walls(np.concatenate([solid, edges]), clearance)

    def stop_walls(self, settings: Settings) -> Walls:
        """Everything that a stop keeps clear of: elements, and the edges of the floor layer."""
        solid = segments_of(self.obstacles)
        edges = segments_of(to_shape(self.floor.outline, self.origin))
        keep = max(settings.d_sec, settings.radius)
        clearance = np.repeat([keep, settings.edge], [len(solid), len(edges)])
        return Walls(np.concatenate([solid, edges]), clearance)


def drivable(ground: Ground, settings: Settings, *, forked: bool = False) -> tuple[BaseGeometry, FloatArray]:
    """Return the drive area of the robot's centre, and the exact crossings of gaps just wide enough.

    If `forked`, another process looks for the gaps.
    """
    walls = ground.walls(settings)
    with SideWork(partial(tight_gaps, walls), forked=forked) as gaps:
        area = snapped(_clear_of(walls, ground))
        if not _keeps_clearances(area, walls):
            area = snapped(_clear_of(walls, ground, grid_size=GRID))
        area = shapely.MultiPolygon([part for part in polygon_parts(area) if part.area > GRID])
        if area.is_empty:
            return area, np.empty((0, 2, 2))
        return area, crossings_through(gaps.result(), walls, area, ground.outline)


def _clear_of(walls: Walls, ground: Ground, *, grid_size: float | None = None) -> BaseGeometry:
    """The ground that keeps every wall's clearance, drawn a little too small: polygons enclose the arcs.

    Every point inside keeps its clearance. A point that is missing keeps at most 2 % more than that.
    """
    solid = walls.clearance > 0
    reach = walls.clearance[solid] * GROWTH + 2 * GRID
    near = widened(walls.shapes()[solid], reach, quad_segs=QUARTER, grid_size=grid_size)
    return ground.outline.difference(ground.obstacles, grid_size=grid_size).difference(
        near, grid_size=grid_size
    )


def _keeps_clearances(area: BaseGeometry, walls: Walls) -> bool:
    """True if an area keeps every clearance; without a grid, GEOS sometimes loses what is subtracted."""
    shapely.prepare(area)
    return not shapely.dwithin(area, walls.shapes(), walls.clearance - SLACK).any()
