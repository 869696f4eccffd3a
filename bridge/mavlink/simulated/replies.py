"""Messages of the simulated vehicle to one station, or to people."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import Any

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import item_of
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.mavlink.fields import PLACED
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message

STEPPED = PLACED | frozenset(range(5000, 5005)) | {5100}
"""Commands whose x and y are degrees."""
INT32 = 2**31 - 1


def command_ack(to: Who, command: int, result: int) -> Message:
    return dialect.MAVLink_command_ack_message(
        command, result, target_system=to.system, target_component=to.component
    )


def message_interval(number: int, interval_us: int) -> Message:
    return dialect.MAVLink_message_interval_message(number, interval_us)


def text(content: str) -> Message:
    """A text for people; at most 50 letters arrive."""
    return dialect.MAVLink_statustext_message(dialect.MAV_SEVERITY_NOTICE, content.encode()[:50])


def parameter(name: str, value: float, *, index: int, count: int) -> Message:
    return dialect.MAVLink_param_value_message(
        name.encode(), value, dialect.MAV_PARAM_TYPE_REAL32, count, index
    )


def item_wanted(to: Who, kind: int, number: int, *, as_int: bool) -> Message:
    """A request for an item of an upload."""
    asking = (
        dialect.MAVLink_mission_request_int_message if as_int else dialect.MAVLink_mission_request_message
    )
    return asking(to.system, to.component, number, kind)


def mission_ack(to: Who, kind: int, result: int) -> Message:
    return dialect.MAVLink_mission_ack_message(to.system, to.component, result, kind)


def mission_count(to: Who, kind: int, count: int) -> Message:
    return dialect.MAVLink_mission_count_message(to.system, to.component, count, kind)


def item_int(to: Who, kind: int, number: int, item: Item) -> Message:
    return _item(dialect.MAVLink_mission_item_int_message, to, kind, number, item, item.x, item.y)


def item_float(to: Who, kind: int, number: int, item: Item) -> Message:
    """The old MISSION_ITEM: x and y are degrees where the command has a position."""
    scale = STEPS_PER_DEGREE if item.command in STEPPED else 1
    return _item(dialect.MAVLink_mission_item_message, to, kind, number, item, item.x / scale, item.y / scale)


def _item(made: Any, to: Who, kind: int, number: int, item: Item, x: float, y: float) -> Message:
    return made(
        to.system, to.component, number, item.frame, item.command, 0, int(item.autocontinue), *item.params,
        x, y, item.z, kind,
    )  # fmt: skip


def received_item(message: Message) -> Item:
    """The item in a MISSION_ITEM_INT, or in the old MISSION_ITEM: degrees in float32, good to a metre."""
    item = item_of(message)
    if message.get_type() != "MISSION_ITEM":
        return item
    scale = STEPS_PER_DEGREE if message.command in STEPPED else 1
    return replace(item, x=_whole(message.x * scale), y=_whole(message.y * scale))


def _whole(value: float) -> int:
    """The nearest int32; a value that is no position becomes the one farthest off the earth."""
    return round(value) if math.isfinite(value) and abs(value) <= INT32 else INT32


def picture(
    index: int,
    *,
    boot_ms: int,
    now_ns: int,
    place: tuple[int, int],
    alt_mm: int,
    heading: float,
    file_url: str,
) -> Message:
    """A camera's report of a picture; `heading` is counter-clockwise from east. No file means a failure."""
    half = math.pi / 4 - heading / 2
    facing = (math.cos(half), 0.0, 0.0, math.sin(half))
    return dialect.MAVLink_camera_image_captured_message(
        boot_ms, now_ns // 1000, 0, *place, alt_mm, 0, facing, index, 1 if file_url else 0, file_url.encode()
    )


class MissionCurrentWithId(dialect.MAVLink_mission_current_message):
    """MISSION_CURRENT with its newer fields, which the dialect lacks: ids of mission, fence and rally."""

    number = 0

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        fields = (self.seq, self.total, self.mission_state, self.mission_mode, self.number, 0, 0)
        payload = struct.pack("<HHBBIII", *fields)
        return bytes(self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1))


def mission_current(seq: int, total: int, state: int, mode: int, *, number: int) -> Message:
    """Current item, with the id of the list."""
    message = MissionCurrentWithId(seq, total, state, mode)
    message.number = number
    return message
