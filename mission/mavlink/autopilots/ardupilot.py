"""ArduPilot Rover.

"Measured" means on Rover 4.7-dev; "source" means read in its code: AP_Mission.cpp
(`mavlink_int_to_mission_cmd`, `mission_cmd_to_mavlink_int`), GCS_MAVLink, AR_WPNav and Rover's modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from stopgo.mission.mavlink.autopilots.kind import (
    EVERYWHERE,
    ROVERS,
    Autopilot,
    Driving,
    Heartbeat,
    Mode,
    Modes,
    ParameterRule,
    ProtocolBehaviour,
    Steering,
)
from stopgo.mission.mavlink.enums import CommandResult, Firmware, MissionResult, ModeFlag, VehicleType
from stopgo.mission.mavlink.fields import (
    PLACED,
    Field,
    as_sent,
    centimetres,
    dropped,
    float16,
    int8,
    int16,
    same,
    uint8,
    uint16,
    whole,
)
from stopgo.mission.mavlink.items import Command, Item, MavFrame

CUSTOM, MANUAL = ModeFlag.CUSTOM_MODE_ENABLED, ModeFlag.MANUAL_INPUT_ENABLED
STABILIZE, GUIDED, AUTO = ModeFlag.STABILIZE_ENABLED, ModeFlag.GUIDED_ENABLED, ModeFlag.AUTO_ENABLED
AUTO_OF_COPTERS = 3
"""The number of copters and submarines; planes and rovers have another."""


def keeps(item: Item) -> Item:
    """Return the item as ArduPilot stores it; an unknown command's numbers are assumed to stay."""
    item = as_sent(item)
    one, two, three, four = (
        field(param) for field, param in zip(FIELDS.get(item.command, ALL), item.params, strict=True)
    )
    item = replace(item, params=(one, two, three, four), autocontinue=True)  # measured: always 1
    if item.command in PLACED:  # z: measured
        return replace(item, frame=FRAMES.get(item.frame, item.frame), z=centimetres(item.z))
    if item.command == Command.NAV_SCRIPT_TIME:  # measured: x, y are kept, as int16
        return replace(item, frame=MavFrame.MISSION, x=int16(item.x), y=int16(item.y), z=0.0)
    if item.command in FIELDS:  # measured: nothing but the params is kept
        return replace(item, frame=MavFrame.MISSION, x=0, y=0, z=0.0)
    return item


Fields = tuple[Field, Field, Field, Field]
ALL: Fields = (same, same, same, same)
FIELDS: dict[int, Fields] = {
    Command.NAV_WAYPOINT: (uint16, dropped, dropped, dropped),  # measured
    Command.NAV_DELAY: (same, int8, int8, int8),  # p1 measured; p2-p4 are hour, minute, second (source)
    Command.DO_CHANGE_SPEED: (uint8, same, same, dropped),  # source
    Command.DO_SET_RELAY: (uint8, uint8, dropped, dropped),  # measured: integers
    Command.DO_SET_SERVO: (uint8, uint16, dropped, dropped),  # measured: integers
    Command.DO_SEND_SCRIPT_MESSAGE: (uint16, same, same, same),  # measured
    Command.IMAGE_START_CAPTURE: (uint8, whole, uint16, uint16),  # measured: integers
    Command.NAV_SCRIPT_TIME: (uint8, uint8, float16, float16),  # measured
}
FRAMES = {
    MavFrame.MISSION: MavFrame.GLOBAL,
    MavFrame.GLOBAL_INT: MavFrame.GLOBAL,
    MavFrame.GLOBAL_RELATIVE_ALT_INT: MavFrame.GLOBAL_RELATIVE_ALT,
    MavFrame.GLOBAL_TERRAIN_ALT_INT: MavFrame.GLOBAL_TERRAIN_ALT,
}
"""Measured. The frames of local coordinates are refused: UNSUPPORTED_FRAME."""


