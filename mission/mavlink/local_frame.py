"""Transform between an autopilot's local metres, north and east of its origin, and the site's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stopgo.mission.document import Point
from stopgo.mission.frames.geodesy import Geodetic, bearing_deg, from_geodetic, heading_of
from stopgo.mission.frames.transform import SiteOrigin, Transform
from stopgo.mission.run.events import Pose

SAME_M = 0.05
"""Largest distance of two equal origins: each is written in steps of a centimetre."""
FAR_DEG = 0.01
"""Beyond this (a kilometre) two origins belong to different sites, and no distance is computed."""


@dataclass(frozen=True)
class VehicleOrigin:
    """Origin of a vehicle's local metres, degrees and metres above the sea."""

    lat: float
    lon: float
    alt: float

    @property
    def place(self) -> Geodetic:
        return Geodetic(lat=self.lat, lon=self.lon)


@dataclass(frozen=True)
class LocalFrame:
    """Position of an autopilot's origin in the site, and bearing of the site's +y axis."""

    site: SiteOrigin
    origin: Point = (0.0, 0.0)

    def pose(self, north: float, east: float, yaw: float) -> Pose:
        """Return the pose in the site of a position and a yaw (radians clockwise from north)."""
        x, y = self._from_east.point((east, north))
        return Pose(x=x, y=y, heading=heading_of(self.site, math.degrees(yaw)))

    def north_east(self, point: Point) -> Point:
        """Return a point of the site as metres north and east of the autopilot's origin."""
        east, north = self._from_east.back(point)
        return north, east

    @property
    def _from_east(self) -> Transform:
        x, y = self.origin
        return Transform(x=x, y=y, heading=self.site.from_east.heading)

    def yaw(self, heading: float) -> float:
        """Return a heading of the site as radians clockwise from north, within ±π."""
        return math.remainder(math.radians(bearing_deg(self.site, heading)), math.tau)


UNPLACED = LocalFrame(SiteOrigin(lat=0.0, lon=0.0, alt=0.0, heading_deg=0.0))
"""Without a mission: x is east, y is north of the autopilot's origin."""


def local_frame(site: SiteOrigin, origin: VehicleOrigin, rule: str) -> LocalFrame:
    """Return the autopilot's frame in the site's; the origins must be near one another (`apart`)."""
    return LocalFrame(site, from_geodetic(site, origin.place, rule))


def apart(site: SiteOrigin, origin: VehicleOrigin) -> str:
    """Return why an autopilot with this `origin` cannot drive in `site`; empty if it can."""
    away = origin_distance(site, origin.place)
    return away and (
        f"the autopilot's origin ({origin.lat:.7f}, {origin.lon:.7f}) is {away} from the mission's"
        f" ({site.lat:.7f}, {site.lon:.7f}); set the same one (most take one per boot), or plan with that"
    )


def origin_distance(site: SiteOrigin, origin: Geodetic) -> str:
    """Return the distance of an autopilot's origin from the site's, as "0.08 m"; empty if equal."""
    if is_other_site(site, origin):
        return "more than a kilometre"
    metres = math.hypot(*from_geodetic(site, origin))
    return "" if metres <= SAME_M else f"{metres:.2f} m"


def is_other_site(site: SiteOrigin, origin: Geodetic) -> bool:
    """Return True if an autopilot's origin belongs to another site."""
    d_lat, d_lon = origin.lat - site.lat, math.remainder(origin.lon - site.lon, 360.0)
    return max(abs(d_lat), abs(d_lon)) > FAR_DEG
