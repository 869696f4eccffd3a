"""Mission items as messages, and back: here end the names of MAVLink's fields."""

from __future__ import annotations

from bridge.mavlink.line.peer import enum_name
from bridge.mavlink.line.wire import Message, Who, dialect
from mission.mavlink.items import Item

MISSION = dialect.MAV_MISSION_TYPE_MISSION
"""Not the fence and not the rally points, which go by the same protocol."""


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


def of_mission(message: Message) -> bool:
    """Whether a message of the mission protocol is about the mission."""
    return bool(message.mission_type == MISSION)


def result_name(result: int) -> str:
    """As in "INVALID_PARAM1"."""
    return enum_name("MAV_MISSION_RESULT", result).removeprefix("MAV_MISSION_")
