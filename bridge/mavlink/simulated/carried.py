"""Items in and out of the messages that carry them."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from bridge.mavlink.line.wire import Message, Who
from mission.geodesy import STEPS_PER_DEGREE
from mission.mavlink.fields import PLACED
from mission.mavlink.items import Item

STEPPED = PLACED | frozenset(range(5000, 5005)) | {5100}
"""Commands whose x and y are degrees."""
INT32 = 2**31 - 1


def item_of(message: Message) -> Item:
    """The item in a MISSION_ITEM_INT, or in the old MISSION_ITEM: degrees in float32, good to a metre."""
    x, y = message.x, message.y
    if message.get_type() == "MISSION_ITEM":
        scale = STEPS_PER_DEGREE if message.command in STEPPED else 1
        x, y = _whole(x * scale), _whole(y * scale)
    return Item(
        message.command, message.frame, (message.param1, message.param2, message.param3, message.param4),
        x, y, message.z, autocontinue=bool(message.autocontinue),
    )  # fmt: skip


def int_message(who: Who, kind: int, number: int, item: Item) -> Message:
    return _message_of(dialect.MAVLink_mission_item_int_message, who, kind, number, item, item.x, item.y)


def float_message(who: Who, kind: int, number: int, item: Item) -> Message:
    scale = STEPS_PER_DEGREE if item.command in STEPPED else 1
    x, y = item.x / scale, item.y / scale
    return _message_of(dialect.MAVLink_mission_item_message, who, kind, number, item, x, y)


def _message_of(made: Any, who: Who, kind: int, number: int, item: Item, x: float, y: float) -> Message:
    return made(
        who.system, who.component, number, item.frame, item.command, 0, int(item.autocontinue), *item.params,
        x, y, item.z, kind,
    )  # fmt: skip


def _whole(value: float) -> int:
    """The nearest int32; what is no place is as far off the earth as it can be."""
    return round(value) if math.isfinite(value) and abs(value) <= INT32 else INT32
