"""An autopilot that follows the specification exactly: it keeps all fields, degrees are WGS84.

It has PX4's mode numbers, because the specification has none.
"""

from __future__ import annotations

import math

from stopgo.mission.mavlink.autopilots import px4
from stopgo.mission.mavlink.autopilots.kind import (
    EVERYWHERE,
    Autopilot,
    Driving,
    Heartbeat,
    ProtocolBehaviour,
)
from stopgo.mission.mavlink.enums import CommandResult, Firmware, MissionResult, ModeFlag
from stopgo.mission.mavlink.fields import as_sent
from stopgo.mission.mavlink.items import Command, MavFrame

UINT16_MAX = 65_535


def in_auto(heartbeat: Heartbeat) -> bool:
    """Return True by its flags; others that number their modes as PX4 does have them set on hold too."""
    holds = px4.MODES.of(heartbeat.custom_mode) == px4.MODES.hold
    return not holds and bool(heartbeat.base_mode & ModeFlag.AUTO_ENABLED)


BEHAVIOUR = ProtocolBehaviour(
    asks_int=True, ask_again_s=0.25, give_up_s=1.5, tells_giving_up=True, atomic=True, strays="ask",
    last_again=MissionResult.ACCEPTED, forgives_late=True, other_station=MissionResult.DENIED,
    busy_in_words=False, begins_again=True, cancels=True, clears_in_auto=True, counts_again=False,
    restarts_item=False, same_is_nothing=False, checks_frame_first=False, highest_m=math.inf,
    takes=EVERYWHERE | {177, 183, 187, 189, 195, 197, 211, 530},
    done_mode="hold", pauses=True, origin_again=True, says_no=CommandResult.DENIED, modes_by_flags=True,
    acknowledges_set_mode=False, mission_ids=False,
    jumps_by_command=True, start_takes_item=True, start_arms=False,
    pauses_by_command=True,
    speed_while_driving=False, speed_parameter="SPEED", system_parameter="SYSTEM_ID",
)  # fmt: skip

GENERIC = Autopilot(
    name="generic", firmware=Firmware.GENERIC, rule="wgs84",
    frame=MavFrame.GLOBAL_RELATIVE_ALT_INT, max_items=UINT16_MAX, home_first=False,
    commands=frozenset({
        Command.NAV_WAYPOINT, Command.NAV_DELAY, Command.DO_CHANGE_SPEED, Command.IMAGE_START_CAPTURE,
    }),
    keep=as_sent, brake_hold_s=0, longest_hold_s=32_767, max_delay_s=4_294_967.0, keeps_arrival=True,
    radius_parameter="",
    reached="within the acceptance radius that is sent", turns=True, gives_items="either",
    modes=px4.MODES, in_auto=in_auto,
    driving=Driving(
        streams=False, gives_up_s=3.0, gives_up_parameter="", turns=True, courses="heading",
        reposition_mode="hold",
    ),
    drivable=False, behaviour=BEHAVIOUR,
)  # fmt: skip
