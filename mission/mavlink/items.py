"""One MAVLink mission item, and the list of them that a vehicle holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mission.document import SiteOrigin

Role = Literal["home", "corner", "stop", "settle", "trigger", "scan", "return", "other"]
"""What an item does in a mission of scan stops."""

NAN = float("nan")


class Command:
    """MAV_CMD numbers that are used here."""

    NAV_WAYPOINT = 16
    NAV_DELAY = 93
    DO_CHANGE_SPEED = 178
    DO_SET_MISSION_CURRENT = 224
    DO_SEND_SCRIPT_MESSAGE = 217
    IMAGE_START_CAPTURE = 2000
    NAV_SCRIPT_TIME = 42702


class Frame:
    """MAV_FRAME numbers that are used here."""

    GLOBAL = 0
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


@dataclass(frozen=True)
class Item:
    """The fields of MISSION_ITEM_INT that say what to do.

    `x` and `y` are latitude and longitude in steps of 1e-7 degrees where the command has a place, else
    plain numbers; `params` are param1 to param4; NaN in them means "not said".
    """

    command: int
    frame: int
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: bool = True


@dataclass(frozen=True)
class Placed:
    """An item and what it is for."""

    item: Item
    role: Role
    stop: str | None = None
    """Id of the scan stop it belongs to."""


@dataclass(frozen=True)
class ItemList:
    """What is sent to one autopilot: its items in order, without home.

    ArduPilot's item 0 is home, which the uploader puts in front: there item `i` has sequence number
    `i + 1`, elsewhere `i`.
    """

    autopilot: str
    origin: SiteOrigin
    placed: tuple[Placed, ...]

    @property
    def items(self) -> tuple[Item, ...]:
        return tuple(placed.item for placed in self.placed)
