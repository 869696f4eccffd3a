"""Floor -> navigable space: where stops may be, where the robot may drive, and what is to be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from mission.errors import AnswerIsNo, InputError
from mission.floor import Finding, FloorPlan
from mission.geometry import FloatArray, frozen
from mission.planning import NavigableSpace, OpeningState, RoomSpace
from mission.settings import Settings
from planner.connected import Parts, parts_of
from planner.gaps import Walls, crossings_through, gaps_between, tight_gaps
from planner.openings import Crossing, barrier, crossings_of, middle_and_normal, part_near, threshold
from planner.shapes import (
    GRID,
    HAIRLINE,
    SLACK,
    grown,
    local_origin,
    polygon_parts,
    segments_of,
    snapped,
    to_polygons,
    to_shape,
    union,
)
from planner.targets import LINE_WALL, occluders_of, solid_of, targets_of

LEAST_UNNAMED = 0.5
"""Floor outside every room smaller than this (m²) is a threshold or a niche, not a room."""
NEAR_OPENING = 1.6
"""How far from an opening (m) the obstacle that blocks it is looked for."""
REACHED_SHARE = 0.2
"""An opening leads into a room if it reaches this share of where the robot may drive there …"""
REACHED_AREA = 0.5
"""… or at least this much of it (m²)."""


def navigable(floor: FloorPlan, settings: Settings) -> NavigableSpace:
    """Everything later stages need to know about the floor, for this robot and these clearances."""
    floor = floor if settings.targets is None else floor.with_targets(settings.targets)
    origin = local_origin(floor)
    ground = Ground.of(floor, settings)
    drive_area, gaps = drivable(ground, settings)
    states, findings = opening_states(ground, drive_area, gaps, settings)
    closed = np.array([line for c in ground.crossings if (line := _shut(c, settings, ground)) is not None])
    occluders = occluders_of(floor, closed)
    targets = targets_of(floor, occluders, d_dis=settings.d_dis)
    if targets.total == 0:
        raise AnswerIsNo(f"{floor.name}: no target on the floor; elements: {_kinds(floor)} (see --targets)")
    return NavigableSpace(
        floor=floor,
        settings=settings,
        rooms=room_spaces(floor, ground, drive_area, settings),
        openings=states,
        obstacles=to_polygons(ground.obstacles, origin),
        occluders=to_polygons(occluders, origin),
        barriers=frozen(ground.barriers + origin),
        drive_area=to_polygons(drive_area, origin),
        gaps=frozen(gaps + origin),
        targets=targets,
        ground=to_polygons(ground.outline, origin),
        findings=(*floor.findings, *findings),
    )


def _kinds(floor: FloorPlan) -> str:
    return ", ".join(sorted({item.kind for item in floor.elements})) or "none"


def _shut(crossing: Crossing, settings: Settings, ground: Ground) -> FloatArray | None:
    """The line of a door that the laser does not pass, with `doors = closed`."""
    if settings.doors == "open" or crossing.opening.kind != "door":
        return None
    return barrier(crossing, ground.origin, ground.obstacles)


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor in the local frame: what carries the robot and what stands in its way."""

    floor: FloorPlan
    origin: FloatArray
    outline: BaseGeometry
    """The floor layer and the floor under inner openings."""
    obstacles: BaseGeometry
    crossings: tuple[Crossing, ...]
    barriers: FloatArray
    """Openings not driven through (k, 2, 2)."""

    @classmethod
    def of(cls, floor: FloorPlan, settings: Settings) -> Ground:
        origin = local_origin(floor)
        solids = [solid_of(item, origin, HAIRLINE) for item in floor.elements if item.obstacle]
        obstacles = union(solids)  # not snapped: clearances are decided on it
        crossings = crossings_of(floor, obstacles, settings)
        inner = [threshold(item) for item in crossings if not item.closed_because]
        slab = to_shape(floor.outline, origin)
        holes = [shapely.Polygon(ring) for part in polygon_parts(slab) for ring in part.interiors]
        outline = union([slab, *inner]).difference(shapely.union_all(holes))
        if outline.area <= 0:
            raise InputError(f"{floor.name}: the floor has no area; check layer FLOOR")
        lines = [barrier(item, origin, obstacles) for item in crossings if item.closed_because]
        return cls(floor, origin, outline, obstacles, crossings, np.array(lines).reshape(-1, 2, 2))

    def walls(self, settings: Settings) -> Walls:
        """Everything a robot's centre keeps a distance from: obstacles, barriers, and floor edges."""
        solid = np.concatenate([segments_of(self.obstacles), self.barriers])
        edges = segments_of(self.outline)
        clearance = np.repeat([settings.radius, settings.edge], [len(solid), len(edges)])
        return Walls(np.concatenate([solid, edges]), clearance)


