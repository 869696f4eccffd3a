"""Causes of an autopilot's failsafes, from the texts (STATUSTEXT) of ArduPilot Rover and PX4."""

from __future__ import annotations

import re
from dataclasses import dataclass

from stopgo.mission.mavlink.telemetry import is_arming_refusal

RECENT_S = 10.0
"""A mode that changes within this time after such a text was changed by that failsafe."""
UNNAMED = "the autopilot's own failsafe (it names no cause)"
_CAUSES = (
    ("geofence", r"fence.*(breach|violat)|(breach|violat).*fence"),
    ("battery", r"\bbatter\w+ .*(low|critical|emergency|failsafe)|\b(low|critical|emergency) battery"),
    ("ground station lost", r"\b(GCS|ground ?station|data ?link)\b.*(failsafe|lost)|Failsafe trigger: GCS"),
    ("remote control lost", r"\b(RC|Radio|Throttle)\b.*(failsafe|lost)|Failsafe trigger: Throttle"),
    ("remote control lost", r"\bmanual control .*lost|\bno manual control"),
    ("crash", r"\bcrash:|\bcrash detected"),
    (
        "position estimate",
        r"\bEKF (failsafe|variance)|\bno valid (local |global )?position|\bnavigation error",
    ),
    ("no set points", r"\boffboard .*lost|\bno offboard signal"),
    ("failsafe", r"\bfailsafe (activated|triggered)"),
)
_PATTERNS = tuple((cause, re.compile(pattern, re.IGNORECASE)) for cause, pattern in _CAUSES)


@dataclass(frozen=True)
class Failsafe:
    """A failsafe that a text reports."""

    cause: str
    text: str

    def __str__(self) -> str:
        return f'the autopilot\'s failsafe ({self.cause}: "{self.text}")'


def failsafe_of(text: str) -> Failsafe | None:
    """Return the failsafe that a text reports; `None` for another text, or one that reports the end of it."""
    if is_arming_refusal(text) or re.search(r"\b(cleared|ended|recovered|regained|restored)\b", text, re.I):
        return None
    for cause, pattern in _PATTERNS:
        if pattern.search(text):
            return Failsafe(cause, text.strip())
    return None
