"""Shapes of a navigable space in its local frame, each made once: ground, obstacles, drive area and rooms."""

from __future__ import annotations

from shapely.geometry.base import BaseGeometry

from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.space.connected_parts import Parts, parts_of


@instance_cached
def ground_of(space: NavigableSpace) -> BaseGeometry:
    """The floor layer and the floor under inner openings."""
    return to_shape(space.ground, local_origin(space.floor))


@instance_cached
def obstacles_of(space: NavigableSpace) -> BaseGeometry:
    """Everything from which a robot must keep its distance."""
    return to_shape(space.obstacles, local_origin(space.floor))


@instance_cached
def drive_area_of(space: NavigableSpace) -> BaseGeometry:
    """Area in which the robot's centre may drive."""
    return to_shape(space.drive_area, local_origin(space.floor))


@instance_cached
def drive_parts_of(space: NavigableSpace) -> Parts:
    """Connected parts of the drive area."""
    return parts_of(drive_area_of(space), space.gaps - local_origin(space.floor))


@instance_cached
def room_shapes(space: NavigableSpace) -> list[BaseGeometry]:
    """The area of each room, empty where it has none (rooms,)."""
    origin = local_origin(space.floor)
    return [to_shape(room.area, origin) for room in space.rooms]
