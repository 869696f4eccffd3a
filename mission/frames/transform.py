"""Frames of a site as mission.json holds them: its transform to a map, and its origin on the Earth.

Metres, radians counter-clockwise from +x; keys that end in `_deg` are degrees.
"""

from __future__ import annotations

import msgspec

Point = tuple[float, float]


class Transform(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Transform from site to map: rotate by `heading`, then shift by (x, y)."""

    x: float
    y: float
    heading: float


class SiteOrigin(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """WGS84 position of the frame's origin; heading is the bearing of +y clockwise from true north."""

    lat: float
    lon: float
    alt: float
    heading_deg: float