def drivable(ground: Ground, settings: Settings) -> tuple[BaseGeometry, FloatArray]:
    """Where the robot's centre may drive, and the exact crossings of gaps just wide enough."""
    blocked = grown(ground.obstacles, settings.radius)
    barriers = shapely.union_all([grown(shapely.LineString(b), settings.radius) for b in ground.barriers])
    edges = grown(shapely.multilinestrings(list(segments_of(ground.outline))), settings.edge)
    inner = ground.outline.difference(edges) if settings.edge > 0 else ground.outline
    area = snapped(inner.difference(shapely.union_all([blocked, barriers])))
    area = shapely.MultiPolygon([part for part in polygon_parts(area) if part.area > GRID])
    walls = ground.walls(settings)
    return area, crossings_through(tight_gaps(walls), walls, area, ground.outline)


def opening_states(
    ground: Ground, drive_area: BaseGeometry, gaps: FloatArray, settings: Settings
) -> tuple[tuple[OpeningState, ...], tuple[Finding, ...]]:
    """What each opening is to the robot, and a finding for each inner one it cannot pass."""
    parts = parts_of(drive_area, gaps)

    @cache
    def free_in(room: int) -> dict[int, float]:
        return parts.area_by_part(to_shape(ground.floor.rooms[room].polygons, ground.origin))

    states, findings = [], []
    for crossing in ground.crossings:
        why = crossing.closed_because or _not_reached(crossing, parts, free_in, ground, settings)
        states.append(OpeningState(crossing.opening, crossing.rooms, crossing.width, not why, why))
        if why and not why.startswith("exterior"):
            findings.append(_opening_finding(crossing, why, ground))
    return tuple(states), tuple(findings)


def _opening_finding(crossing: Crossing, why: str, ground: Ground) -> Finding:
    x, y = crossing.opening.line.mean(axis=0)
    names = " and ".join("outside" if k is None else ground.floor.rooms[k].label for k in crossing.rooms)
    message = f"{crossing.opening.kind} {crossing.opening.id} between {names} is not passable: {why}"
    code = "narrow_opening" if crossing.closed_because else "blocked_opening"
    return Finding(code, message, crossing.opening.id, (float(x), float(y)))


def _not_reached(
    crossing: Crossing,
    parts: Parts,
    free_in: Callable[[int], dict[int, float]],
    ground: Ground,
    settings: Settings,
) -> str:
    """Why the robot does not get from the opening into both rooms; empty if it does."""
    here = parts.touching(crossing.clear)
    wanted = {side: _main_parts(free_in(side)) for side in crossing.rooms if side is not None}
    if here and all(here & main or not main for main in wanted.values()):
        return ""
    return _narrowest(crossing, parts, wanted, ground, settings)


def _main_parts(free: dict[int, float]) -> set[int]:
    """Parts that make up a good share of where the robot may drive in a room."""
    enough = min(REACHED_AREA, REACHED_SHARE * sum(free.values()))
    return {part for part, area in free.items() if area >= enough and area > 0}


def _narrowest(
    crossing: Crossing, parts: Parts, wanted: dict[int, set[int]], ground: Ground, settings: Settings
) -> str:
    """The place near an opening that is widest among those a robot must pass, in words."""
    window = shapely.Point(middle_and_normal(crossing.clear)[0]).buffer(NEAR_OPENING)
    walls = ground.walls(settings).near(window)
    gaps = gaps_between(walls, short=-2 * float(walls.clearance.max(initial=0.0)) + 0.05, long=-SLACK)
    cells = [_cells_of(parts, main, ground, room, window) for room, main in wanted.items()]
    for gap in sorted(gaps, key=lambda item: -item.width):
        if _opens(crossing, cells, ground, window, gap.width / 2 - SLACK):
            names = " and ".join(dict.fromkeys(_owner(walls.segments[k], ground) for k in gap.walls))
            need = float(walls.clearance[list(gap.walls)].sum())
            return f"{gap.width:.3f} m between {names} near it, the robot needs {need:.3f} m"
    return f"no place for a robot of radius {settings.radius:.3f} m next to it"


