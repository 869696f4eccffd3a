"""A mission is taken and started only if the battery lasts, where the robot can report."""

from __future__ import annotations

from dataclasses import replace

import pytest

from stopgo.bridge.robot.simulated_faults import Fault, Faults
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.battery import battery_shortfall, time_left
from tests.bridge.world import EXACT, Field, corridor

TOTAL_S = schedule(corridor()).total_s
"""The corridor keeps 15 % of the battery, so 85 % are for this."""


def lasting(seconds: float, *faults: Fault) -> Field:
    """A robot whose full battery lasts so long."""
    return Field(wear=replace(EXACT, battery_per_s=1.0 / seconds), faults=Faults(faults))


def missing(battery: float, endurance_s: float | None, first: int = 0) -> str:
    return battery_shortfall(corridor(), battery=battery, endurance_s=endurance_s, first=first)


def test_a_battery_that_lasts_exactly_is_enough() -> None:
    assert missing(0.65, TOTAL_S / 0.5 * (1 + 1e-9)) == ""
    assert missing(0.65, TOTAL_S / 0.5 * 0.999) != ""


def test_a_robot_that_cannot_report_takes_every_mission() -> None:
    assert missing(0.0, None) == ""


def test_the_refusal_has_both_times_in_one_line() -> None:
    # 54 times 67 s (2 m, 2 s still, a scan), a turn of 4 s, and 108 m back in 217 s: 3839 s.
    told = battery_shortfall(corridor(stops=54), battery=0.55, endurance_s=3600.0)
    assert told == (
        "the mission takes 1.1 h as planned; the battery, at 55%, lasts 0.4 h until 15%:"
        " charge it, or plan fewer stops"
    )


def test_what_is_left_counts_from_the_last_scan_on() -> None:
    left = [time_left(corridor(), first) for first in range(4)]
    # Each stop: 2 m at 0.5 m/s with 0.5 m/s² (5 s), 2 s still, 60 s scan; then back.
    assert [left[0] - left[1], left[1] - left[2]] == [67.0, 67.0]
    assert left[0] == TOTAL_S
    assert left[3] == 0.0


def test_a_mission_longer_than_the_battery_lasts_is_rejected_and_nothing_is_kept() -> None:
    field = lasting(TOTAL_S)
    with pytest.raises(NegativeResult, match=r"infeasible: the mission takes 0\.1 h .* at 100%"):
        field.station().push(corridor())
    assert field.controller.run.state == "IDLE"
    assert field.journal.missions.read(corridor().id, 1) is None


def test_a_battery_that_went_down_since_the_push_refuses_the_start() -> None:
    field = lasting(TOTAL_S * 2, Fault("drain", 1, 0.4))
    field.station().push(corridor())
    assert field.order("start").outcome == "ok"
    field.work()
    field.base.stand_at(field.base.pose())
    assert field.base.battery() < 0.41
    field.order("abort")
    refused = field.order("start", again=True, from_here=True)
    assert refused.reason == "infeasible"
    assert "charge it" in refused.message
    assert field.station().push(corridor()).already
    field.base.charge()
    assert field.order("start", again=True, from_here=True).outcome == "ok"


def test_a_revision_during_a_run_is_measured_by_what_is_left() -> None:
    field = lasting(TOTAL_S / 0.8)
    field.station().push(corridor())
    field.order("start")
    while field.controller.run.done != ("s1",):
        field.controller.step()
    # One stop of 67 s is behind, and a fourth is as long; ten are not.
    assert field.station().push(corridor(revision=2, stops=4, closed=False)).waits
    with pytest.raises(NegativeResult, match="infeasible"):
        field.station().push(corridor(revision=3, stops=10))
