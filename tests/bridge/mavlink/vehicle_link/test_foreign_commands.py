"""Senders of changes, by messages that were received: stations, remote controls; nobody without evidence."""

from __future__ import annotations

from typing import Any

import pytest

from stopgo.bridge.mavlink.vehicle_link.foreign_commands import ForeignCommands
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Mode
from tests.own_time import World, stepped_into

VEHICLE, ME, OTHER = Who(1, 1), Who(254, 30), Who(255, 190)
MIDDLE = 1500
HOLD = Mode(4)


@pytest.fixture
def world() -> Any:
    with stepped_into() as stepped:
        yield stepped


@pytest.fixture
def foreign(world: World) -> ForeignCommands:
    return ForeignCommands(VEHICLE, ME, autopilot_named("ardupilot"))


def hear(foreign: ForeignCommands, message: Any, by: Who) -> None:
    """Have the message heard as it comes over a line."""
    coder = dialect.MAVLink(None, by.system, by.component)
    (parsed,) = dialect.MAVLink(None).parse_buffer(bytearray(message.pack(coder)))
    assert foreign.wants(parsed)
    foreign.put(parsed)


def channels(*first: int, count: int = 8) -> Any:
    values = [*first, *[MIDDLE] * (8 - len(first)), *[65_535] * 10]
    return dialect.MAVLink_rc_channels_message(0, count, *values, 255)


def to_hold(to: Who = VEHICLE) -> Any:
    return dialect.MAVLink_command_long_message(to.system, to.component, 176, 0, 1, 4, 0, 0, 0, 0, 0)


def test_a_command_is_the_cause_of_its_own_mode_for_ten_seconds(
    foreign: ForeignCommands, world: World
) -> None:
    hear(foreign, to_hold(), OTHER)
    assert foreign.station("mode", mode=HOLD) == "system 255, component 190"
    assert foreign.station("mode", mode=Mode(0)) == foreign.station("item") == ""
    world.sleep(11.0)
    assert foreign.station("mode", mode=HOLD) == ""
    assert foreign.station("mode", 11.0, HOLD) == "system 255, component 190"


def test_our_own_commands_and_those_for_other_vehicles_are_nobodys(foreign: ForeignCommands) -> None:
    hear(foreign, to_hold(), ME)
    hear(foreign, to_hold(Who(2, 1)), OTHER)
    assert foreign.station("mode") == ""


def test_an_answer_names_the_station_that_it_is_for_if_the_vehicle_has_accepted(
    foreign: ForeignCommands,
) -> None:
    ack = dialect.MAVLink_command_ack_message
    hear(foreign, ack(176, 2, target_system=255, target_component=190), VEHICLE)  # denied
    hear(foreign, ack(176, 0, target_system=254, target_component=30), VEHICLE)  # ours
    assert foreign.station("mode") == ""
    hear(foreign, ack(176, 0, target_system=255, target_component=190), VEHICLE)
    assert foreign.station("mode") == "system 255, component 190"


def test_noise_a_receiver_that_is_switched_on_and_its_lost_signal_are_no_motion(
    foreign: ForeignCommands,
) -> None:
    for values in [(0, 0), (1500, 1500), (1520, 1490), (0, 875 - 100), (1500, 1500)]:
        hear(foreign, channels(*values), VEHICLE)
    assert foreign.remote_control() == foreign.sticks_moved() == ""
    hear(foreign, channels(1500, 1700), VEHICLE)
    assert foreign.sticks_moved() == "the remote control (its channel 2: 1500 → 1700 µs)"


def test_a_vehicle_without_a_receiver_has_its_channels_from_a_station(foreign: ForeignCommands) -> None:
    hear(foreign, channels(count=0), VEHICLE)
    hear(foreign, channels(1900, count=0), VEHICLE)
    assert foreign.remote_control().startswith("a station in place of a remote control (not known which;")


def test_a_joystick_that_nobody_moves_is_nobodys_hand(foreign: ForeignCommands, world: World) -> None:
    joystick = dialect.MAVLink_manual_control_message
    for _ in range(3):
        hear(foreign, joystick(1, 0, 0, 500, 0, 0), OTHER)
        hear(foreign, joystick(1, 32_767, 32_767, 500, 32_767, 0), OTHER)
        world.sleep(0.1)
    assert foreign.sticks_moved() == ""
    hear(foreign, joystick(1, 0, 400, 500, 0, 0), OTHER)
    assert foreign.sticks_moved() == "system 255, component 190"


def test_a_stream_of_set_points_does_not_push_out_what_was_commanded_before(
    foreign: ForeignCommands, world: World
) -> None:
    hear(foreign, to_hold(), OTHER)
    points = dialect.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0, *[0.0] * 11)
    for _ in range(400):
        hear(foreign, points, Who(1, 191))
        world.sleep(0.02)
    assert foreign.sends_set_points() == "system 1, component 191"
    assert foreign.station("mode", 8.0, HOLD) == "system 255, component 190"


def test_a_mode_that_is_no_number_names_no_mode(foreign: ForeignCommands) -> None:
    nan = dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, float("nan"), float("inf"), 0, 0, 0, 0)
    hear(foreign, nan, OTHER)
    assert foreign.station("mode", mode=HOLD) == ""
