"""Health of a vehicle by its own reports: a cause that lasts, one that is over, and what nobody knows."""

from __future__ import annotations

from typing import Any

import pytest

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.following.vehicle_health import (
    BATTERY_BIT,
    ESTIMATE_BIT,
    FENCE_BIT,
    REMOTE_CONTROL_BIT,
    HealthReports,
    VehicleHealth,
)

ALL = BATTERY_BIT | ESTIMATE_BIT | FENCE_BIT | REMOTE_CONTROL_BIT


def system(enabled: int, healthy: int, *, present: int = ALL, charge: int = -1) -> Any:
    return dialect.MAVLink_sys_status_message(present, enabled, healthy, 0, 0, 0, charge, 0, 0, 0, 0, 0, 0)


def battery(state: int, charge: int = -1) -> Any:
    return dialect.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, charge, 0, state)


def estimator(flags: int) -> Any:
    return dialect.MAVLink_estimator_status_message(0, flags, *[0.0] * 8)


def after(*messages: Any) -> VehicleHealth:
    reports = HealthReports()
    for message in messages:
        reports.take(message.get_type(), message)
    return reports.now


def test_what_is_not_reported_or_switched_off_is_unknown() -> None:
    assert after() == VehicleHealth()
    assert after(system(0, ALL)) == VehicleHealth()
    assert after(system(ALL, ALL, present=0)) == VehicleHealth()
    assert after(system(0, 0), battery(0)) == VehicleHealth()


def test_bits_of_the_system_status_are_read_one_by_one() -> None:
    assert after(system(ALL, ALL, charge=54)) == VehicleHealth(0.54, True, True, True, True)
    for bit, name in ((BATTERY_BIT, "battery"), (ESTIMATE_BIT, "position"), (FENCE_BIT, "fence")):
        now = after(system(ALL, ALL), system(ALL, ALL & ~bit))
        assert getattr(now, name) is False
        assert [getattr(now, other) for other in ("battery", "position", "fence")].count(False) == 1


@pytest.mark.parametrize(
    ("state", "ok"), [(0, None), (1, True), (2, None), (3, False), (5, False), (7, None)]
)
def test_the_batterys_own_state_counts_too(state: int, ok: bool | None) -> None:
    assert after(battery(state, 20)) == VehicleHealth(charge=0.2, battery=ok)


def test_the_worst_report_of_a_battery_counts_and_a_charge_that_is_not_reported_changes_nothing() -> None:
    now = after(system(ALL, ALL, charge=80), battery(3), system(ALL, ALL))
    assert (now.charge, now.battery) == (0.8, False)


def test_an_estimators_own_flags_count_before_the_systems_bit() -> None:
    assert after(system(ALL, ALL & ~ESTIMATE_BIT), estimator(1 | 16)).position is True
    assert after(system(ALL, ALL), estimator(1 | 128)).position is False


def test_a_fence_is_breached_by_either_report() -> None:
    breached = dialect.MAVLink_fence_status_message(1, 1, 1, 0)
    assert after(breached).fence is False and after(system(ALL, ALL), breached).fence is False


def test_each_cause_that_lasts_is_named_with_what_clears_it() -> None:
    assert VehicleHealth().lasting() == "" and after(system(ALL, ALL)).lasting() == ""
    assert "restart the autopilot" in VehicleHealth(battery=False).lasting()
    assert "back inside" in VehicleHealth(fence=False).lasting()
    assert "localisation" in VehicleHealth(position=False).lasting()


def test_a_missing_remote_control_counts_only_for_a_run_that_was_paused_for_it() -> None:
    lost = VehicleHealth(remote_control=False)
    assert lost.lasting() == "" and lost.lasting("mode HOLD, by somebody (not known who)") == ""
    assert "switch the remote control on" in lost.lasting(
        'mode HOLD, by the autopilot\'s failsafe (remote control lost: "Throttle Failsafe")'
    )
