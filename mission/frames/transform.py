"""Frames of a site as mission.json holds them: its transform to a map, and its origin on the Earth.

Metres, radians counter-clockwise from +x; keys that end in `_deg` are degrees.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from stopgo.mission.geometry import FloatArray

Point = tuple[float, float]


class Transform(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Transform from one frame to another, such as site to map: rotate by `heading`, then shift by (x, y).

    A pose is one, too: from the robot's own frame to the frame that it is in.
    """

    x: float
    y: float
    heading: float

    @classmethod
    def bringing(cls, point: Point, onto: Point, heading: float) -> Transform:
        """Return the transform that rotates by `heading` and brings `point` onto another."""
        x, y = cls(x=0.0, y=0.0, heading=heading).point(point)
        return cls(x=onto[0] - x, y=onto[1] - y, heading=heading)

    def point(self, point: Point) -> Point:
        """Return the position in the other frame."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return (self.x + cos * point[0] - sin * point[1], self.y + sin * point[0] + cos * point[1])

    def back(self, point: Point) -> Point:
        """Return the position before the transform: the inverse of `point`."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        x, y = point[0] - self.x, point[1] - self.y
        return (cos * x + sin * y, cos * y - sin * x)

    def points(self, xy: FloatArray) -> FloatArray:
        """Return points (n, 2) in the other frame."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return xy @ ((cos, sin), (-sin, cos)) + (self.x, self.y)

    def after(self, first: Transform) -> Transform:
        """Return the transform that does `first`, then this one; for a pose, the pose in the other frame."""
        x, y = self.point((first.x, first.y))
        return Transform(x=x, y=y, heading=math.remainder(self.heading + first.heading, math.tau))

    @property
    def inverse(self) -> Transform:
        x, y = self.back((0.0, 0.0))
        return Transform(x=x, y=y, heading=-self.heading)


SAME = Transform(x=0.0, y=0.0, heading=0.0)


class SiteOrigin(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """WGS84 position of the frame's origin; heading is the bearing of +y clockwise from true north."""

    lat: float
    lon: float
    alt: float
    heading_deg: float

    @property
    def from_east(self) -> Transform:
        """Transform to the frame from metres east and north of its origin."""
        return Transform(x=0.0, y=0.0, heading=math.radians(self.heading_deg))
