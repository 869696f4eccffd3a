"""Rooms as planned: inner rooms are separate, and floor outside every room is an unnamed room."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.settings import Settings
from stopgo.mission.stages import RoomSpace
from stopgo.planner.geometry.ring_index import RingIndex, parts_within
from stopgo.planner.geometry.shapes import polygon_parts, roughly_widened, to_polygons, to_shape, union
from stopgo.planner.space.ground import Ground
from stopgo.planner.space.opening_joins import threshold

LEAST_UNNAMED = 0.5
"""Floor outside every room smaller than this (m²) is a threshold or a niche, not a room."""


def room_spaces(
    ground: Ground, drive_area: BaseGeometry, stop_area: BaseGeometry, outside: BaseGeometry
) -> tuple[RoomSpace, ...]:
    """The rooms as planned: inner rooms subtracted from outer ones, and floor `outside` every room."""
    floor, shapes = ground.floor, _room_shapes(ground)
    inside = shapely.STRtree([shape.representative_point() for shape in shapes])
    planned: list[tuple[int | None, str, BaseGeometry]] = [
        (k, floor.rooms[k].label, _without_inner(shape, shapes, k, inside)) for k, shape in enumerate(shapes)
    ]
    planned.extend((None, name, shape) for name, shape in _unnamed(ground, drive_area, outside))
    allowed = parts_within(np.array([shape for *_, shape in planned], dtype=object), stop_area)
    return tuple(
        RoomSpace(
            room=index,
            name=name,
            area=to_polygons(shape, ground.origin),
            stop_area=to_polygons(part, ground.origin),
        )
        for (index, name, shape), part in zip(planned, allowed, strict=True)
    )


def _without_inner(
    shape: BaseGeometry, shapes: list[BaseGeometry], index: int, tree: shapely.STRtree
) -> BaseGeometry:
    """A room without the rooms that lie inside it (paper: a room in a room is subtracted)."""
    nearby = np.sort(tree.query(shape, predicate="intersects"))
    inner = [shapes[k] for k in nearby if k != index and shapes[k].area < shape.area]
    return shape.difference(shapely.union_all(inner)) if inner else shape


def stop_area_of(ground: Ground, settings: Settings) -> BaseGeometry:
    """The area where stops may be, for pictures only: it is approximate.

    Obstacles are widened each by itself: the time for all together grows with the square of their number.
    """
    keep = max(settings.d_sec, settings.radius)
    edges = shapely.boundary(to_shape(ground.floor.outline, ground.origin))
    solid = [roughly_widened(part, keep) for part in polygon_parts(ground.obstacles)]
    near = (shapely.union_all(solid), roughly_widened(edges, settings.edge))
    return ground.outline.difference(near[0]).difference(near[1])


def floor_outside(ground: Ground) -> BaseGeometry:
    """Floor outside every room, up to walls and thresholds."""
    doors = [threshold(item) for item in ground.crossings if not item.clear.is_empty]
    return ground.outline.difference(union([*_room_shapes(ground), *doors])).difference(ground.obstacles)


def _room_shapes(ground: Ground) -> list[BaseGeometry]:
    return [to_shape(room.polygons, ground.origin) for room in ground.floor.rooms]


def _unnamed(
    ground: Ground, drive_area: BaseGeometry, outside: BaseGeometry
) -> list[tuple[str, BaseGeometry]]:
    """The parts of the floor outside every room; without any room, each part of the floor."""
    if not ground.floor.rooms:
        parts = sorted(polygon_parts(to_shape(ground.floor.outline, ground.origin)), key=lambda p: p.bounds)
        names = ["floor"] if len(parts) == 1 else [f"floor {k + 1}" for k in range(len(parts))]
        return list(zip(names, parts, strict=True))
    drive_rings = RingIndex(drive_area)
    parts = [p for p in polygon_parts(outside) if _is_room(p, drive_rings)]
    ordered = sorted(parts, key=lambda part: part.bounds)
    return [(f"unnamed {k + 1}", part) for k, part in enumerate(ordered)]


def _is_room(part: BaseGeometry, drive_rings: RingIndex) -> bool:
    """True if the robot can drive on enough of a part of the floor."""
    if part.area < LEAST_UNNAMED:
        return False
    return bool(part.intersection(drive_rings.around(part.bounds)).area > LEAST_UNNAMED)
