"""One straight of a leg, and how it ends: judged by where the vehicle is and whether it moves, nothing else.

What an autopilot says of its arrival is no proof of it, so it is not asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from mission.document import Point
from mission.run.way import foot

DriveVerdict = Literal["going", "arrived", "blocked"]

NEAR_M = 0.05
"""Nearer than this nobody asks for more, unless the mission's tolerance does."""
STOOD_S = 0.5
"""Standing for so long is to have come to a stand."""
STALLED_S = 5.0
"""Standing for so long away from the place: it will not go on. Longer than any turn in place's beginning."""
ASTRAY_S = 30.0
"""Moving for so long without getting nearer."""
STRAY_M = 1.0
"""So far beside the straight a vehicle drives a way that nobody laid down."""
PROGRESS_M = 0.02


@dataclass(frozen=True)
class Patience:
    """How long a drive waits for what should happen, seconds."""

    stood_s: float = STOOD_S
    stalled_s: float = STALLED_S
    astray_s: float = ASTRAY_S


class StraightDrive:
    """A straight from where the vehicle is to `end`."""

    def __init__(
        self, start: Point, end: Point, now_s: float, *, near_m: float, over_m: float, patience: Patience
    ) -> None:
        self._start, self._end = start, end
        self._near_m = near_m
        self._over_m = over_m
        """A vehicle that stands for good within this is there, as near as it gets."""
        self._patience = patience
        self._nearest = math.dist(start, end)
        self._progress_s = now_s
        self._stood_since: float | None = None
        self.why = ""
        """What is wrong, once it is blocked."""

    def judge(self, here: Point, *, still: bool, now_s: float) -> DriveVerdict:
        """Whether the vehicle has arrived, or will not."""
        away = math.dist(here, self._end)
        if away < self._nearest - PROGRESS_M:
            self._nearest, self._progress_s = away, now_s
        self._stood_since = (now_s if self._stood_since is None else self._stood_since) if still else None
        stood_s = 0.0 if self._stood_since is None else now_s - self._stood_since
        if away <= self._near_m and stood_s >= self._patience.stood_s:
            return "arrived"
        stalled_s = min(stood_s, now_s - self._progress_s)
        if stalled_s >= self._patience.stalled_s and away <= self._over_m:
            return "arrived"
        self.why = self._wrong(here, away, stalled_s, now_s)
        return "blocked" if self.why else "going"

    def _wrong(self, here: Point, away: float, stalled_s: float, now_s: float) -> str:
        beside = math.dist(here, foot(self._start, self._end, here))
        if beside > STRAY_M:
            return f"the vehicle is {beside:.2f} m beside the way"
        if stalled_s >= self._patience.stalled_s:
            return f"the vehicle stands {away:.2f} m from where it was sent, and does not go on"
        if now_s - self._progress_s >= self._patience.astray_s:
            return f"the vehicle moves without getting nearer than {self._nearest:.2f} m"
        return ""
