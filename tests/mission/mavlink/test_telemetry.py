"""When a vehicle stands still, and when nobody knows what it does any more."""

from __future__ import annotations

import pytest

from mission.mavlink.telemetry import is_lost, stands_still


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "still"),
    [(0.0, 0.0, True), (0.02, -0.02, True), (0.04, 0.0, False), (0.0, 0.1, False), (0.0, -0.1, False)],
)
def test_what_creeps_or_turns_does_not_stand(speed: float, yaw_rate: float, still: bool) -> None:
    assert stands_still(speed=speed, yaw_rate=yaw_rate) is still


def test_a_vehicle_is_lost_when_three_heartbeats_are_missing() -> None:
    assert [is_lost(seconds) for seconds in (0.0, 2.9, 3.1)] == [False, False, True]
