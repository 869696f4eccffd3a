"""Numbers of MAVLink's enumerations that are used here, from the common dialect and ArduPilot's."""

from __future__ import annotations

from enum import IntEnum, IntFlag


class Firmware(IntEnum):
    """MAV_AUTOPILOT."""

    GENERIC = 0
    ARDUPILOTMEGA = 3
    INVALID = 8
    PX4 = 12


class VehicleType(IntEnum):
    """MAV_TYPE."""

    FIXED_WING = 1
    GCS = 6
    GROUND_ROVER = 10
    SURFACE_BOAT = 11
    ONBOARD_CONTROLLER = 18


class ModeFlag(IntFlag):
    """MAV_MODE_FLAG."""

    CUSTOM_MODE_ENABLED = 1
    AUTO_ENABLED = 4
    GUIDED_ENABLED = 8
    STABILIZE_ENABLED = 16
    MANUAL_INPUT_ENABLED = 64
    SAFETY_ARMED = 128


class SystemState(IntEnum):
    """MAV_STATE, the values used here."""

    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT: the answer to a message of the mission protocol."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


class CommandResult(IntEnum):
    """MAV_RESULT: the answer to a command."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    IN_PROGRESS = 5
    COMMAND_INT_ONLY = 8


class MissionState(IntEnum):
    """MISSION_STATE, as in MISSION_CURRENT."""

    UNKNOWN = 0
    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class Component(IntEnum):
    """MAV_COMP_ID."""

    AUTOPILOT1 = 1
    CAMERA = 100
    MISSIONPLANNER = 190
    ONBOARD_COMPUTER = 191
    UDP_BRIDGE = 240


class MessageId(IntEnum):
    """Numbers of requested messages."""

    HEARTBEAT = 0
    SYS_STATUS = 1
    SYSTEM_TIME = 2
    SET_MODE = 11
    GPS_RAW_INT = 24
    ATTITUDE = 30
    LOCAL_POSITION_NED = 32
    GLOBAL_POSITION_INT = 33
    MISSION_CURRENT = 42
    MISSION_ITEM_REACHED = 46
    GPS_GLOBAL_ORIGIN = 49
    RC_CHANNELS = 65
    VFR_HUD = 74
    RADIO_STATUS = 109
    BATTERY_STATUS = 147
    AUTOPILOT_VERSION = 148
    FENCE_STATUS = 162
    EKF_STATUS_REPORT = 193
    ESTIMATOR_STATUS = 230
    HOME_POSITION = 242
    EXTENDED_SYS_STATE = 245
    CAMERA_INFORMATION = 259
    CAMERA_CAPTURE_STATUS = 262
    CAMERA_IMAGE_CAPTURED = 263
