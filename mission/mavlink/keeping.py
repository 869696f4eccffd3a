"""What a vehicle keeps of an item: the item as it will be read back.

Every number passes through float32 on the wire. "Measured" below means on ArduPilot Rover 4.7-dev;
"source" means read in AP_Mission.cpp (`mavlink_int_to_mission_cmd`, `mission_cmd_to_mavlink_int`) or in
PX4's mavlink_mission.cpp (`parse_mavlink_mission_item`, `format_mavlink_mission_item`).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import replace

from mission.mavlink.items import Command, Frame, Item

Field = Callable[[float], float]
Params = tuple[float, float, float, float]


def as_sent(item: Item) -> Item:
    """The item as it arrives: real numbers rounded to float32."""
    one, two, three, four = (float32(param) for param in item.params)
    return replace(item, params=(one, two, three, four), z=float32(item.z))


def ardupilot_keeps(item: Item) -> Item:
    """What ArduPilot stores of an item; an unknown command's numbers are taken to stay."""
    item = as_sent(item)
    one, two, three, four = (
        field(param)
        for field, param in zip(_ARDUPILOT_FIELDS.get(item.command, _ALL), item.params, strict=True)
    )
    item = replace(item, params=(one, two, three, four), autocontinue=True)  # measured: always 1
    if item.command in PLACED:
        return replace(item, frame=_ARDUPILOT_FRAMES.get(item.frame, item.frame), z=_centimetres(item.z))
    if item.command == Command.NAV_SCRIPT_TIME:  # measured: x, y are kept, as int16
        return replace(item, frame=Frame.MISSION, x=_int16(item.x), y=_int16(item.y), z=0.0)
    if item.command in _ARDUPILOT_FIELDS:  # measured: nothing but the params is kept
        return replace(item, frame=Frame.MISSION, x=0, y=0, z=0.0)
    return item


def px4_keeps(item: Item) -> Item:
    """What PX4 stores of an item (source): all of one without a place, and hold, radius, yaw of one with."""
    item = as_sent(item)
    if item.frame == Frame.MISSION or item.command != Command.NAV_WAYPOINT:
        return item
    hold, radius, _, yaw = item.params
    frame = _PX4_FRAMES.get(item.frame, item.frame)
    return replace(item, frame=frame, params=(hold, radius, 0.0, float32(yaw % 360.0) % 360.0))


def float32(value: float) -> float:
    """The nearest number a float32 holds; beyond its range, infinity."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def _float16(value: float) -> float:
    try:
        return float(struct.unpack("<e", struct.pack("<e", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def _same(value: float) -> float:
    return value


def _dropped(_: float) -> float:
    return 0.0


def _whole(value: float) -> float:
    """Towards zero, as a C cast does; what is no number stays, for the vehicle refuses it."""
    return float(int(value)) if math.isfinite(value) else value


def _uint16(value: float) -> float:
    """Measured: 2.9 becomes 2 and 100 000 becomes 34 464."""
    return float(int(value) & 0xFFFF) if math.isfinite(value) else value


def _uint8(value: float) -> float:
    return float(int(value) & 0xFF) if math.isfinite(value) else value


def _int8(value: float) -> float:
    return float((int(value) + 0x80 & 0xFF) - 0x80) if math.isfinite(value) else value


def _int16(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000


def _centimetres(metres: float) -> float:
    """Measured: z is truncated to whole centimetres, in float32 (metres × 100, then × 0.01)."""
    if not math.isfinite(float32(metres * 100.0)):
        return metres
    return float32(int(float32(metres * 100.0)) * float32(0.01))


PLACED = frozenset({16, 17, 18, 19, 21, 22, 30, 31, 82, 84, 85, 94, 179, 189, 195, 201})
"""Commands whose x and y are a latitude and a longitude."""

_ALL: tuple[Field, Field, Field, Field] = (_same, _same, _same, _same)

_ARDUPILOT_FIELDS: dict[int, tuple[Field, Field, Field, Field]] = {
    Command.NAV_WAYPOINT: (_uint16, _dropped, _dropped, _dropped),  # measured
    Command.NAV_DELAY: (_same, _int8, _int8, _int8),  # p1 measured; p2-p4 are hour, minute, second (source)
    Command.DO_CHANGE_SPEED: (_uint8, _same, _same, _dropped),  # source
    Command.DO_SET_RELAY: (_uint8, _uint8, _dropped, _dropped),  # measured: integers
    Command.DO_SET_SERVO: (_uint8, _uint16, _dropped, _dropped),  # measured: integers
    Command.DO_SEND_SCRIPT_MESSAGE: (_uint16, _same, _same, _same),  # measured
    Command.IMAGE_START_CAPTURE: (_uint8, _whole, _uint16, _uint16),  # measured: integers
    Command.NAV_SCRIPT_TIME: (_uint8, _uint8, _float16, _float16),  # measured
}

_ARDUPILOT_FRAMES = {
    Frame.MISSION: Frame.GLOBAL,
    Frame.GLOBAL_INT: Frame.GLOBAL,
    Frame.GLOBAL_RELATIVE_ALT_INT: Frame.GLOBAL_RELATIVE_ALT,
    Frame.GLOBAL_TERRAIN_ALT_INT: Frame.GLOBAL_TERRAIN_ALT,
}
"""Measured. The frames of local coordinates are refused: UNSUPPORTED_FRAME."""

_PX4_FRAMES = {
    Frame.GLOBAL: Frame.GLOBAL_INT,
    Frame.GLOBAL_RELATIVE_ALT: Frame.GLOBAL_RELATIVE_ALT_INT,
}
"""Source: PX4 answers requests for MISSION_ITEM_INT with the INT frames."""