def in_auto(heartbeat: Heartbeat) -> bool:
    rolls = heartbeat.type in (*ROVERS, VehicleType.FIXED_WING)
    return heartbeat.custom_mode == (MODES.auto.main if rolls else AUTO_OF_COPTERS)


MODES = Modes(
    numbers={"manual": Mode(0), "hold": Mode(4), "auto": Mode(10), "guided": Mode(15)},
    flags={
        "manual": CUSTOM | MANUAL, "hold": CUSTOM,
        "auto": CUSTOM | STABILIZE | GUIDED | AUTO, "guided": CUSTOM | STABILIZE | GUIDED,
    },
    names={
        Mode(0): "MANUAL", Mode(1): "ACRO", Mode(3): "STEERING", Mode(4): "HOLD", Mode(5): "LOITER",
        Mode(6): "FOLLOW", Mode(7): "SIMPLE", Mode(8): "DOCK", Mode(9): "CIRCLE", Mode(10): "AUTO",
        Mode(11): "RTL", Mode(12): "SMART_RTL", Mode(15): "GUIDED", Mode(16): "INITIALISING",
    },
    packed=False,
)  # fmt: skip

# Source (Rover/mode_guided.cpp): it stays at its last place whatever becomes of us; set_desired_speed counts
# only while it drives to a place, so that is sent first; a yaw alone is followed for 3 s and then stops it
# (GUID_TIMEOUT: Copter's, and Rover's since late 4.8-dev; releases up to 4.7 have none).
DRIVING = Driving(
    streams=False, gives_up_s=3.0, gives_up_parameter="GUID_TIMEOUT", turns=True, courses="heading",
    reposition_mode="guided",
)  # fmt: skip

BEHAVIOUR = ProtocolBehaviour(
    asks_int=False, ask_again_s=1.0, give_up_s=8.0, tells_giving_up=True, atomic=False, strays="tell",
    last_again=MissionResult.ERROR, forgives_late=False, other_station=MissionResult.DENIED,
    busy_in_words=False, begins_again=True, cancels=False, clears_in_auto=False, counts_again=True,
    restarts_item=True, same_is_nothing=False, checks_frame_first=False,
    highest_m=83_000,  # source: LOCATION_ALT_MAX_M
    takes=EVERYWHERE | {
        18, 30, 31, 82, 84, 85, 92, 94, 114, 115, 177, 179, 181, 182, 183, 184, 189, 194, 195, 197, 201, 205,
        206, 207, 208, 209, 210, 211, 212, 213, 217, 218, 222, 223, 1000, 42702,
    },
    done_mode="auto", pauses=False, origin_again=False, says_no=CommandResult.FAILED, modes_by_flags=False,
    acknowledges_set_mode=True, mission_ids=False,
    jumps_by_command=True, start_takes_item=False, start_arms=False,
    pauses_by_command=False,
    speed_while_driving=True,  # source
    speed_parameter="WP_SPEED", system_parameter="SYSID_THISMAV",
)  # fmt: skip

