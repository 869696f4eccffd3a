"""Plausibility of a plan: missing walls, legs over lines that were not read, little floor reached."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.mission.stages import NavigableSpace, Route
from stopgo.mission.stages.figures import LEG_OVER_IGNORED
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.ring_index import RingIndex, areas_within
from stopgo.planner.geometry.shapes import (
    HAIRLINE,
    first_corner,
    local_origin,
    one_shape,
    polygon_parts,
    to_shape,
    union,
)
from stopgo.planner.space.ignored_lines import over_ignored
from stopgo.planner.space.local_shapes import ground_of, room_shapes
from stopgo.planner.space.targets import solid_of

AT_WALL = 0.35
"""A room's outline this close (m) to an element has a wall there."""
LESS = 0.9
"""Fraction of this distance that is within it for certain, however roughly its curves are drawn."""
WALLED = 0.3
"""Fraction of a room's outline with walls, below which walls are missing …"""
MANY = 0.5
"""… which is grave if it applies to this fraction of the rooms."""
STRAY = 10.0
"""Elements farther than this (m) from the floor do not belong to it."""
LEAST_OFF = 0.05
"""Area of a room outside the floor that is more than rounding, m²."""
LITTLE = 0.5
"""Fraction of the floor; a plan that reaches less is doubtful."""
OPEN_END = (1e-3, 0.3)
"""Ends of walls drawn as lines that stop this far (m) from another wall leave a gap."""
NEAR_LEG = 0.15
"""A finding this close (m) to the driven strip concerns the drive."""


def floor_doubts(space: NavigableSpace, *, reached_m2: float) -> tuple[Finding, ...]:
    """Return the doubts about a plan that no stop and no leg changes."""
    return (
        *_little_reached(space, reached_m2),
        *_missing_walls(space),
        *_stray_elements(space.floor),
        *_wall_gaps(space),
        *_raster_visibility(space),
    )


def leg_doubts(route: Route) -> tuple[Finding, ...]:
    """Return the doubts about the legs of a route."""
    space = route.space
    return tuple(
        over_ignored(space.floor, legs_of(route), stops=len(route.approaches), radius=space.settings.radius)
    )


def near_legs(findings: Sequence[Finding], route: Route) -> set[int]:
    """Indices in `findings` of those on the strip that the robot drives over, or close to it."""
    space = route.space
    origin, legs = local_origin(space.floor), shapely.union_all(legs_of(route))
    reach = space.settings.radius + NEAR_LEG
    near = set()
    for k, item in enumerate(findings):
        is_near = item.at is not None and legs.distance(shapely.Point(np.array(item.at) - origin)) <= reach
        if is_near or item.code == LEG_OVER_IGNORED:
            near.add(k)
    return near


def legs_of(route: Route) -> tuple[BaseGeometry, ...]:
    """Every leg in the local frame, the return leg last."""
    origin = local_origin(route.floor)
    legs = route.approaches if route.return_leg is None else (*route.approaches, route.return_leg)
    lines = (leg - origin for leg in legs)
    return tuple(shapely.LineString(line) if len(line) > 1 else shapely.Point(line[0]) for line in lines)


@instance_cached
def floor_of_rooms(space: NavigableSpace) -> tuple[float, ...]:
    """Area in m² of each room's floor: an outline also over a void or beyond the slab counts less."""
    whole = room_shapes(space)
    inside = areas_within(np.array(whole, dtype=object), ground_of(space)).tolist()
    pairs = zip(whole, inside, strict=True)
    return tuple(on if shape.area - on > LEAST_OFF else shape.area for shape, on in pairs)


def _little_reached(space: NavigableSpace, reached_m2: float) -> Iterator[Finding]:
    whole = sum(floor_of_rooms(space))
    if reached_m2 < LITTLE * whole:
        yield Finding(
            "little_reached",
            f"the plan reaches {reached_m2:.1f} m² of {whole:.1f} m² of floor; "
            "see `unreached` for the reasons",
        )


def _raster_visibility(space: NavigableSpace) -> Iterator[Finding]:
    if space.settings.visibility != "exact":
        yield Finding(
            "raster_visibility",
            f"visibility and coverage are counted on a raster, by --visibility {space.settings.visibility};"
            " check --floor counts line by line and may refute them: plan with --visibility exact",
        )


