"""Kinds of autopilot: one module for each, and `kind` for their common fields."""

from __future__ import annotations

from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.autopilots.generic import GENERIC
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.autopilots.px4 import PX4

AUTOPILOTS: dict[str, Autopilot] = {kind.name: kind for kind in (ARDUPILOT, PX4, GENERIC)}


def autopilot_named(name: str) -> Autopilot:
    """Return one of `AUTOPILOTS`.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in AUTOPILOTS:
        raise InputError(f"autopilot {name!r}: unknown; choose one of {', '.join(AUTOPILOTS)}")
    return AUTOPILOTS[name]


def autopilot_of(firmware: int) -> Autopilot:
    """Return the kind of a heartbeat's MAV_AUTOPILOT; `generic` for an unknown one."""
    return next((kind for kind in AUTOPILOTS.values() if kind.firmware == firmware), GENERIC)