LEFT_OUT = "checks before arming that are left out are not made up for here"
PARAMETERS = (
    ParameterRule(
        ("FRAME_CLASS",), lambda v: v == 1, "1 (rover)", "other frames drive differently", must=False
    ),
    ParameterRule(
        ("GPS1_TYPE", "GPS_TYPE"),
        lambda v: v == 0,
        "0",
        "no satellites indoors, and no false fixes at windows",
        when="indoors",
    ),
    ParameterRule(
        ("VISO_TYPE",),
        lambda v: v in (1, 2, 3),
        "1 (MAVLink)",
        "it takes ODOMETRY from the robot's localisation",
        when="indoors",
    ),
    ParameterRule(("AHRS_EKF_TYPE",), lambda v: v == 3, "3", "the filter that can use it", when="indoors"),
    ParameterRule(("EK3_ENABLE",), lambda v: v == 1, "1", "the filter that can use it", when="indoors"),
    ParameterRule(
        ("EK3_SRC1_POSXY",),
        lambda v: v == 6,
        "6 (external)",
        "its position comes from the localisation",
        when="indoors",
    ),
    ParameterRule(
        ("EK3_SRC1_VELXY",),
        lambda v: v in (0, 6, 7),
        "6 (external)",
        "no satellites measure its speed",
        when="indoors",
    ),
    ParameterRule(
        ("EK3_SRC1_YAW",),
        lambda v: v in (1, 6),
        "6 (external), or 1 (compass)",
        "steel in floors bends a compass: 6 where the localisation gives the heading",
        when="indoors",
    ),
    ParameterRule(("WP_RADIUS",), lambda v: v <= 0.1, "0.05", "within it a stop counts as reached"),
    ParameterRule(
        ("WP_PIVOT_ANGLE",),
        lambda v: 0 < v <= 60,
        "60 or less, skid steering only",
        "it turns on the spot at corners",
        must=False,
    ),
    ParameterRule(
        ("GUID_TIMEOUT",),
        lambda v: v <= 0.5,
        "0.5",
        "a gateway's vehicle drives on for so long without its computer or link (none before 4.8: 3 s)",
        must=False,
    ),
    ParameterRule(
        ("MIS_RESTART",), lambda v: v == 0, "0", "AUTO goes on where it was, not from the beginning"
    ),
    ParameterRule(
        ("SCR_ENABLE",), lambda v: v == 1, "1", "a script on the vehicle starts the scanner", must=False
    ),
    ParameterRule(
        ("FS_GCS_ENABLE",),
        lambda v: v == 0,
        "0",
        "else it stops or goes home at a link loss, whatever the mission's link_loss says",
        must=False,
    ),
    ParameterRule(
        ("ARMING_SKIPCHK",),
        lambda v: v == 0,
        "0",
        LEFT_OUT,
        must=False,
        before=ParameterRule(("ARMING_CHECK",), lambda v: v == 1, "1", LEFT_OUT, must=False),  # until 4.6
    ),
)

GROUND_STEERING, THROTTLE_LEFT, THROTTLE_RIGHT = 26, 73, 74
"""Functions of servo outputs."""


def car_steering(values: Mapping[str, float]) -> str:
    """Source (AP_MotorsUGV::have_skid_steering): with an output for each side it turns on the spot."""
    found = {int(value): name for name, value in values.items() if name in SERVOS}
    if GROUND_STEERING not in found or {THROTTLE_LEFT, THROTTLE_RIGHT} <= found.keys():
        return ""
    return f"{found[GROUND_STEERING]} is {GROUND_STEERING}, ground steering"


SERVOS = tuple(f"SERVO{number}_FUNCTION" for number in range(1, 17))

# Source: get_next_nav_cmd gives a waypoint without hold its next leg, and AR_WPNav then calls it reached when
# the moving target passes it ("fast waypoint"), the robot being behind or cutting the corner. With a hold of
# a second or more it stops there first. Delays are milliseconds in uint32 (mode_auto.cpp). Measured: more
# than int16 seconds of hold are kept, and run as 0; whatever item is asked for is given.
ARDUPILOT = Autopilot(
    name="ardupilot", firmware=Firmware.ARDUPILOTMEGA, rule="ardupilot",
    frame=MavFrame.GLOBAL_RELATIVE_ALT_INT, max_items=655, home_first=True,
    commands=frozenset({
        Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.NAV_SCRIPT_TIME,
        Command.DO_SEND_SCRIPT_MESSAGE, Command.IMAGE_START_CAPTURE,
    }),
    keep=keeps, brake_hold_s=1, longest_hold_s=32_767, max_delay_s=4_294_967.0, keeps_arrival=False,
    radius_parameter="WP_RADIUS",
    reached="within its parameter WP_RADIUS, or once past it", turns=False, gives_items="any order",
    modes=MODES, in_auto=in_auto, driving=DRIVING, drivable=True, behaviour=BEHAVIOUR,
    steering=Steering(SERVOS, car_steering),
    parameters=PARAMETERS,
)  # fmt: skip