def _missing_walls(space: NavigableSpace) -> Iterator[Finding]:
    """Rooms almost without walls around them; they have no targets and no occluders.

    Shapes on unknown layers do not count: they do not occlude.
    """
    rooms = [room for room in space.rooms if room.room is not None]
    outlines = shapely.boundary(room_shapes(space))
    bare = [k for k, room in enumerate(space.rooms) if room.room is not None and outlines[k].length]
    for near_walls in _near_walls(space):
        index = RingIndex(near_walls)
        bare = [k for k in bare if _is_bare(outlines[k], index)]
        if not bare:
            return
    names = ", ".join(space.rooms[k].name for k in bare[:5]) + (" …" if len(bare) > 5 else "")
    code = "walls_missing" if len(bare) >= MANY * len(rooms) else "room_without_walls"
    yield Finding(
        code,
        f"{len(bare)} of {len(rooms)} rooms have walls along less than {100 * WALLED:.0f} % "
        f"of their outline: {names}{_not_read(space.floor)}",
    )


def _near_walls(space: NavigableSpace) -> Iterator[BaseGeometry]:
    """The surroundings of what blocks the laser, a little too small, and then those of all known elements.

    The union of all elements takes long, and most rooms have walls by the first.
    """
    origin = local_origin(space.floor)
    if space.settings.doors == "open":
        solids = shapely.GeometryCollection([one_shape(solid, origin) for solid in space.occluders])
        yield shapely.MultiPolygon(polygon_parts(solids)).buffer(LESS * AT_WALL, quad_segs=2)
    known = [
        item for item in space.floor.elements if item.kind != "other" and (item.obstacle or item.occludes)
    ]
    yield union([solid_of(item, origin, HAIRLINE) for item in known]).buffer(AT_WALL, quad_segs=2)


def _is_bare(outline: BaseGeometry, near_walls: RingIndex) -> bool:
    """True if too little of a room's outline is near walls."""
    near = outline.intersection(near_walls.around(outline.bounds))
    return bool(near.length < WALLED * outline.length)


def _not_read(floor: FloorPlan) -> str:
    """Layers that may hold what is missing."""
    layers = sorted({line.layer for line in floor.ignored})
    unknown = [
        item.message.removeprefix("layer ").partition(" is not one of")[0]
        for item in floor.findings
        if item.code == "unknown_layer"
    ]
    names = sorted({*layers, *unknown})
    if not names:
        return "; is the layer WALLS complete?"
    return f"; layers that are not read: {', '.join(names[:8])} ({layer_option(names[0], 'walls')})"


def _stray_elements(floor: FloorPlan) -> Iterator[Finding]:
    """Elements far from the floor: another drawing in the same file, or a slip."""
    origin = local_origin(floor)
    outline = to_shape(floor.outline, origin)
    for item in floor.elements:
        shape = solid_of(item, origin, HAIRLINE)
        away = 0.0 if shape.is_empty else float(shape.distance(outline))
        if away > STRAY:
            message = f"{item.id} lies {away:.0f} m from the floor; is it part of this storey?"
            yield Finding("stray_element", message, item.id, first_corner(shape, origin))


def _wall_gaps(space: NavigableSpace) -> Iterator[Finding]:
    """Ends of walls drawn as lines that stop short of another wall: the laser looks through there."""
    origin = local_origin(space.floor)
    items = [item for item in space.floor.elements if item.occludes]
    if not any(item.lines for item in items):
        return
    solids = np.array([solid_of(item, origin, HAIRLINE) for item in items], dtype=object)
    tree = shapely.STRtree(solids)
    openings = [shapely.LineString(item.opening.line - origin) for item in space.openings]
    for k, item in enumerate(items):
        for end in (point for line in item.lines for point in (line[0], line[-1])):
            other, width = _nearest_other(tree, solids, k, shapely.Point(end - origin))
            if other is None or not OPEN_END[0] < width <= OPEN_END[1] or _in_opening(end - origin, openings):
                continue
            message = (
                f"{item.id} ends {100 * width:.1f} cm from {items[other].id} "
                f"at ({end[0]:.2f}, {end[1]:.2f}): the laser looks through the gap"
            )
            yield Finding("wall_gap", message, item.id, (float(end[0]), float(end[1])))


def _nearest_other(
    tree: shapely.STRtree, solids: NDArray[np.object_], own: int, point: BaseGeometry
) -> tuple[int | None, float]:
    near = [k for k in tree.query(point, predicate="dwithin", distance=OPEN_END[1]).tolist() if k != own]
    if not near:
        return None, np.inf
    distances = shapely.distance(solids[near], point)
    return near[int(np.argmin(distances))], float(distances.min())


def _in_opening(point: FloatArray, openings: Sequence[BaseGeometry]) -> bool:
    return any(line.distance(shapely.Point(point)) <= OPEN_END[1] for line in openings)
