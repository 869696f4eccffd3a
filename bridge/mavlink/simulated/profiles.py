"""The kinds of autopilot whose protocol behaviour the simulated vehicle may have."""

from __future__ import annotations

from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.autopilots.kind import Autopilot

PROFILES: dict[str, Autopilot] = {
    "strict": AUTOPILOTS["generic"],
    "ardupilot": AUTOPILOTS["ardupilot"],
    "px4": AUTOPILOTS["px4"],
}
"""`strict` keeps to the letter of the specification."""


def profile_named(name: str) -> Autopilot:
    """One of `PROFILES`.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in PROFILES:
        raise InputError(f"--autopilot {name}: one of {', '.join(PROFILES)}")
    return PROFILES[name]
