"""Common error of a log that was placed by itself: a shift or turn of the whole drive that placing takes up.

After a fit to the stops only the begin of the log shows it: a run begins at the mission's start. Each stop's
error is the distance between its positions by the fit and by the first pose. Without headings, nothing shows
a turn, whether the log was fitted or placed by its begin.
"""

from __future__ import annotations

import math

import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.replay.log_placing import FIRST_NS
from stopgo.recordings.replay.replayed import Replay

SIGMAS = 3.0
"""Standard deviations of a mean heading that are no turn."""

XYHeading = tuple[float, float, float]


def fit_error_m(replay: Replay) -> FloatArray:
    """Return the common error that placing may leave at each stop (n,); 0 if the log was placed by others."""
    stops = np.array([(stop.x, stop.y) for stop in replay.mission.stops])
    alignment, track = replay.run.alignment, replay.run.poses
    if alignment is None or not alignment.pairs or not len(track):
        return np.zeros(len(stops))
    if not replay.placed.turns:
        return np.full(len(stops), np.inf)
    if alignment.residual_rms_m is None:
        return np.zeros(len(stops))
    error = _from_start(replay, stops)
    for ns in track.restarts_ns:  # joined logs were fitted one by one
        k = int(np.searchsorted(track.ns, ns))
        if 0 < k < len(track):
            error = error + _apart(_pose(track, k - 1), _pose(track, k), 0.0, stops)
    return error


def _from_start(replay: Replay, stops: FloatArray) -> FloatArray:
    """Return how far the first pose moves each stop off; a moving robot may have begun one pose before."""
    start, track = replay.mission.start, replay.run.poses
    wanted, begin = (start.x, start.y, start.heading), int(track.ns[0])
    first = next((match.standstill for match in replay.matches[:1]), None)
    if first is not None and first.begin_ns - begin <= FIRST_NS:
        headings = np.unwrap(track.between(begin, first.end_ns).heading)
        unsure = float(np.std(headings) / math.sqrt(len(headings)))
        return _apart((first.x, first.y, first.heading), wanted, unsure, stops)
    one, other = _pose(track, 0), _pose(track, min(1, len(track) - 1))
    before = (2 * one[0] - other[0], 2 * one[1] - other[1], 2 * one[2] - other[2])
    return min((_apart(pose, wanted, 0.0, stops) for pose in (one, before)), key=np.max)


def _pose(track: Track, index: int) -> XYHeading:
    x, y = track.xy[index].tolist()
    return x, y, float(track.heading[index])


def _apart(pose: XYHeading, wanted: XYHeading, unsure: float, stops: FloatArray) -> FloatArray:
    """Return how far points (n, 2) move by the transform of one pose to another, at most."""
    turn = abs(math.remainder(pose[2] - wanted[2], math.tau))
    away = np.hypot(*(stops - wanted[:2]).T)
    return np.asarray(math.dist(pose[:2], wanted[:2]) + max(0.0, turn - SIGMAS * unsure) * away)
