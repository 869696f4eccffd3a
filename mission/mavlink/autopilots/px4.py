"""PX4 on a rover.

"Source" means read in its code: mavlink_mission.cpp (`parse_mavlink_mission_item`,
`format_mavlink_mission_item`), Mission, MissionBlock, navigation.h; the rest is its documentation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from stopgo.mission.mavlink.autopilots.kind import (
    EVERYWHERE,
    Autopilot,
    Driving,
    Heartbeat,
    Mode,
    Modes,
    ParameterRule,
    ProtocolBehaviour,
    Steering,
)
from stopgo.mission.mavlink.enums import CommandResult, Firmware, MissionResult, ModeFlag
from stopgo.mission.mavlink.fields import as_sent, float32
from stopgo.mission.mavlink.items import Command, Item, MavFrame

CUSTOM, MANUAL = ModeFlag.CUSTOM_MODE_ENABLED, ModeFlag.MANUAL_INPUT_ENABLED
STABILIZE, GUIDED, AUTO = ModeFlag.STABILIZE_ENABLED, ModeFlag.GUIDED_ENABLED, ModeFlag.AUTO_ENABLED


def keeps(item: Item) -> Item:
    """Return the item as PX4 stores it (source): all without a position; hold, radius, yaw with one."""
    item = as_sent(item)
    if item.frame == MavFrame.MISSION or item.command != Command.NAV_WAYPOINT:
        return item
    hold, radius, _, yaw = item.params
    frame = FRAMES.get(item.frame, item.frame)
    return replace(item, frame=frame, params=(hold, radius, 0.0, float32(yaw % 360.0) % 360.0))


FRAMES = {
    MavFrame.GLOBAL: MavFrame.GLOBAL_INT,
    MavFrame.GLOBAL_RELATIVE_ALT: MavFrame.GLOBAL_RELATIVE_ALT_INT,
}
"""Source: it answers requests for MISSION_ITEM_INT with the INT frames."""


def in_auto(heartbeat: Heartbeat) -> bool:
    return MODES.of(heartbeat.custom_mode) == MODES.auto


MODES = Modes(
    numbers={"manual": Mode(1), "hold": Mode(4, 3), "auto": Mode(4, 4), "guided": Mode(6)},
    flags={
        "manual": CUSTOM | MANUAL, "hold": CUSTOM | STABILIZE | GUIDED | AUTO,
        "auto": CUSTOM | STABILIZE | GUIDED | AUTO, "guided": CUSTOM | STABILIZE | GUIDED,
    },
    names={
        Mode(1): "MANUAL", Mode(2): "ALTITUDE", Mode(3): "POSITION", Mode(4): "AUTO", Mode(5): "ACRO",
        Mode(6): "OFFBOARD", Mode(7): "STABILIZED",
        Mode(4, 2): "TAKEOFF", Mode(4, 3): "HOLD", Mode(4, 4): "MISSION", Mode(4, 5): "RETURN",
        Mode(4, 6): "LAND",
    },
    packed=True,
)  # fmt: skip
"""AUTO.LOITER is its hold, AUTO.MISSION its auto, OFFBOARD its guided mode."""

# Driven in OFFBOARD, not by DO_REPOSITION: that drives in the mode (AUTO.LOITER) that also means to hold, so
# that a stop could not be seen to have been obeyed; and OFFBOARD ends by itself when our setpoints cease.
# Setpoints at 2 Hz or more for a second before OFFBOARD and as long as it lasts; speed in it is the vehicle's
# own (RO_SPEED_LIM), and yaw is of mecanum drives alone (SurfaceVehiclePositionSetpoint).
DRIVING = Driving(
    streams=True, gives_up_s=1.0, gives_up_parameter="COM_OF_LOSS_T", turns=False, courses="vector",
    reposition_mode="hold",
)  # fmt: skip

BEHAVIOUR = ProtocolBehaviour(
    asks_int=True, ask_again_s=0.25, give_up_s=5.0, tells_giving_up=False, atomic=True, strays="ignore",
    last_again=MissionResult.ACCEPTED, forgives_late=False,
    other_station=MissionResult.ERROR,
    busy_in_words=True,  # source
    begins_again=False, cancels=True, clears_in_auto=True, counts_again=False, restarts_item=False,
    same_is_nothing=True,  # source: it compares a checksum
    checks_frame_first=True,  # source
    highest_m=math.inf,
    takes=EVERYWHERE | {
        18, 31, 80, 84, 85, 114, 177, 179, 187, 189, 195, 196, 197, 201, 204, 205, 206, 211, 214, 247, 260,
        400, 530, 532, 534, 1000, 1001, 2003, 2500, 2501, 3000, 4501, 42600,
    },
    done_mode="hold", pauses=True, origin_again=True, says_no=CommandResult.DENIED, modes_by_flags=False,
    acknowledges_set_mode=False, mission_ids=True,
    jumps_by_command=False, start_takes_item=True,
    start_arms=True,  # source
    pauses_by_command=False, speed_while_driving=False,
    speed_parameter="RO_SPEED_LIM", system_parameter="MAV_SYS_ID",
)  # fmt: skip

PARAMETERS = (
    ParameterRule(
        ("EKF2_EV_CTRL",),
        lambda v: int(v) & 9 == 9,
        "15",
        "position (1) and heading (8) come from the localisation, by ODOMETRY",
        when="indoors",
    ),
    ParameterRule(
        ("EKF2_GPS_CTRL",),
        lambda v: v == 0,
        "0",
        "no satellites indoors, and no false fixes at windows",
        when="indoors",
    ),
    ParameterRule(
        ("COM_ARM_WO_GPS",), lambda v: v != 0, "1", "else it does not arm without satellites", when="indoors"
    ),
    ParameterRule(("NAV_ACC_RAD",), lambda v: v <= 0.1, "0.05", "within it a stop counts as reached"),
    ParameterRule(("RO_SPEED_LIM",), lambda v: v > 0, "the mission's speed", "it drives no faster"),
    ParameterRule(
        ("COM_OF_LOSS_T",),
        lambda v: v <= 0.5,
        "0.5",
        "a gateway's vehicle drives on for so long without its computer or link",
        must=False,
    ),
    ParameterRule(
        ("NAV_DLL_ACT",),
        lambda v: v == 0,
        "0",
        "else it stops or goes home at a link loss, whatever the mission's link_loss says",
        must=False,
    ),
    ParameterRule(
        ("COM_RC_IN_MODE",),
        lambda v: v in (1, 2, 4),
        "1, where no remote control is there",
        "else it does not arm without one",
        must=False,
    ),
)

ACKERMANN = 5


def car_steering(values: Mapping[str, float]) -> str:
    """Source (rc.rover_ackermann_defaults)."""
    return f"CA_AIRFRAME is {ACKERMANN}, Ackermann" if values.get("CA_AIRFRAME") == ACKERMANN else ""


# Source: navigation.h allows 500 items on flight controllers (2 000 in older releases, 50 on the smallest
# boards, 65 534 on Linux); only multicopters brake for a hold (Mission::setActiveMissionItems), wait for a
# heading, and take a waypoint's own radius (MissionBlock::is_mission_item_reached); a transfer ends when an
# item is asked for that is neither the next nor the last.
PX4 = Autopilot(
    name="px4", firmware=Firmware.PX4, rule="px4",
    frame=MavFrame.GLOBAL_RELATIVE_ALT_INT, max_items=500, home_first=False,
    commands=frozenset({
        Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.IMAGE_START_CAPTURE,
    }),
    keep=keeps, brake_hold_s=0, longest_hold_s=32_767, max_delay_s=4_294_967.0, keeps_arrival=True,
    radius_parameter="NAV_ACC_RAD",
    reached="within its parameter NAV_ACC_RAD, 10 m unless set", turns=False, gives_items="in order",
    modes=MODES, in_auto=in_auto, driving=DRIVING, drivable=True, behaviour=BEHAVIOUR,
    steering=Steering(("CA_AIRFRAME",), car_steering),
    parameters=PARAMETERS, whole_bytewise=True,
    failsafe_texts=(
        "Critical battery", "Manual control lost", "Connection to ground station lost", "Geofence breached",
        "Crash detected", "No valid local position estimate",
    ),
)  # fmt: skip
