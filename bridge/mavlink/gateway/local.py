"""An autopilot's local metres, north and east of its origin, and the site's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bridge.mavlink.line.peer import Origin
from mission.document import Point, SiteOrigin
from mission.events import Pose
from mission.geodesy import bearing_deg, from_geodetic, heading_of
from mission.mavlink.origin import how_far_off


@dataclass(frozen=True)
class LocalFrame:
    """Where an autopilot's origin lies in the site, and which way the site's +y axis bears."""

    site: SiteOrigin
    origin: Point = (0.0, 0.0)

    def pose(self, north: float, east: float, yaw: float) -> Pose:
        """A place and a yaw (radians clockwise from north) as a pose of the site."""
        bearing = math.radians(self.site.heading_deg)
        cos, sin = math.cos(bearing), math.sin(bearing)
        return Pose(
            x=self.origin[0] + cos * east - sin * north,
            y=self.origin[1] + sin * east + cos * north,
            heading=heading_of(self.site, math.degrees(yaw)),
        )

    def north_east(self, point: Point) -> Point:
        """A point of the site as metres north and east of the autopilot's origin."""
        bearing = math.radians(self.site.heading_deg)
        cos, sin = math.cos(bearing), math.sin(bearing)
        dx, dy = point[0] - self.origin[0], point[1] - self.origin[1]
        return (-sin * dx + cos * dy, cos * dx + sin * dy)

    def yaw(self, heading: float) -> float:
        """A heading of the site as radians clockwise from north, within ±π."""
        return math.remainder(math.radians(bearing_deg(self.site, heading)), math.tau)


UNPLACED = LocalFrame(SiteOrigin(lat=0.0, lon=0.0, alt=0.0, heading_deg=0.0))
"""Without a mission: x is east, y is north of the autopilot's origin."""


def local_frame(site: SiteOrigin, origin: Origin, rule: str) -> LocalFrame:
    """The autopilot's frame in the site's; the origins must be near one another (`apart`)."""
    return LocalFrame(site, from_geodetic(site, origin.place, rule))


def apart(site: SiteOrigin, origin: Origin) -> str:
    """Why an autopilot that counts from `origin` cannot drive in `site`; empty if it can."""
    away = how_far_off(site, origin.place)
    return away and (
        f"the autopilot's origin ({origin.lat:.7f}, {origin.lon:.7f}) lies {away} from the mission's"
        f" ({site.lat:.7f}, {site.lon:.7f}); set the same one (most take one per boot), or plan with that"
    )
