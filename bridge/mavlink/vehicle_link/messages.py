"""MAVLink messages that our end sends, made from their content in the names and units of their fields."""

from __future__ import annotations

from typing import Any

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.document import Point
from stopgo.mission.frames.geodesy import to_steps
from stopgo.mission.mavlink.enums import Firmware, VehicleType
from stopgo.mission.mavlink.items import Command, Item
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.telemetry import Message

MISSION = dialect.MAV_MISSION_TYPE_MISSION
"""Type of the mission, not of the fence or the rally points, which use the same protocol."""
POSITION_ONLY = 0x0DF8
"""Type mask of a setpoint that is a position: speeds, accelerations and yaw are ignored."""
YAW_ONLY = 0x09FF
COURSE = 0x09C7
"""Type mask of a velocity and a yaw: the position, accelerations and the yaw's rate are ignored."""


def heartbeat(kind: VehicleType) -> Message:
    """Our own heartbeat, which is no vehicle's."""
    return dialect.MAVLink_heartbeat_message(kind, Firmware.INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3)


def station_beat() -> Message:
    """The heartbeat of a ground station."""
    return heartbeat(VehicleType.GCS)


def on_board_beat() -> Message:
    """The heartbeat of a computer on the robot."""
    return heartbeat(VehicleType.ONBOARD_CONTROLLER)


def command_long(to: Who, number: int, *params: float, again: int = 0) -> Message:
    """A command; params that are not given are 0. `again`: number of times that it was sent before."""
    filled = (*params, *(0.0,) * 7)[:7]
    return dialect.MAVLink_command_long_message(to.system, to.component, number, min(again, 255), *filled)


def command_int(to: Who, number: int, *params: float, x: int, y: int, z: float, frame: int) -> Message:
    """A command with a position in steps of 1e-7 degrees, and up to four params."""
    filled = (*params, *(0.0,) * 4)[:4]
    return dialect.MAVLink_command_int_message(to.system, to.component, frame, number, 0, 0, *filled, x, y, z)


def request(to: Who, message: int, index: int = 0) -> Message:
    """A request for a message; `index` for those that are numbered."""
    return command_long(to, Command.REQUEST_MESSAGE, message, index)


def every_component(of: Who) -> Who:
    """All components of a system."""
    return Who(of.system, 0)


def interval(to: Who, message: int, hertz: float) -> Message:
    """A request to send a message at a rate."""
    return command_long(to, Command.SET_MESSAGE_INTERVAL, message, 1e6 / hertz)


def parameter_request(to: Who, name: str) -> Message:
    """A request for the value of a parameter."""
    return dialect.MAVLink_param_request_read_message(to.system, to.component, name.encode(), -1)


def parameter_setting(to: Who, name: str, value: float) -> Message:
    """Sets a parameter of type float32."""
    return dialect.MAVLink_param_set_message(
        to.system, to.component, name.encode(), value, dialect.MAV_PARAM_TYPE_REAL32
    )


def set_current(to: Who, sequence: int) -> Message:
    """Makes an item the current one; there is no answer, but MISSION_CURRENT shows it."""
    return dialect.MAVLink_mission_set_current_message(to.system, to.component, sequence)


def set_origin(to: Who, origin: VehicleOrigin) -> Message:
    """Sets the origin of its local frame."""
    return dialect.MAVLink_set_gps_global_origin_message(
        to.system, *to_steps(origin.place), round(origin.alt * 1000)
    )


def position_setpoint(to: Who, position: Point, *, down: float, now_ms: int) -> Message:
    """Setpoint to drive to a position: metres north and east of its origin."""
    return _setpoint(to, POSITION_ONLY, position, down, 0.0, now_ms)


def yaw_setpoint(to: Who, yaw: float, *, down: float, now_ms: int) -> Message:
    """Setpoint to turn on the spot: radians clockwise from north."""
    return _setpoint(to, YAW_ONLY, (0.0, 0.0), down, yaw, now_ms)


def course_setpoint(to: Who, velocity: Point, yaw: float, *, down: float, now_ms: int) -> Message:
    """Setpoint of a velocity, whose two numbers each autopilot reads in its own frame, and a yaw."""
    return _setpoint(to, COURSE, (0.0, 0.0), down, yaw, now_ms, velocity)


def _setpoint(
    to: Who, mask: int, position: Point, down: float, yaw: float, now_ms: int, velocity: Point = (0.0, 0.0)
) -> Message:
    return dialect.MAVLink_set_position_target_local_ned_message(
        now_ms & 0xFFFFFFFF, to.system, to.component, dialect.MAV_FRAME_LOCAL_NED, mask,
        *position, down, *velocity, *(0.0,) * 4, yaw, 0.0,
    )  # fmt: skip


def item_message(item: Item, seq: int, to: Who) -> Message:
    """The MISSION_ITEM_INT that carries an item."""
    return dialect.MAVLink_mission_item_int_message(
        to.system, to.component, seq, item.frame, item.command, 0, int(item.autocontinue),
        *item.params, item.x, item.y, item.z, MISSION,
    )  # fmt: skip


def item_of(message: Message) -> Item:
    """The item in a MISSION_ITEM_INT."""
    return Item(
        command=message.command,
        frame=message.frame,
        params=(message.param1, message.param2, message.param3, message.param4),
        x=message.x,
        y=message.y,
        z=message.z,
        autocontinue=bool(message.autocontinue),
    )


def count_message(count: int, to: Who) -> Message:
    return dialect.MAVLink_mission_count_message(to.system, to.component, count, MISSION)


def list_request(to: Who) -> Message:
    return dialect.MAVLink_mission_request_list_message(to.system, to.component, MISSION)


def item_request(seq: int, to: Who) -> Message:
    return dialect.MAVLink_mission_request_int_message(to.system, to.component, seq, MISSION)


def ack_message(result: int, to: Who) -> Message:
    return dialect.MAVLink_mission_ack_message(to.system, to.component, result, MISSION)


def clear_all(to: Who) -> Message:
    return dialect.MAVLink_mission_clear_all_message(to.system, to.component, MISSION)


def of_mission(message: Message) -> bool:
    """True if a message of the mission protocol is about the mission."""
    return bool(message.mission_type == MISSION)


def warning(text: str, *, system: int) -> bytes:
    """A STATUSTEXT for people, in the name of the computer on that vehicle; at most 50 letters arrive."""
    speaker: Any = dialect.MAVLink(None, srcSystem=system, srcComponent=dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
    message = dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_WARNING, text[:50].encode())
    return bytes(message.pack(speaker))


def is_signed(message: Message) -> bool:
    return bool(message.get_header().incompat_flags & dialect.MAVLINK_IFLAG_SIGNED)


def message_name(message: int) -> str:
    """Name of a message, such as "GPS_GLOBAL_ORIGIN"."""
    return str(dialect.mavlink_map[message].msgname)


def enum_name(enum: str, number: int) -> str:
    """Name of a value, such as "DENIED" for 2 of MAV_RESULT; the number itself if it has no name."""
    entry = dialect.enums[enum].get(number)
    return str(number) if entry is None else entry.name.removeprefix(f"{enum}_")


def result_name(result: int) -> str:
    """Name of a MAV_MISSION_RESULT, such as "INVALID_PARAM1"."""
    return enum_name("MAV_MISSION_RESULT", result).removeprefix("MAV_MISSION_")
