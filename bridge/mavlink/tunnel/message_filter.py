"""Filter of messages to a vehicle: by default a tunnel passes only telemetry requests and stop commands.

A station whose messages all pass could arm, change the mission and drive while a run is in progress, and no
commander's lease would count. To stop a vehicle must always be possible.
"""

from __future__ import annotations

from stopgo.bridge.mavlink.vehicle_link.messages import enum_name
from stopgo.mission.mavlink.autopilots import autopilot_of
from stopgo.mission.mavlink.autopilots.kind import Autopilot, Modes
from stopgo.mission.mavlink.enums import Component
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import Message

QUERIES = frozenset({
    "HEARTBEAT", "PING", "TIMESYNC", "SYSTEM_TIME", "COMMAND_CANCEL",
    "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "REQUEST_DATA_STREAM", "MESSAGE_INTERVAL",
    "MISSION_REQUEST_LIST", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST_PARTIAL_LIST",
    "LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_REQUEST_END",
})  # fmt: skip
"""Messages that only request data."""
QUERY_COMMANDS = frozenset({
    Command.REQUEST_MESSAGE, Command.SET_MESSAGE_INTERVAL,
    Command.GET_MESSAGE_INTERVAL, Command.GET_HOME_POSITION,
    Command.REQUEST_AUTOPILOT_CAPABILITIES, Command.REQUEST_PROTOCOL_VERSION,
    Command.REQUEST_CAMERA_INFORMATION, Command.REQUEST_CAMERA_CAPTURE_STATUS,
})  # fmt: skip
"""Commands that only request data."""
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")


class MessageFilter:
    """Judges messages to a vehicle by its kind, which it reads from the heartbeats that pass."""

    def __init__(self) -> None:
        self._kinds: dict[int, Autopilot] = {}

    def sees(self, message: Message) -> None:
        """Note a message from the vehicle's side."""
        if message.get_type() == "HEARTBEAT" and message.get_srcComponent() == Component.AUTOPILOT1:
            self._kinds[message.get_srcSystem()] = autopilot_of(message.autopilot)

    def lets_through(self, message: Message) -> bool:
        """True if a message only requests data, or stops the vehicle."""
        name = message.get_type()
        if name in COMMANDS:
            return message.command in QUERY_COMMANDS or self._stops(message)
        if name == "SET_MODE":
            return self._holds(message.target_system, message.custom_mode)
        # A download ends with an ACK; of another result it is a cancel, which drives nothing either.
        return name in QUERIES or name == "MISSION_ACK"

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
        targets = self._target_modes(message.target_system)
        return bool(targets) and all(
            modes.hold.main == main and modes.hold.sub in (0, sub) for modes in targets
        )

    def _holds(self, system: int, custom_mode: int) -> bool:
        targets = self._target_modes(system)
        return bool(targets) and all(modes.of(custom_mode) == modes.hold for modes in targets)

    def _target_modes(self, system: int) -> list[Modes]:
        """Modes of the vehicle, or, for 0, of all known vehicles; empty if one is of an unknown kind."""
        kinds = [kind for known, kind in self._kinds.items() if system in (0, known)]
        return [kind.modes for kind in kinds] if all(kind.drivable for kind in kinds) else []


def described(message: Message) -> str:
    """Name of a message for people, with its command if it is one."""
    name: str = message.get_type()
    return f"{enum_name('MAV_CMD', message.command)} ({name})" if name in COMMANDS else name
