"""One MAVLink mission item, and the item list of a vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stopgo.mission.frames.transform import SiteOrigin

ItemRole = Literal["home", "speed", "corner", "stop", "settle", "trigger", "scan", "return", "other"]
"""Role of an item in a mission of scan stops."""

NAN = float("nan")


class Command:
    """MAV_CMD numbers that are used here."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_DELAY = 93
    DO_SET_MODE = 176
    DO_CHANGE_SPEED = 178
    DO_SET_RELAY = 181
    DO_SET_SERVO = 183
    DO_FLIGHTTERMINATION = 185
    DO_REPOSITION = 192
    DO_PAUSE_CONTINUE = 193
    DO_DIGICAM_CONTROL = 203
    DO_SEND_SCRIPT_MESSAGE = 217
    DO_SET_MISSION_CURRENT = 224
    PREFLIGHT_REBOOT_SHUTDOWN = 246
    MISSION_START = 300
    COMPONENT_ARM_DISARM = 400
    RUN_PREARM_CHECKS = 401
    GET_HOME_POSITION = 410
    GET_MESSAGE_INTERVAL = 510
    SET_MESSAGE_INTERVAL = 511
    REQUEST_MESSAGE = 512
    REQUEST_PROTOCOL_VERSION = 519
    REQUEST_AUTOPILOT_CAPABILITIES = 520
    REQUEST_CAMERA_INFORMATION = 521
    REQUEST_CAMERA_CAPTURE_STATUS = 527
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    NAV_SCRIPT_TIME = 42702


NAMES = {
    16: "NAV_WAYPOINT",
    17: "NAV_LOITER_UNLIM",
    18: "NAV_LOITER_TURNS",
    19: "NAV_LOITER_TIME",
    20: "NAV_RETURN_TO_LAUNCH",
    21: "NAV_LAND",
    22: "NAV_TAKEOFF",
    82: "NAV_SPLINE_WAYPOINT",
    84: "NAV_VTOL_TAKEOFF",
    85: "NAV_VTOL_LAND",
    92: "NAV_GUIDED_ENABLE",
    93: "NAV_DELAY",
    112: "CONDITION_DELAY",
    114: "CONDITION_DISTANCE",
    115: "CONDITION_YAW",
    177: "DO_JUMP",
    178: "DO_CHANGE_SPEED",
    179: "DO_SET_HOME",
    181: "DO_SET_RELAY",
    183: "DO_SET_SERVO",
    187: "DO_SET_ACTUATOR",
    189: "DO_LAND_START",
    194: "DO_SET_REVERSE",
    195: "DO_SET_ROI_LOCATION",
    197: "DO_SET_ROI_NONE",
    201: "DO_SET_ROI",
    203: "DO_DIGICAM_CONTROL",
    205: "DO_MOUNT_CONTROL",
    206: "DO_SET_CAM_TRIGG_DIST",
    211: "DO_GRIPPER",
    213: "NAV_SET_YAW_SPEED",
    217: "DO_SEND_SCRIPT_MESSAGE",
    224: "DO_SET_MISSION_CURRENT",
    530: "SET_CAMERA_MODE",
    1000: "DO_GIMBAL_MANAGER_PITCHYAW",
    2000: "IMAGE_START_CAPTURE",
    2001: "IMAGE_STOP_CAPTURE",
    2003: "DO_TRIGGER_CONTROL",
    2500: "VIDEO_START_CAPTURE",
    2501: "VIDEO_STOP_CAPTURE",
    3000: "DO_VTOL_TRANSITION",
    42702: "NAV_SCRIPT_TIME",
}
"""Names of the commands that mission lists hold in practice, without the prefix MAV_CMD_."""


class MavFrame:
    """MAV_FRAME numbers that are used here."""

    GLOBAL = 0
    LOCAL_NED = 1
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6
    LOCAL_OFFSET_NED = 7
    GLOBAL_TERRAIN_ALT = 10
    GLOBAL_TERRAIN_ALT_INT = 11


@dataclass(frozen=True)
class Item:
    """The fields of MISSION_ITEM_INT that describe the command.

    `x` and `y` are latitude and longitude in steps of 1e-7 degrees if the command has a position, else
    plain numbers; `params` are param1 to param4; NaN in them means "not given".
    """

    command: int
    frame: int
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: bool = True

    @property
    def name(self) -> str:
        """Name and number of the command: "NAV_DELAY (93)"."""
        return f"{NAMES.get(self.command, 'command')} ({self.command})"


@dataclass(frozen=True)
class Placed:
    """An item and its role."""

    item: Item
    role: ItemRole
    stop: str | None = None
    """Id of the scan stop it belongs to."""


@dataclass(frozen=True)
class ItemList:
    """Items for one autopilot in order, without home.

    ArduPilot's item 0 is home, which the uploader puts in front: there item `i` has sequence number
    `i + 1`, elsewhere `i`.
    """

    autopilot: str
    origin: SiteOrigin
    placed: tuple[Placed, ...]
    notes: tuple[str, ...] = ()
    """Parts of the mission that an autopilot does not execute itself, a line each."""

    @property
    def items(self) -> tuple[Item, ...]:
        return tuple(placed.item for placed in self.placed)
