"""Computation of the seen part of a run's path, and of its gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from stopgo.mission.comparing.comparison import CrossTrack
from stopgo.mission.comparing.sighted_path import PoseGap, SightedPath
from stopgo.mission.document import Mission, Point
from stopgo.mission.run.events import Arrived, Failed, Scanned, Skipped, Unconfirmed
from stopgo.mission.run.pose_gaps import gap_limit_ns
from stopgo.mission.run.run_log import RunLog, Track

STILL_M = 0.1
"""Length of a gap's path up to which the robot may not have moved."""


def sighted_path(log: RunLog, mission: Mission, cross_track: CrossTrack) -> SightedPath:
    """Return the seen part of the path from the run's start to its end.

    `mission` is the revision of the start, and `cross_track` states where on the legs each pose is. A log
    without any pose has no path. While its events say that the robot is at a stop, no path is missing.
    """
    poses = log.poses.between(log.began_ns or 0, log.ended_ns or 0)
    if not len(poses):
        return SightedPath(0.0)
    steps = np.diff(poses.ns)
    limit_ns, stays = gap_limit_ns(steps[steps > 0]), tuple(_stays(log))
    restarts = log.seconds(poses.restarts_ns)
    found = (
        replace(gap, restarted=bool(((restarts > gap.begin_s) & (restarts <= gap.end_s)).any()))
        for gap in _found(log, mission, poses, cross_track, limit_ns)
    )
    return SightedPath(poses.length_m, tuple(gap for gap in found if _is_unseen(gap, stays, limit_ns)))


def _found(
    log: RunLog, mission: Mission, poses: Track, cross_track: CrossTrack, limit_ns: float
) -> Iterator[PoseGap]:
    """Yield every gap: from the start to the first pose, between poses, and from the last pose to the end."""
    route, xy = cross_track.route, [(x, y) for x, y in poses.xy.tolist()]
    seconds = log.seconds(poses.ns).tolist()
    start = (mission.start.x, mission.start.y)
    if poses.ns[0] - (log.began_ns or 0) > limit_ns:
        metres = _unseen_m(0.0, float(route[0]), start, xy[0])
        yield PoseGap(0.0, seconds[0], None, xy[0], metres)
    for k in np.flatnonzero(poses.gaps).tolist():
        metres = _unseen_m(float(route[k]), float(route[k + 1]), xy[k], xy[k + 1])
        yield PoseGap(seconds[k], seconds[k + 1], xy[k], xy[k + 1], metres)
    if (log.ended_ns or 0) - poses.ns[-1] > limit_ns:
        metres = _unseen_m(float(route[-1]), cross_track.route_end, xy[-1], None)
        yield PoseGap(seconds[-1], log.duration_s, xy[-1], None, metres)


def _stays(log: RunLog) -> Iterator[tuple[float, float]]:
    """Yield the times from each arrival at a stop to the end of the work there, seconds of the run."""
    arrived: Arrived | None = None
    for event in log.events:
        if isinstance(event, Arrived):
            arrived = event
        elif isinstance(event, Scanned | Unconfirmed | Failed | Skipped):
            if arrived is not None and (arrived.stop, arrived.boot_id) == (event.stop, event.boot_id):
                begin_s, end_s = log.seconds([arrived.robot_ns, event.robot_ns]).tolist()
                yield begin_s, end_s
            arrived = None


def _is_unseen(gap: PoseGap, stays: Sequence[tuple[float, float]], limit_ns: float) -> bool:
    """True unless the events say where the robot was: at one stop, and it did not move."""
    if gap.metres > STILL_M or gap.restarted:
        return True
    at_stops = sum(max(0.0, min(end, gap.end_s) - max(begin, gap.begin_s)) for begin, end in stays)
    return gap.seconds - at_stops > limit_ns / 1e9


def _unseen_m(begin_m: float, end_m: float, begin: Point, end: Point | None) -> float:
    """Return the length along the legs between two poses, and at least their straight distance."""
    along = end_m - begin_m
    straight = 0.0 if end is None else math.dist(begin, end)
    return max(along, straight) if math.isfinite(along) else straight
