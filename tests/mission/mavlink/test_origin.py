"""Origin of an autopilot's metres: the mission's georeference, or another one."""

from __future__ import annotations

import pytest

from stopgo.mission.frames.geodesy import Geodetic
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import origin_distance

SITE = SiteOrigin(lat=47.4, lon=8.5, alt=400.0, heading_deg=0.0)


@pytest.mark.parametrize(
    ("lat", "lon", "away"),
    [
        (47.4, 8.5, ""),
        (47.4 + 4e-7, 8.5, ""),  # 111 180 m a degree: 4.4 cm
        (47.4 + 5e-7, 8.5, "0.06 m"),  # 5.6 cm
        (47.4 + 7e-7, 8.5, "0.08 m"),  # 7.8 cm
        (47.4, 8.5 + 1e-6, "0.08 m"),  # 75 460 m a degree: 7.5 cm
        (47.4, 8.5 + 360.0, ""),
        (0.0, 0.0, "more than a kilometre"),
    ],
)
def test_origins_within_five_centimetres_are_the_same(lat: float, lon: float, away: str) -> None:
    assert origin_distance(SITE, Geodetic(lat=lat, lon=lon)) == away
