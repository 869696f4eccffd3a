"""A vehicle's local metres in the site, by numbers that can be checked on paper."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import LocalFrame, VehicleOrigin, apart, local_frame

SITE = SiteOrigin(lat=47.4, lon=8.5, alt=400.0, heading_deg=30.0)


def test_a_site_that_bears_30_degrees_turns_north_and_east() -> None:
    frame = LocalFrame(SITE)
    pose = frame.pose(north=math.cos(math.radians(30)), east=math.sin(math.radians(30)), yaw=math.radians(30))
    # One metre towards the site's +y, looking there.
    assert (pose.x, pose.y) == pytest.approx((0.0, 1.0))
    assert pose.heading == pytest.approx(math.pi / 2)
    assert frame.north_east((pose.x, pose.y)) == pytest.approx(
        (math.cos(math.radians(30)), math.sin(math.radians(30)))
    )
    assert frame.yaw(pose.heading) == pytest.approx(math.radians(30))


def test_an_origin_two_centimetres_off_is_the_same_and_counted() -> None:
    # 2e-7° of latitude are 2.2 cm north by ArduPilot's scale.
    origin = VehicleOrigin(lat=SITE.lat + 2e-7, lon=SITE.lon, alt=0.0)
    assert apart(SITE, origin) == ""
    frame = local_frame(SITE, origin, "ardupilot")
    north = frame.pose(0.0, 0.0, 0.0)
    assert math.hypot(north.x, north.y) == pytest.approx(0.02226, abs=1e-4)
    assert frame.north_east((0.0, 0.0)) == pytest.approx((-0.02226, 0.0), abs=1e-4)


@pytest.mark.parametrize(
    ("origin", "away"),
    [
        (VehicleOrigin(lat=SITE.lat, lon=SITE.lon + 1e-6, alt=0.0), "0.08 m"),
        (VehicleOrigin(lat=0.0, lon=0.0, alt=0.0), "more than a kilometre"),
    ],
)
def test_another_origin_is_reported_with_its_distance(origin: VehicleOrigin, away: str) -> None:
    assert f"is {away} from the mission's (47.4000000, 8.5000000)" in apart(SITE, origin)
