"""Comparison of a plan with a run: each stop as planned, and as driven."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.sighted_path import SightedPath
from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.events import State
from stopgo.mission.run.run_log import RunLog
from stopgo.mission.run.tolerance import error_text, is_outside

COLUMNS = (
    *("stop", "outcome", "planned s", "arrived s", "late s", "along mm", "across mm", "heading °"),
    *("settle s", "tries", "lost %", "why"),
)
"""Headings of a table of stops: times from the run's start, offsets in the planned direction of arrival."""

DONE = {"scanned": "scanned", "unconfirmed": "passed"}
"""Outcomes of a stop that is done, in words."""


@dataclass(frozen=True, kw_only=True)
class StopComparison:
    """Comparison of one stop; a value is None if it did not happen."""

    stop: str
    planned_s: float | None = None
    """Planned arrival, from the start of the mission; None if no plan has this stop."""
    arrived_s: float | None = None
    """First arrival in the run, from the start of the run."""
    deviation_m: float | None = None
    """Distance of the robot from the stop when it scanned or passed there, else when it last arrived."""
    along_m: float | None = None
    """Along-track error: its part in the planned direction of arrival, positive beyond the stop."""
    across_m: float | None = None
    """Its part to the left of that direction."""
    heading_rad: float | None = None
    """Heading error of the robot, positive to the left."""
    turned_rad: float = 0.0
    """Its size if the scanner does not allow it; else 0."""
    tolerance_m: float | None = None
    settle_s: float | None = None
    """Settle time: from the last arrival to the standstill."""
    tries: int = 0
    """Number of times that the robot was ready to scan there."""
    outcome: str
    """`scanned`, `unconfirmed`, `skipped`, `failed`, `arrived` or `not reached`; `withdrawn` if a revision
    dropped it unreached."""
    reason: str = ""
    """Reason why it was not scanned, in the robot's words."""
    disputed_m: float | None = None
    """Distance between the pose in its last event and the poses sent meanwhile; None within the tolerance."""
    is_open: bool = False
    """True if the stop may have been scanned, or may still be: events are missing, or the run goes on."""
    lost: float | None = None
    """Fraction of all visible that its scan would have added; None if it is not missing."""

    @property
    def late_s(self) -> float | None:
        if self.arrived_s is None or self.planned_s is None:
            return None
        return self.arrived_s - self.planned_s

    @property
    def position_outside(self) -> bool:
        """True if the position error is greater than the mission tolerates."""
        away, limit = self.deviation_m, self.tolerance_m
        return away is not None and limit is not None and is_outside(away, limit)

    @property
    def outside_tolerance(self) -> bool:
        """True if the position error is greater than the mission tolerates, or the heading error."""
        return self.position_outside or self.turned_rad > 0

    @property
    def is_doubtful(self) -> bool:
        """True if nothing shows for certain that it was scanned, or that it was not."""
        return self.outcome == "unconfirmed" or self.is_disputed or self.is_open

    @property
    def is_disputed(self) -> bool:
        """True if its last event and the poses sent meanwhile disagree, and one may be within tolerance."""
        if self.disputed_m is None:
            return False
        least_m = self.disputed_m - (self.deviation_m or 0.0)  # of the poses, from the stop
        return not (self.position_outside and is_outside(least_m, self.tolerance_m or 0.0))

    @property
    def disputed_text(self) -> str:
        """The contradiction in words; empty if there is none."""
        if self.disputed_m is None:
            return ""
        return f"event and sent poses are {1000 * self.disputed_m:.0f} mm apart"

    @property
    def outside_text(self) -> str:
        """Errors of a scanned or passed stop that are outside tolerance, in words; empty if within."""
        if self.is_disputed or self.outcome not in DONE or not self.outside_tolerance:
            return ""
        error = error_text(self.deviation_m or 0.0, self.tolerance_m or 0.0, self.turned_rad)
        return f"{DONE[self.outcome]} {error}"

    @property
    def why(self) -> str:
        """Everything that is not as planned, in words."""
        return "; ".join(text for text in (self.outside_text, self.disputed_text, self.reason) if text)

    @property
    def cells(self) -> dict[str, str]:
        """The row of a table: text by the heading of COLUMNS."""
        offsets = ((self.late_s, 1), (self.along_m, 1000), (self.across_m, 1000))
        signed = (*offsets, (self.heading_rad, 180 / math.pi))
        row = (
            *(self.stop, self.outcome, _number(self.planned_s), _number(self.arrived_s)),
            *(_number(value, scale, sign="+") for value, scale in signed),
            *(_number(self.settle_s), str(self.tries), _number(self.lost, 100), self.why),
        )
        return dict(zip(COLUMNS, row, strict=True))

    def as_json(self) -> dict[str, Any]:
        """Return the row for a program."""
        keys = (
            *("stop", "outcome", "reason", "planned_s", "arrived_s", "late_s", "deviation_m", "along_m"),
            *("across_m", "heading_rad", "tolerance_m", "settle_s", "tries", "lost", "disputed_m"),
        )
        return {**{key: getattr(self, key) for key in keys}, "outside_tolerance": bool(self.outside_text)}


