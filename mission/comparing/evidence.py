"""Evidence for each stop of a run: contradictions, and events that are missing."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.run.events import AnyEvent, Arrived, Pose, Scanned, Settled, Started, Unconfirmed
from stopgo.mission.run.run_log import RunLog, Track
from stopgo.mission.run.tolerance import is_outside


def disputed_m(stop: Stop, events: Sequence[AnyEvent], poses: Track) -> float | None:
    """Return the distance between a stop's pose in its last event and the poses sent meanwhile.

    `events` are those of the stop. The result is None if both agree within the stop's tolerance, or if one
    of them is missing. At the end of a scan the robot is stationary, so the newest pose counts. A stop
    without a confirmed scan may be reported later, so the nearest pose since the arrival counts.
    """
    ends = [event for event in events if isinstance(event, Scanned | Unconfirmed)]
    if not ends or ends[-1].pose is None:
        return None
    end = ends[-1]
    before = [event for event in events if isinstance(event, Arrived | Settled) and event.number < end.number]
    if not before or before[-1].boot_id != end.boot_id:
        return None
    sent = poses.between(before[-1].robot_ns, end.robot_ns).xy
    if not len(sent):
        return None
    away = _distances(end.pose, sent)
    apart = float(away[-1] if isinstance(end, Scanned) else away.min())
    return apart if is_outside(apart, stop.tolerance_m) else None


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
