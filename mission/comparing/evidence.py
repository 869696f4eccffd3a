"""Evidence for each stop of a run: contradictions, and events that are missing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.events import AnyEvent, Arrived, Pose, Scanned, Settled, Started, Unconfirmed
from stopgo.mission.run.pose_gaps import gap_limit_ns
from stopgo.mission.run.run_log import RunLog
from stopgo.mission.run.tolerance import is_outside

SOONEST = 0.5
"""Fraction of a scan's planned time that passes at least between the arrival and its end."""


def disputed_m(stop: Stop, events: Sequence[AnyEvent], log: RunLog) -> float | None:
    """Return the distance between a stop's pose in its last event and the poses sent meanwhile.

    `events` are those of the stop. The result is None if both agree within the stop's tolerance, or if one
    of them is missing. At the end of a scan the robot is stationary, so the newest pose counts. A stop
    without a confirmed scan may be reported later, so the nearest pose since the arrival counts. Events that
    follow each other faster than a scan takes were made later than what they report, as those of an
    autopilot's run that nobody watched. Then the nearest pose of the run counts, if none is missing.
    """
    ends = [event for event in events if isinstance(event, Scanned | Unconfirmed)]
    if not ends or ends[-1].pose is None:
        return None
    end = ends[-1]
    before = [event for event in events if isinstance(event, Arrived | Settled) and event.number < end.number]
    if not before or before[-1].boot_id != end.boot_id:
        return None
    is_later = end.robot_ns - before[-1].robot_ns < SOONEST * stop.scan.duration_s * 1e9
    sent = (
        _all_poses(log, end.robot_ns) if is_later else log.poses.between(before[-1].robot_ns, end.robot_ns).xy
    )
    if not len(sent):
        return None
    away = _distances(end.pose, sent)
    apart = float(away[-1] if isinstance(end, Scanned) and not is_later else away.min())
    return apart if is_outside(apart, stop.tolerance_m) else None


def _all_poses(log: RunLog, until_ns: int) -> FloatArray:
    """Return the positions (n, 2) from the run's begin to a time; none if one may be missing."""
    began_ns = log.began_ns or 0
    poses = log.poses.between(began_ns, until_ns)
    limit_ns = gap_limit_ns(np.diff(log.poses.ns))
    known = len(poses) and poses.ns[0] - began_ns <= limit_ns and until_ns - poses.ns[-1] <= limit_ns
    return poses.xy if known and not poses.gaps.any() else poses.xy[:0]


def _distances(pose: Pose | None, xy: np.ndarray) -> np.ndarray:
    assert pose is not None
    return np.hypot(*(xy - (pose.x, pose.y)).T)


def missing_events(log: RunLog) -> str:
    """Return which events of a run the log lacks, as part of a sentence; empty if none is missing."""
    numbers = [event.number for event in log.events]
    if not numbers:
        return "all events"
    gaps = [(before + 1, after - 1) for before, after in pairwise(numbers) if after > before + 1]
    if gaps:
        return "events " + ", ".join(
            f"{first}" if first == last else f"{first} to {last}" for first, last in gaps
        )
    return "" if isinstance(log.events[0], Started) else "the events before its first"