def _number(value: float | None, scale: float = 1.0, *, sign: str = "-") -> str:
    """Format a number with one decimal; `-` for None, and never a minus before a zero."""
    return "-" if value is None else f"{round(value * scale, 1) + 0.0:{sign}.1f}"


@dataclass(frozen=True)
class Span:
    """A time during which a run was in one state, in seconds since it began."""

    state: State
    begin_s: float
    end_s: float
    why: str = ""

    @property
    def seconds(self) -> float:
        return self.end_s - self.begin_s


@dataclass(frozen=True, eq=False)
class CrossTrack:
    """Cross-track error: distance of the robot from the legs that it drove, at every pose of its run."""

    ns: IntArray
    """Times (n,), nanoseconds on the robot's clock."""
    metres: FloatArray
    """Signed distance, positive to the left of the driving direction (n,); NaN where no leg is driven."""
    arc: FloatArray
    """Distance along the path since the last stop (n,)."""
    route: FloatArray
    """Distance along all legs since the start (n,); NaN on the way back."""
    route_end: float = math.nan
    """The same where the driven path ended, by the events; NaN if they do not show it."""

    @property
    def greatest(self) -> int | None:
        """Index of the pose with the greatest cross-track error; None if there is none."""
        away = np.where(np.isfinite(self.metres), np.abs(self.metres), -1.0)
        return int(np.argmax(away)) if len(away) and away.max() >= 0 else None

    @property
    def greatest_m(self) -> float | None:
        index = self.greatest
        return None if index is None else float(abs(self.metres[index]))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of a run with its mission."""

    missions: tuple[Mission, ...]
    """The revisions that were followed, the last one last."""
    log: RunLog
    stops: tuple[StopComparison, ...]
    spans: tuple[Span, ...]
    cross_track: CrossTrack
    sighted: SightedPath
    planned_s: float
    driven_s: float | None
    """Duration of the run; None if it has not ended."""
    acquired: Acquired | None = None
    """None if no plan contains visibility data."""

    @property
    def mission(self) -> Mission:
        return self.missions[-1]

    @property
    def run_id(self) -> str | None:
        return self.log.run_id

    @property
    def scanned(self) -> int:
        """Number of stops that were scanned."""
        return sum(item.outcome == "scanned" for item in self.stops)

    @cached_property
    def asked(self) -> tuple[StopComparison, ...]:
        """The stops of the revision that was followed last."""
        ids = {stop.id for stop in self.mission.stops}
        return tuple(item for item in self.stops if item.stop in ids)

    @cached_property
    def missing(self) -> tuple[StopComparison, ...]:
        """Those of them that were not scanned; unconfirmed ones are not counted."""
        return tuple(item for item in self.asked if item.outcome not in DONE)

    @cached_property
    def outside(self) -> tuple[StopComparison, ...]:
        """Stops that were scanned, or passed unconfirmed, outside tolerance."""
        return tuple(item for item in self.stops if item.outside_text)

    @property
    def greatest_deviation_m(self) -> float | None:
        """Greatest position error of all stops that the robot reached; None if it reached none."""
        return max((item.deviation_m for item in self.stops if item.deviation_m is not None), default=None)

    def seconds_in(self, *states: State) -> float:
        """Seconds that the run spent in these states."""
        return sum(span.seconds for span in self.spans if span.state in states)
