"""A mission's tolerances at a vehicle's parameters, before the mission is pushed."""

from __future__ import annotations

import msgspec
import pytest

from stopgo.mission.mavlink.accuracy import accuracy_warning, stops_within
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from tests.bridge.mavlink.driving.world import cornered_mission


def test_it_stops_within_its_radius_or_where_it_has_rolled_to() -> None:
    """The Rover of the log stood 218 mm off its stops at 0.8 m/s, with a radius of 20 mm."""
    assert stops_within(radius=0.02, speed=0.8) == pytest.approx(0.24)
    assert stops_within(radius=0.5, speed=0.8) == 0.5


def test_what_is_asked_and_cannot_be_is_reported_with_two_remedies() -> None:
    mission = cornered_mission()
    assert accuracy_warning(mission, AUTOPILOTS["px4"], {"NAV_ACC_RAD": 0.5}) == (
        "this vehicle stops within 0.50 m in AUTO (NAV_ACC_RAD 0.5 m, 0.5 m/s),"
        " and 5 of 5 stops must be met within less, the tightest within 0.05 m:"
        " set NAV_ACC_RAD to 0.05 and plan with --speed 0.16,"
        " or drive it by stopgo robot --controller mavlink:URL"
    )
    assert "(WP_RADIUS 0.02 m, 0.5 m/s)" in accuracy_warning(
        mission, AUTOPILOTS["ardupilot"], {"WP_RADIUS": 0.02}
    )
    assert "set WP_RADIUS" not in accuracy_warning(mission, AUTOPILOTS["ardupilot"], {"WP_RADIUS": 0.02})


def test_of_stops_that_ask_for_no_more_nothing_is_reported() -> None:
    mission = cornered_mission(tolerance_m=0.3)
    assert accuracy_warning(mission, AUTOPILOTS["ardupilot"], {"WP_RADIUS": 0.1}) == ""
    slow = msgspec.structs.replace(mission.robot, speed=0.15)
    tight = msgspec.structs.replace(cornered_mission(), robot=slow)
    assert accuracy_warning(tight, AUTOPILOTS["ardupilot"], {"WP_RADIUS": 0.05}) == ""


@pytest.mark.parametrize(
    ("kind", "values", "told"),
    [
        ("ardupilot", {"SERVO1_FUNCTION": 26.0, "SERVO3_FUNCTION": 70.0}, "SERVO1_FUNCTION is 26"),
        ("ardupilot", {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0}, ""),
        ("ardupilot", {"SERVO1_FUNCTION": 73.0, "SERVO2_FUNCTION": 26.0, "SERVO3_FUNCTION": 74.0}, ""),
        ("ardupilot", {}, ""),
        ("px4", {"CA_AIRFRAME": 5.0}, "CA_AIRFRAME is 5"),
        ("px4", {"CA_AIRFRAME": 6.0}, ""),
        ("generic", {}, ""),
    ],
)
def test_a_rover_that_steers_like_a_car_is_known_by_its_parameters(
    kind: str, values: dict[str, float], told: str
) -> None:
    why = AUTOPILOTS[kind].why_no_pivot(values)
    assert (told in why and "cannot turn on the spot" in why) if told else why == ""
    assert (why in accuracy_warning(cornered_mission(), AUTOPILOTS[kind], values)) is True
