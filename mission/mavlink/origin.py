"""Whether an autopilot's metres count from the mission's georeference."""

from __future__ import annotations

import math

from mission.document import SiteOrigin
from mission.geodesy import Geodetic, from_geodetic

SAME_M = 0.05
"""Origins that are no farther apart are the same: each is written in steps of a centimetre."""
FAR_DEG = 0.01
"""Beyond this (a kilometre) two origins are not of one site, and no metres are worth counting."""


def how_far_off(site: SiteOrigin, origin: Geodetic) -> str:
    """How far from the site's origin an autopilot's lies, as in "0.08 m"; empty if they are the same."""
    if is_elsewhere(site, origin):
        return "more than a kilometre"
    metres = math.hypot(*from_geodetic(site, origin))
    return "" if metres <= SAME_M else f"{metres:.2f} m"


def is_elsewhere(site: SiteOrigin, origin: Geodetic) -> bool:
    """Whether an autopilot's origin is of another site altogether."""
    d_lat, d_lon = origin.lat - site.lat, math.remainder(origin.lon - site.lon, 360.0)
    return max(abs(d_lat), abs(d_lon)) > FAR_DEG
