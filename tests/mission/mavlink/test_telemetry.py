"""Standstill of a vehicle, and vehicles whose state is unknown."""

from __future__ import annotations

import pytest

from stopgo.mission.mavlink.telemetry import charge_of, has_restarted, is_lost, stands_still


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "still"),
    [(0.0, 0.0, True), (0.02, -0.02, True), (0.04, 0.0, False), (0.0, 0.1, False), (0.0, -0.1, False)],
)
def test_what_creeps_or_turns_does_not_stand(speed: float, yaw_rate: float, still: bool) -> None:
    assert stands_still(speed=speed, yaw_rate=yaw_rate) is still


def test_a_vehicle_is_lost_when_three_heartbeats_are_missing() -> None:
    assert [is_lost(seconds) for seconds in (0.0, 2.9, 3.1)] == [False, False, True]


def test_a_clock_that_goes_back_by_more_than_a_second_began_again() -> None:
    assert [has_restarted(60_000, now_ms) for now_ms in (61_000, 59_500, 59_000, 58_999, 0)] == [
        False, False, False, True, True,
    ]  # fmt: skip


def test_a_charge_is_known_from_0_to_100_percent() -> None:
    assert [charge_of(remaining) for remaining in (-1, 0, 40, 100, 101)] == [None, 0.0, 0.4, 1.0, None]
