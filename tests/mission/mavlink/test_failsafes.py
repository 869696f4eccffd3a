"""Texts of ArduPilot Rover and PX4 that name a failsafe, and texts that do not."""

from __future__ import annotations

import pytest

from stopgo.mission.mavlink.failsafes import failsafe_of

TEXTS = {
    "Battery 1 is low 10.50V used 1200 mAh": "battery",
    "Battery 1 is critical 9.90V used 1500 mAh": "battery",
    "Critical battery, return now": "battery",
    "Radio Failsafe": "remote control lost",
    "Failsafe trigger: Throttle": "remote control lost",
    "Manual control lost": "remote control lost",
    "GCS Failsafe": "ground station lost",
    "Connection to ground station lost": "ground station lost",
    "Data link lost": "ground station lost",
    "Circle fence breached": "geofence",
    "Geofence violation": "geofence",
    "Crash: Going to HOLD": "crash",
    "EKF failsafe": "position estimate",
    "No valid local position estimate": "position estimate",
    "No offboard signal": "no set points",
    "Failsafe activated: switching to Hold": "failsafe",
}
NONE = [
    "GCS Failsafe Cleared", "PreArm: Battery 1 low voltage failsafe", "Mission: 3 WP", "Reached waypoint #2",
    "Battery 1 is full", "Flight mode: HOLD", "Manual control regained", "",
]  # fmt: skip


@pytest.mark.parametrize(("text", "cause"), TEXTS.items())
def test_the_text_of_a_failsafe_names_its_cause(text: str, cause: str) -> None:
    found = failsafe_of(text)
    assert found is not None and (found.cause, found.text) == (cause, text)


@pytest.mark.parametrize("text", NONE)
def test_another_text_is_no_failsafe(text: str) -> None:
    assert failsafe_of(text) is None
