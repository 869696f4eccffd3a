"""Reports of a vehicle that a gateway drives count only if they are numbers."""

from __future__ import annotations

import math

import pytest

from stopgo.bridge.mavlink.driving.autopilot_telemetry import NewestMessages
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.mavlink.telemetry import Message

NO_NUMBER = (
    dialect.MAVLink_local_position_ned_message(1, math.nan, 0, 0, 0, 0, 0),
    dialect.MAVLink_local_position_ned_message(1, 0, 0, 0, 0, math.inf, 0),
    dialect.MAVLink_attitude_message(1, 0, 0, math.nan, 0, 0, 0),
)


@pytest.mark.parametrize("message", NO_NUMBER)
def test_a_position_or_heading_that_is_no_number_is_late(message: Message) -> None:
    """The vehicle was driven on without a position, until it had made no progress for long enough."""
    newest = NewestMessages(Who(1, 1))
    newest.put(message)
    name = message.get_type()
    assert newest.newest(name) is None
    assert math.isinf(newest.age_s(name))
