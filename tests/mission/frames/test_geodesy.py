"""Site metres and geodetic degrees."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.frames.geodesy import (
    RULES,
    STEPS_PER_DEGREE,
    Geodetic,
    bearing_deg,
    from_geodetic,
    heading_of,
    to_geodetic,
)
from stopgo.mission.frames.transform import SiteOrigin

SITES = [
    SiteOrigin(lat=47.3769, lon=8.5417, alt=408.0, heading_deg=30.0),
    SiteOrigin(lat=0.0, lon=179.9999, alt=0.0, heading_deg=-90.0),
    SiteOrigin(lat=-33.86, lon=151.2, alt=20.0, heading_deg=200.0),
    SiteOrigin(lat=69.65, lon=18.96, alt=5.0, heading_deg=0.0),
]
POINTS = [(0.0, 0.0), (12.5, -3.25), (-400.0, 250.0), (3000.0, 4000.0)]


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("origin", SITES)
def test_there_and_back_is_the_same_point(origin, rule):
    for point in POINTS:
        back = from_geodetic(origin, to_geodetic(origin, point, rule), rule)
        assert math.dist(back, point) < 1e-5


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("origin", SITES)
def test_steps_of_1e_7_degrees_move_a_point_by_less_than_8_mm(origin, rule):
    for point in POINTS:
        place = to_geodetic(origin, point, rule)
        lat, lon = (round(angle * STEPS_PER_DEGREE) / STEPS_PER_DEGREE for angle in (place.lat, place.lon))
        assert math.dist(from_geodetic(origin, Geodetic(lat=lat, lon=lon), rule), point) <= 0.008


@pytest.mark.parametrize("origin", SITES)
def test_wgs84_is_what_proj_says(origin):
    pyproj = pytest.importorskip("pyproj")
    plane = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84"
        f" +step +proj=topocentric +ellps=WGS84 +lat_0={origin.lat} +lon_0={origin.lon} +h_0={origin.alt}"
    )
    turn = math.radians(origin.heading_deg)
    for x, y in POINTS[:3]:
        place = to_geodetic(origin, (x, y))
        east, north, _ = plane.transform(place.lon, place.lat, origin.alt)
        wanted = (math.cos(turn) * x + math.sin(turn) * y, -math.sin(turn) * x + math.cos(turn) * y)
        # The surface falls away from the plane: by 17 mm at 470 m, which turns by less than 2 µm sideways.
        assert math.dist((east, north), wanted) < 1e-5


def test_ardupilot_scales_latitude_by_its_own_figure():
    place = to_geodetic(SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=0.0), (0.0, 100.0), "ardupilot")
    assert (place.lat - 47.0) * STEPS_PER_DEGREE == pytest.approx(100 / 0.011131884502145034, rel=1e-9)


def test_plus_y_bears_the_sites_heading():
    origin = SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=30.0)
    assert bearing_deg(origin, math.pi / 2) == pytest.approx(30.0)
    assert bearing_deg(origin, 0.0) == pytest.approx(120.0)
    assert heading_of(origin, 120.0) == pytest.approx(0.0)


def test_the_rules_differ_by_metres_far_from_the_origin():
    origin = SiteOrigin(lat=47.0, lon=8.0, alt=0.0, heading_deg=0.0)
    true = to_geodetic(origin, (0.0, 1000.0))
    for rule in ("ardupilot", "px4"):
        beside = math.dist(from_geodetic(origin, true, rule), (0.0, 1000.0))
        assert 0.1 < beside < 5.0
