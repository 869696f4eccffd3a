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
    scan_wait: ScanWait
    settle: Settle
    max_lateral_m: float
