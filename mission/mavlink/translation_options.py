"""Options of a mission's translation to items, with every choice made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.kind import Autopilot

Trigger = Literal["auto", "script", "camera", "none"]
ScanWait = Literal["delay", "script_time"]
Settle = Literal["delay", "hold"]


@dataclass(frozen=True)
class TranslationOptions:
    """The choices of `stopgo.mission.mavlink.translate.translate`; `trigger` is no longer `auto`."""

    origin: SiteOrigin
    vehicle: Autopilot
    trigger: Trigger
    """Start of a scan: a message to a script on the vehicle (ArduPilot), a camera command, or none (then the
    station that follows the run starts it). `auto` is the script on ArduPilot, else the camera."""
    scan_wait: ScanWait
    """Wait for the planned duration, or until a script reports the end of the scan (ArduPilot)."""
    settle: Settle
    """Wait in an item of its own, or, to save items, as the waypoint's hold (whole seconds)."""
    max_lateral_m: float
    """Greatest distance in metres of the straight lines between waypoints from the mission's legs."""
