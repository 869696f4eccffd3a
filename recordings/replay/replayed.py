"""A log laid beside its mission, whole: what `stopgo replay` knows of one log."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stopgo.mission.comparing.as_driven import AsDriven
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.measured import Measured
from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.events import Scanned, Unconfirmed
from stopgo.mission.run.run_log import RunLog
from stopgo.recordings.logs.field_log import FieldLog
from stopgo.recordings.replay.log_placing import PlacedLog
from stopgo.recordings.replay.matching import Match


@dataclass(frozen=True, eq=False)
class Replay:
    """One log beside one mission."""

    log: FieldLog
    mission: Mission
    placed: PlacedLog
    matches: tuple[Match, ...]
    """What each halt of the robot was, in order of time."""
    run: RunLog
    """The run that the log tells of, as any other run."""
    comparison: Comparison
    uploads: tuple[str, ...]
    """How the missions in the log differ from this one, a line each."""
    inferred: bool
    """Whether the run's events were inferred from halts, and not told by the log."""

    sight: AsDriven | None = None
    """What was in sight from where the robot stood; None without the floor."""

    measured: Measured | None = None
    """What the scans in the log show of the floor; None without the floor, or without scans."""

    def with_sight(self, sight: AsDriven) -> Replay:
        """The same, with what was in sight."""
        return replace(self, sight=sight)

    def with_measured(self, measured: Measured | None) -> Replay:
        """The same, with what scans show."""
        return replace(self, measured=measured)

    @cached_property
    def scanned_from(self) -> FloatArray:
        """x, y and heading of every place where a scan was made, or where the robot stood as long as one
        takes (n, 3)."""
        own = [event.pose for event in self.run.events if isinstance(event, Scanned | Unconfirmed)]
        return np.array([(pose.x, pose.y, pose.heading) for pose in own if pose is not None]).reshape(-1, 3)

    @cached_property
    def extra(self) -> tuple[Match, ...]:
        """Halts at no stop."""
        return tuple(match for match in self.matches if match.how == "extra")

    def at(self, stop: int) -> tuple[Match, ...]:
        """Halts at a stop, by its index."""
        return tuple(match for match in self.matches if match.stop == stop)

    def true_offset_m(self, stop: int) -> float | None:
        """Distance from the stop of where a simulator says that the robot stood there last."""
        halts, truth = self.at(stop), self.placed.truth
        if not halts or truth is None:
            return None
        halt, place = halts[-1].standing, self.mission.stops[stop]
        poses = truth.between(halt.begin_ns, halt.end_ns)
        if not len(poses):
            return None
        x, y = np.median(poses.xy, axis=0)
        return math.dist((float(x), float(y)), (place.x, place.y))

    @cached_property
    def beside(self) -> FloatArray:
        """Signed metres beside the route at every pose that was on a leg."""
        metres = self.comparison.cross_track.metres
        return metres[np.isfinite(metres)]
