"""Conversion from the site's frame to latitude and longitude, and back.

An autopilot converts latitude and longitude to metres by its own rule, not by the earth's true shape:
ArduPilot with one scale for the whole earth, PX4 on a sphere. A position that is sent to an autopilot must
be written by its rule, else the position error is up to 7 mm for every metre from the origin.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from stopgo.mission.frames.transform import Point, SiteOrigin

STEPS_PER_DEGREE = 10_000_000
"""MAVLink and GNSS write positions in steps of 1e-7 degrees."""

ARDUPILOT_M_PER_DEGREE = 0.011131884502145034 * STEPS_PER_DEGREE
PX4_RADIUS_M = 6_371_000.0
WGS84_A = 6_378_137.0
WGS84_E2 = 6.69437999014e-3
REACH_M = 20_000.0
"""Metres from the origin beyond which a plane is no usable map of the earth."""
LATITUDE_LIMIT = 89.0
"""Degrees beyond which a site has no east and north: its meridians meet."""
_CLOSE = 1e-13
"""Degrees (0.01 µm) within which an inverse is exact."""


@dataclass(frozen=True)
class Geodetic:
    """A position on the earth, degrees."""

    lat: float
    lon: float


Rule = Callable[[SiteOrigin, float, float], Geodetic]
"""Returns the position so many metres east and north of the origin."""


def from_steps(lat: int, lon: int) -> Geodetic:
    """Return the position that is given in steps."""
    return Geodetic(lat=lat / STEPS_PER_DEGREE, lon=lon / STEPS_PER_DEGREE)


def to_steps(place: Geodetic) -> tuple[int, int]:
    """Return latitude and longitude in steps."""
    return round(place.lat * STEPS_PER_DEGREE), round(place.lon * STEPS_PER_DEGREE)


def to_geodetic(origin: SiteOrigin, point: Point, rule: str = "wgs84") -> Geodetic:
    """Return the position of a point of the site's frame (metres), by one of `RULES`."""
    east, north = origin.from_east.back(point)
    return RULES[rule](origin, east, north)


def from_geodetic(origin: SiteOrigin, place: Geodetic, rule: str = "wgs84") -> Point:
    """Return the point of the site's frame at a position: the inverse of `to_geodetic`.

    Iterative; each step shrinks the error by some thousand times. A dozen are never needed within a hundred
    kilometres of the origin.
    """
    east = north = 0.0
    for _ in range(12):
        here = RULES[rule](origin, east, north)
        d_lat, d_lon = place.lat - here.lat, _wrapped(place.lon - here.lon)
        if abs(d_lat) < _CLOSE and abs(d_lon) < _CLOSE:
            break
        metres_per_degree = math.radians(WGS84_A)
        north += d_lat * metres_per_degree
        east += d_lon * metres_per_degree * math.cos(math.radians(here.lat))
    return origin.from_east.point((east, north))


def out_of_reach(point: Point) -> str:
    """Return why a point of the site has no latitude and longitude; empty if it has."""
    away = math.hypot(*point)
    if away <= REACH_M:
        return ""
    return (
        f"({point[0]:.0f}, {point[1]:.0f}) is {away / 1000:.0f} km from the drawing's 0,0, the position of"
        " --origin; move the drawing near its 0,0"
    )


def bearing_deg(origin: SiteOrigin, heading: float) -> float:
    """Return a site heading (radians counter-clockwise from +x) as degrees clockwise from north, 0 to 360."""
    return (origin.heading_deg + 90.0 - math.degrees(heading)) % 360.0


def heading_of(origin: SiteOrigin, bearing: float) -> float:
    """The inverse of `bearing_deg`, radians within ±π."""
    return math.remainder(math.radians(origin.heading_deg + 90.0 - bearing), math.tau)


def _wgs84(origin: SiteOrigin, east: float, north: float) -> Geodetic:
    """Position on the plane that touches the ellipsoid's parallel surface at the origin."""
    lat, lon = math.radians(origin.lat), math.radians(origin.lon)
    x0, y0, z0 = _ecef(lat, lon, origin.alt)
    x = x0 - math.sin(lon) * east - math.sin(lat) * math.cos(lon) * north
    y = y0 + math.cos(lon) * east - math.sin(lat) * math.sin(lon) * north
    z = z0 + math.cos(lat) * north
    return Geodetic(lat=_latitude(math.hypot(x, y), z), lon=math.degrees(math.atan2(y, x)))


def _ecef(lat: float, lon: float, alt: float) -> tuple[float, float, float]:
    """Earth-centred coordinates of a geodetic position (radians, metres above the ellipsoid)."""
    radius = WGS84_A / math.sqrt(1 - WGS84_E2 * math.sin(lat) ** 2)
    across = (radius + alt) * math.cos(lat)
    return (
        across * math.cos(lon),
        across * math.sin(lon),
        (radius * (1 - WGS84_E2) + alt) * math.sin(lat),
    )


def _latitude(across: float, z: float) -> float:
    """Geodetic latitude (degrees) of a point `across` from the axis and `z` above the equator."""
    lat = math.atan2(z, across * (1 - WGS84_E2))
    for _ in range(8):
        radius = WGS84_A / math.sqrt(1 - WGS84_E2 * math.sin(lat) ** 2)
        lat = math.atan2(z + WGS84_E2 * radius * math.sin(lat), across)
    return math.degrees(lat)


def _ardupilot(origin: SiteOrigin, east: float, north: float) -> Geodetic:
    """ArduPilot's flat earth: longitude shrinks with the cosine of the mean latitude (Location::offset)."""
    d_lat = north / ARDUPILOT_M_PER_DEGREE
    mean = math.radians(origin.lat + d_lat / 2)
    d_lon = east / (ARDUPILOT_M_PER_DEGREE * math.cos(mean))
    return Geodetic(lat=origin.lat + d_lat, lon=_wrapped(origin.lon + d_lon))


def _px4(origin: SiteOrigin, east: float, north: float) -> Geodetic:
    """PX4's azimuthal equidistant projection on a sphere (MapProjection::reproject)."""
    away = math.hypot(east, north) / PX4_RADIUS_M
    if away == 0:
        return Geodetic(lat=origin.lat, lon=origin.lon)
    lat = math.radians(origin.lat)
    cos_north, cos_east = (part / PX4_RADIUS_M / away for part in (north, east))
    sine = math.cos(away) * math.sin(lat) + math.sin(away) * math.cos(lat) * cos_north
    d_lon = math.atan2(
        cos_east * math.sin(away),
        math.cos(lat) * math.cos(away) - math.sin(lat) * math.sin(away) * cos_north,
    )
    return Geodetic(lat=math.degrees(math.asin(sine)), lon=_wrapped(origin.lon + math.degrees(d_lon)))


def _wrapped(degrees: float) -> float:
    return math.remainder(degrees, 360.0)


RULES: dict[str, Rule] = {"wgs84": _wgs84, "ardupilot": _ardupilot, "px4": _px4}
"""Rules from metres to degrees; maps and GIS use `wgs84`, each autopilot its own."""
