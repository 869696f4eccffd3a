"""Each kind of autopilot: its modes there and back, and its numbers as MAVLink's own dialect has them."""

from __future__ import annotations

from enum import IntEnum, IntFlag

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.mission.mavlink import enums
from stopgo.mission.mavlink.autopilots import AUTOPILOTS, autopilot_of
from stopgo.mission.mavlink.autopilots.kind import Autopilot, Mode
from stopgo.mission.mavlink.items import Command

PREFIXES: dict[type[IntEnum] | type[IntFlag], str] = {
    enums.Firmware: "MAV_AUTOPILOT", enums.VehicleType: "MAV_TYPE", enums.ModeFlag: "MAV_MODE_FLAG",
    enums.MissionResult: "MAV_MISSION", enums.CommandResult: "MAV_RESULT",
    enums.MissionState: "MISSION_STATE", enums.Component: "MAV_COMP_ID", enums.MessageId: "MAVLINK_MSG_ID",
}  # fmt: skip
KINDS = pytest.mark.parametrize("kind", AUTOPILOTS.values(), ids=list(AUTOPILOTS))


@pytest.mark.parametrize("enum", list(PREFIXES))
def test_numbers_are_those_of_the_dialect(enum: type[IntEnum]) -> None:
    for one in enum:
        assert one == getattr(dialect, f"{PREFIXES[enum]}_{one.name}")


@pytest.mark.parametrize("name", [name for name in vars(Command) if name.isupper()])
def test_commands_are_those_of_the_dialect(name: str) -> None:
    assert getattr(Command, name) == getattr(dialect, f"MAV_CMD_{name}")


@KINDS
def test_a_mode_is_found_again_in_a_heartbeat(kind: Autopilot) -> None:
    for name, mode in kind.modes.numbers.items():
        custom = kind.modes.custom(mode)
        beat = dialect.MAVLink_heartbeat_message(10, kind.firmware, kind.modes.flags[name], custom, 4, 3)
        assert kind.mode_of(beat) == mode and autopilot_of(beat.autopilot) is kind
        assert kind.in_auto(beat) == (name == "auto")
        assert kind.mode_name(beat) == {"auto": "AUTO", "hold": "HOLD"}.get(name, kind.modes.name(mode))


def test_modes_are_called_as_people_call_them() -> None:
    rover, px4 = AUTOPILOTS["ardupilot"].modes, AUTOPILOTS["px4"].modes
    assert [rover.name(Mode(number)) for number in (11, 99)] == ["RTL", "mode 99"]
    assert [px4.name(Mode(*numbers)) for numbers in ((6,), (4, 5), (4, 9), (9,))] == [
        "OFFBOARD", "RETURN", "AUTO 9", "mode 9",
    ]  # fmt: skip


def test_a_copter_has_another_mode_for_its_mission() -> None:
    auto = AUTOPILOTS["ardupilot"].in_auto
    copter, rover = (
        [auto(dialect.MAVLink_heartbeat_message(kind, 3, 0, mode, 4, 3)) for mode in (3, 10)]
        for kind in (dialect.MAV_TYPE_QUADROTOR, dialect.MAV_TYPE_GROUND_ROVER)
    )
    assert (copter, rover) == ([True, False], [False, True])


def test_an_unknown_firmware_is_taken_to_keep_to_the_specification() -> None:
    assert autopilot_of(4).name == "generic"