def _cells_of(
    parts: Parts, main: set[int], ground: Ground, room: int, window: BaseGeometry
) -> NDArray[np.object_]:
    """Where the robot drives in a room near an opening, leaving out pockets it cannot get to."""
    shape = to_shape(ground.floor.rooms[room].polygons, ground.origin).intersection(window)
    near = parts.tree.query(shape, predicate="intersects")
    return parts.cells[near[np.isin(parts.cell_part[near], sorted(main))]]


def _opens(
    crossing: Crossing,
    cells: list[NDArray[np.object_]],
    ground: Ground,
    window: BaseGeometry,
    radius: float,
) -> bool:
    """Whether a robot of this radius gets from the opening to the cells of both rooms."""
    free = window.intersection(ground.outline).difference(
        ground.obstacles.intersection(window).buffer(radius)
    )
    here = [piece for piece in polygon_parts(free) if piece.intersects(crossing.clear)]
    return all(any(np.any(shapely.intersects(some, piece)) for piece in here) for some in cells if len(some))


def _owner(segment: FloatArray, ground: Ground) -> str:
    middle = shapely.Point(segment.mean(axis=0))
    for item in ground.floor.elements:
        if item.obstacle and solid_of(item, ground.origin, HAIRLINE).distance(middle) <= LINE_WALL:
            return item.id
    return "a closed opening" if len(ground.barriers) and _on_barrier(middle, ground) else "the floor's edge"


def _on_barrier(point: BaseGeometry, ground: Ground) -> bool:
    return bool(np.any(shapely.distance(shapely.linestrings(ground.barriers), point) <= LINE_WALL))


def room_spaces(
    floor: FloorPlan, ground: Ground, drive_area: BaseGeometry, settings: Settings
) -> tuple[RoomSpace, ...]:
    """The rooms as planned: inner rooms subtracted from outer ones, and floor outside every room."""
    shapes = [to_shape(room.polygons, ground.origin) for room in floor.rooms]
    tree = shapely.STRtree([shape.representative_point() for shape in shapes])
    planned: list[tuple[int | None, str, BaseGeometry]] = [
        (k, floor.rooms[k].label, _without_inner(shape, shapes, k, tree)) for k, shape in enumerate(shapes)
    ]
    planned.extend((None, name, shape) for name, shape in _unnamed(ground, drive_area, shapes))
    forbidden = ground.obstacles.buffer(settings.d_sec, quad_segs=16)
    inner = ground.outline.buffer(-settings.edge) if settings.edge > 0 else ground.outline
    allowed = inner.difference(forbidden)
    return tuple(
        RoomSpace(
            room=index,
            name=name,
            area=to_polygons(shape, ground.origin),
            stop_area=to_polygons(shape.intersection(part_near(allowed, shape)), ground.origin),
        )
        for index, name, shape in planned
    )


def _without_inner(
    shape: BaseGeometry, shapes: list[BaseGeometry], index: int, tree: shapely.STRtree
) -> BaseGeometry:
    """A room without the rooms that lie inside it (paper: a room in a room is subtracted)."""
    held = np.sort(tree.query(shape, predicate="intersects"))
    inner = [shapes[k] for k in held if k != index and shapes[k].area < shape.area]
    return shape.difference(shapely.union_all(inner)) if inner else shape


def _unnamed(
    ground: Ground, drive_area: BaseGeometry, rooms: list[BaseGeometry]
) -> list[tuple[str, BaseGeometry]]:
    """Floor outside every room: each part of the floor by itself where there are no rooms at all."""
    if not rooms:
        parts = sorted(polygon_parts(to_shape(ground.floor.outline, ground.origin)), key=lambda p: p.bounds)
        names = ["floor"] if len(parts) == 1 else [f"floor {k + 1}" for k in range(len(parts))]
        return list(zip(names, parts, strict=True))
    outside = ground.outline.difference(shapely.union_all(rooms).buffer(THIN, join_style="mitre"))
    parts = [p for p in polygon_parts(outside) if p.intersection(drive_area).area > LEAST_UNNAMED]
    ordered = sorted(parts, key=lambda part: part.bounds)
    return [(f"unnamed {k + 1}", part) for k, part in enumerate(ordered)]


THIN = 0.3
"""Floor this close to a room (m) belongs to a wall or a threshold."""
