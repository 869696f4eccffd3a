"""How each kind of autopilot behaves: its end of the mission protocol, its modes, what it takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as dialect

from mission.errors import InputError
from mission.mavlink.autopilots import AUTOPILOTS, Autopilot

ModeName = Literal["manual", "hold", "auto", "guided"]
Strays = Literal["tell", "ignore", "ask"]
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
CUSTOM = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


@dataclass(frozen=True)
class Mode:
    """A mode as HEARTBEAT has it."""

    flags: int
    custom: int


@dataclass(frozen=True)
class Profile:
    """The habits of one kind of autopilot."""

    name: str
    autopilot: Autopilot
    """What it keeps of an item."""
    firmware: int
    """MAV_AUTOPILOT."""
    modes: dict[ModeName, Mode]
    asks_int: bool
    """Asks for items with MISSION_REQUEST_INT; else with MISSION_REQUEST."""
    ask_again_s: float
    give_up_s: float
    tells_giving_up: bool
    atomic: bool
    """A mission is replaced when its last item has come; else item by item."""
    strays: Strays
    """An item that was not asked for is answered with INVALID_SEQUENCE, not at all, or by asking again."""
    last_again: int
    """Answer to the last item when it comes again after its ACK (MAV_MISSION_RESULT)."""
    stranger: int
    """Answer to a second station during an upload."""
    begins_again: bool
    """A station may announce a new upload in the middle of its own."""
    cancels: bool
    """An ACK with OPERATION_CANCELLED ends an upload."""
    clears_in_auto: bool
    in_order: bool
    """Gives its items only in order, each once more at most."""
    restarts_item: bool
    """An upload in AUTO restarts the current item; else the mission begins anew."""
    done_mode: ModeName
    """The mode once a mission is finished."""
    reposition_mode: ModeName
    """The mode in which DO_REPOSITION is driven."""
    streams: bool
    """It leaves the guided mode, and does not enter it, unless setpoints keep coming."""
    yaw_alone: bool
    """It turns on the spot to a yaw that comes without a place."""
    pauses: bool
    """Tells a mission that is paused from one that was not started."""
    origin_again: bool
    """The global origin can be set again before a reboot."""
    commands: frozenset[int]
    """Commands of a mission that it takes; it may skip some of them."""


def profile_named(name: str) -> Profile:
    """One of `PROFILES`.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in PROFILES:
        raise InputError(f"--profile {name}: one of {', '.join(PROFILES)}")
    return PROFILES[name]


def _flags(*flags: int) -> int:
    return CUSTOM | sum(flags)


MANUAL, STABILIZE = dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED, dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
GUIDED, AUTO = dialect.MAV_MODE_FLAG_GUIDED_ENABLED, dialect.MAV_MODE_FLAG_AUTO_ENABLED


def _px4(main: int, sub: int = 0) -> int:
    """PX4's custom mode: sub mode in the highest byte, main mode in the next."""
    return sub << 24 | main << 16


ROVER_MODES: dict[ModeName, Mode] = {
    "manual": Mode(_flags(MANUAL), 0),
    "hold": Mode(_flags(), 4),
    "auto": Mode(_flags(STABILIZE, GUIDED, AUTO), 10),
    "guided": Mode(_flags(STABILIZE, GUIDED), 15),
}
PX4_MODES: dict[ModeName, Mode] = {
    "manual": Mode(_flags(MANUAL), _px4(1)),
    "hold": Mode(_flags(STABILIZE, GUIDED, AUTO), _px4(4, 3)),
    "auto": Mode(_flags(STABILIZE, GUIDED, AUTO), _px4(4, 4)),
    "guided": Mode(_flags(STABILIZE, GUIDED), _px4(6)),
}
"""AUTO.LOITER, AUTO.MISSION, OFFBOARD."""

EVERYWHERE = frozenset({16, 17, 19, 20, 21, 22, 93, 112, 178, 203, 2000, 2001})
"""Taken by every profile; take-off, landing and conditions are skipped."""
ROVER_COMMANDS = EVERYWHERE | {
    18, 30, 31, 82, 84, 85, 92, 94, 114, 115, 177, 179, 181, 182, 183, 184, 189, 194, 195, 197, 201, 205, 206,
    207, 208, 209, 210, 211, 212, 213, 217, 218, 222, 223, 1000, 42702,
}  # fmt: skip
PX4_COMMANDS = EVERYWHERE | {
    18, 31, 80, 84, 85, 114, 177, 179, 187, 189, 195, 196, 197, 201, 204, 205, 206, 211, 214, 247, 260, 400,
    530, 532, 534, 1000, 1001, 2003, 2500, 2501, 3000, 4501, 42600,
}  # fmt: skip

PROFILES: dict[str, Profile] = {
    "strict": Profile(
        name="strict", autopilot=AUTOPILOTS["generic"], firmware=dialect.MAV_AUTOPILOT_GENERIC,
        modes=PX4_MODES, asks_int=True, ask_again_s=0.25, give_up_s=1.5, tells_giving_up=True,
        atomic=True, strays="ask", last_again=dialect.MAV_MISSION_ACCEPTED,
        stranger=dialect.MAV_MISSION_DENIED, begins_again=True, cancels=True,
        clears_in_auto=True, in_order=False, restarts_item=False, done_mode="hold", reposition_mode="hold",
        streams=False, yaw_alone=True, pauses=True, origin_again=True,
        commands=EVERYWHERE | {177, 183, 187, 189, 195, 197, 211, 530},
    ),
    "ardupilot": Profile(
        name="ardupilot", autopilot=AUTOPILOTS["ardupilot"], firmware=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
        modes=ROVER_MODES, asks_int=False, ask_again_s=1.0, give_up_s=8.0, tells_giving_up=True, atomic=False,
        strays="tell", last_again=dialect.MAV_MISSION_ERROR, stranger=dialect.MAV_MISSION_DENIED,
        begins_again=True, cancels=False, clears_in_auto=False, in_order=False, restarts_item=True,
        done_mode="auto", reposition_mode="guided", streams=False, yaw_alone=True, pauses=False,
        origin_again=False, commands=frozenset(ROVER_COMMANDS),
    ),
    "px4": Profile(
        name="px4", autopilot=AUTOPILOTS["px4"], firmware=dialect.MAV_AUTOPILOT_PX4, modes=PX4_MODES,
        asks_int=True, ask_again_s=0.25, give_up_s=5.0, tells_giving_up=False, atomic=True, strays="ignore",
        last_again=dialect.MAV_MISSION_ACCEPTED, stranger=dialect.MAV_MISSION_ERROR, begins_again=False,
        cancels=True, clears_in_auto=True, in_order=True, restarts_item=False, done_mode="hold",
        reposition_mode="hold", streams=True, yaw_alone=False, pauses=True, origin_again=True,
        commands=frozenset(PX4_COMMANDS),
    ),
}  # fmt: skip
"""`strict` keeps to the letter of the specification, with PX4's mode numbers, for it has none of its own.

Measured on ArduPilot Rover 4.7-dev, or read in PX4's mavlink_mission.cpp and its documentation.
"""
