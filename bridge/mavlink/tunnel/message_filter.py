"""Which messages for a vehicle only look at it, or stop it: all that passes a tunnel, unless it is told more.

A station that is let through raw could arm, change the mission and drive while a run is under way, and no
commander's lease would count. To stop a vehicle must always be possible.
"""

from __future__ import annotations

from stopgo.bridge.mavlink.line.messages import enum_name
from stopgo.mission.mavlink.autopilots import autopilot_of
from stopgo.mission.mavlink.autopilots.kind import Autopilot, Modes
from stopgo.mission.mavlink.enums import Component
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import Message

LOOKS = frozenset({
    "HEARTBEAT", "PING", "TIMESYNC", "SYSTEM_TIME", "COMMAND_CANCEL",
    "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "REQUEST_DATA_STREAM", "MESSAGE_INTERVAL",
    "MISSION_REQUEST_LIST", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST_PARTIAL_LIST",
    "LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END",
})  # fmt: skip
"""Messages that ask."""
ASKS = frozenset({
    Command.REQUEST_MESSAGE, Command.SET_MESSAGE_INTERVAL,
    Command.GET_MESSAGE_INTERVAL, Command.GET_HOME_POSITION,
    Command.REQUEST_AUTOPILOT_CAPABILITIES, Command.REQUEST_PROTOCOL_VERSION,
    Command.REQUEST_CAMERA_INFORMATION, Command.REQUEST_CAMERA_CAPTURE_STATUS,
})  # fmt: skip
"""Commands that ask."""
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")


class MessageFilter:
    """Judges what goes to the vehicle by what it knows of it: its kind, from the heartbeats that pass."""

    def __init__(self) -> None:
        self._kinds: dict[int, Autopilot] = {}

    def sees(self, message: Message) -> None:
        """Look at a message that comes from the vehicle's side."""
        if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == Component.AUTOPILOT1:
            self._kinds[message.get_srcSystem()] = autopilot_of(message.autopilot)

    def lets_through(self, message: Message) -> bool:
        """Whether a message only looks, or stops."""
        name = message.get_type()
        if name in COMMANDS:
            return message.command in ASKS or self._stops(message)
        if name == "SET_MODE":
            return self._holds(message.target_system, message.custom_mode)
        # A download ends with an ACK; of another result it is a cancel, which drives nothing either.
        return name in LOOKS or name == "MISSION_ACK"

    def _stops(self, message: Message) -> bool:
        first, main, sub = message.param1, message.param2, message.param3
        if message.command == Command.COMPONENT_ARM_DISARM:
            return bool(first == 0)
        if message.command == Command.DO_PAUSE_CONTINUE:
            return bool(first == 0)
        if message.command == Command.DO_FLIGHTTERMINATION:
            return bool(first >= 0.5)
        if message.command != Command.DO_SET_MODE:
            return False
        meant = self._meant(message.target_system)
        return bool(meant) and all(modes.hold.main == main and modes.hold.sub in (0, sub) for modes in meant)

    def _holds(self, system: int, custom_mode: int) -> bool:
        meant = self._meant(system)
        return bool(meant) and all(modes.of(custom_mode) == modes.hold for modes in meant)

    def _meant(self, system: int) -> list[Modes]:
        """The vehicle's modes, or, for 0, all heard vehicles'; empty if one is of an unknown kind."""
        kinds = [kind for known, kind in self._kinds.items() if system in (0, known)]
        return [kind.modes for kind in kinds] if all(kind.drivable for kind in kinds) else []


def described(message: Message) -> str:
    """What a message is, for people: the name of its command if it is one."""
    name: str = message.get_type()
    return f"{enum_name('MAV_CMD', message.command)} ({name})" if name in COMMANDS else name
