"""Replay: one log compared with its mission."""

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
from stopgo.mission.run.events import Scanned, Settled, Unconfirmed
from stopgo.mission.run.run_log import RunLog
from stopgo.recordings.logs.field_log import FieldLog
from stopgo.recordings.replay.driving_direction import drives_ahead
from stopgo.recordings.replay.log_placing import PlacedLog
from stopgo.recordings.replay.matching import Match


@dataclass(frozen=True, eq=False)
class Replay:
    """One log compared with one mission."""

    log: FieldLog
    mission: Mission
    placed: PlacedLog
    matches: tuple[Match, ...]
    """Meaning of each standstill of the robot, in order of time."""
    run: RunLog
    """Run in the log, as of any other source."""
    comparison: Comparison
    uploads: tuple[str, ...]
    """Differences between the missions in the log and this one, one line each."""
    inferred: bool
    """True if the run's events were inferred from standstills, and not read from the log."""

    sight: AsDriven | None = None
    """Targets visible from the robot's stationary poses; None without the floor."""

    measured: Measured | None = None
    """Measurements of the floor by the scans in the log; None without the floor, or without scans."""

    def with_sight(self, sight: AsDriven) -> Replay:
        """Return the replay with what was visible."""
        return replace(self, sight=sight)

    def with_measured(self, measured: Measured | None) -> Replay:
        """Return the replay with the measurements of scans."""
        return replace(self, measured=measured)

    @cached_property
    def scanned_from(self) -> FloatArray:
        """Poses (x, y, heading) of each scan, or of each standstill as long as a scan takes (n, 3)."""
        own = [
            event.pose
            for event in self.run.events
            if isinstance(event, Scanned | Unconfirmed) and event.stop not in self.unlogged
        ]
        return np.array([(pose.x, pose.y, pose.heading) for pose in own if pose is not None]).reshape(-1, 3)

    @cached_property
    def unlogged(self) -> frozenset[str]:
        """Stops without a scan in the log, where it contains one at another stop.

        Inferred events contain triggers; a vehicle's own events, finished scans.
        """
        kind = Settled if self.inferred else Scanned
        logged = {event.stop for event in self.run.events if isinstance(event, kind)}
        return frozenset(stop.id for stop in self.mission.stops if logged and stop.id not in logged)

    @cached_property
    def drives_ahead(self) -> bool:
        """True if the robot mostly drove where its headings point: else they are of another unit or axis."""
        return drives_ahead(self.run.poses)

    @cached_property
    def extra(self) -> tuple[Match, ...]:
        """Standstills at no stop."""
        return tuple(match for match in self.matches if match.how == "extra")

    def at(self, stop: int) -> tuple[Match, ...]:
        """Return the standstills at a stop, by its index."""
        return tuple(match for match in self.matches if match.stop == stop)

    def true_offset_m(self, stop: int) -> float | None:
        """Return the stop's distance from the true position of the last standstill there, by a simulator."""
        standstills, truth = self.at(stop), self.placed.truth
        if not standstills or truth is None:
            return None
        standstill, position = standstills[-1].standstill, self.mission.stops[stop]
        poses = truth.between(standstill.begin_ns, standstill.end_ns)
        if not len(poses):
            return None
        x, y = np.median(poses.xy, axis=0)
        return math.dist((float(x), float(y)), (position.x, position.y))

    @cached_property
    def cross_track(self) -> FloatArray:
        """Signed cross-track error in metres at every pose on a leg."""
        metres = self.comparison.cross_track.metres
        return metres[np.isfinite(metres)]
