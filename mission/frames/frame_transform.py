"""Transform of points from the site to a robot's map, and back: rotated, then shifted."""

from __future__ import annotations

import math

from stopgo.mission.frames.transform import Point, Transform

SAME = Transform(x=0.0, y=0.0, heading=0.0)


def to_map_point(to_map: Transform, point: Point) -> Point:
    """Return the position on the map of a point of the site."""
    cos, sin = math.cos(to_map.heading), math.sin(to_map.heading)
    return (to_map.x + cos * point[0] - sin * point[1], to_map.y + sin * point[0] + cos * point[1])


def from_map_point(to_map: Transform, point: Point) -> Point:
    """Return the position in the site of a point of the map: the inverse of `to_map_point`."""
    cos, sin = math.cos(to_map.heading), math.sin(to_map.heading)
    x, y = point[0] - to_map.x, point[1] - to_map.y
    return (cos * x + sin * y, cos * y - sin * x)
