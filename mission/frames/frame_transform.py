"""Points of the site on a robot's map, and back: turned, then shifted."""

from __future__ import annotations

import math

from stopgo.mission.frames.transform import Point, Transform

SAME = Transform(x=0.0, y=0.0, heading=0.0)


def turned(to_map: Transform, point: Point) -> Point:
    """A point of the site on the map."""
    cos, sin = math.cos(to_map.heading), math.sin(to_map.heading)
    return (to_map.x + cos * point[0] - sin * point[1], to_map.y + sin * point[0] + cos * point[1])


def turned_back(to_map: Transform, point: Point) -> Point:
    """A point of the map on the site: the inverse of `turned`."""
    cos, sin = math.cos(to_map.heading), math.sin(to_map.heading)
    x, y = point[0] - to_map.x, point[1] - to_map.y
    return (cos * x + sin * y, cos * y - sin * x)
