"""Position errors of visits, each with its uncertainty: what drift, a shifted map or a fit may have added.

Offsets that point to one side at stops that follow each other are drift, or a frame that lies elsewhere.
Both look the same as a robot that stood elsewhere each time, so that the common part is uncertain. Where the
visits suffice, a fit of the drift separates both (`drift_model`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.own import SITE
from stopgo.recordings.replay.drift_model import DriftFit, drift_fit
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.matching import Match
from stopgo.recordings.replay.path_and_time import smoothed_track
from stopgo.recordings.replay.replayed import Replay

PARKED = 2
"""Standstills at no stop that every run has: before its start, and at the end."""
NEIGHBOURS = 4
"""Number of visits around a stop whose common offset is its uncertainty."""
COHERENT = 0.5
"""Fraction of the offsets below which their neighbours must predict them, for a frame tied to the site."""
SCATTERED, LEAST_SCATTERED = 0.9, 6
"""Fraction from which on they do not follow each other as drift does, and the number of visits needed."""
JUMP_M, JUMP_M_S = 0.5, 5.0
"""Distance and speed from which on the step between two poses is a jump."""
HEALED_S = 5.0
"""Time within which poses come back from a jump that does not last."""


@dataclass(frozen=True, eq=False)
class PositionErrors:
    """Uncertainty of the position at each stop of a mission, n of them."""

    unsure_m: FloatArray
    """Common offset of the visits around each stop, metres (n,); 0 where nothing suggests one."""
    most_m: FloatArray
    """Offset that drift may have added at each stop (n,); 0 where it can have added none."""
    drift: DriftFit | None
    """What a fit of the drift leaves, by visit; None where none is needed, or none explains the offsets."""
    visits: tuple[int, ...]
    """Indices of the visited stops, in the order of `drift`."""

    @property
    def drifts(self) -> bool:
        """True if the offsets of the visits are drift, or may be."""
        return self.drift is not None or bool(np.isinf(self.most_m).any())

    def without_drift(self, stop: int) -> tuple[float, float] | None:
        """Return the position error at a stop without the fitted drift, and its uncertainty."""
        if self.drift is None or stop not in self.visits:
            return None
        k = self.visits.index(stop)
        return float(self.drift.left_m[k]), float(self.drift.unsure_m[k])


def position_errors(replay: Replay) -> PositionErrors:
    """Return the uncertainty of each stop's position, and the fit of the drift where it is needed."""
    stops = np.array([(stop.x, stop.y) for stop in replay.mission.stops])
    visits = visits_of(replay)
    indices = tuple(k for k, _ in visits)
    sure = np.zeros(len(stops))
    if len(visits) < 2:
        return PositionErrors(sure, sure, None, indices)
    offsets = np.array([np.subtract(match.standstill.xy, stops[k]) for k, match in visits])
    common = _common(offsets)
    left, least = _left_of(offsets, common), min(stop.tolerance_m for stop in replay.mission.stops)
    drift = _drift(replay, visits, stops, least) if np.hypot(*offsets.T).max() > least / 2 else None
    if is_tied(replay) and drift is None and (len(visits) < NEIGHBOURS or left >= COHERENT):
        scattered = np.median(np.hypot(*offsets.T)) <= least or len(replay.extra) <= PARKED
        return PositionErrors(sure, sure if scattered else np.full(len(stops), np.inf), None, indices)
    by_stop = dict(zip(indices, np.hypot(*common.T).tolist(), strict=True))
    everywhere = float(np.hypot(*np.median(offsets, axis=0)))
    unsure = np.maximum([by_stop.get(k, everywhere) for k in range(len(stops))], _residual(replay, offsets))
    if drift is None and len(visits) >= LEAST_SCATTERED and left >= SCATTERED:
        return PositionErrors(unsure, sure, None, indices)
    return PositionErrors(unsure, _most(replay, visits, offsets, unsure, least), drift, indices)


def _most(
    replay: Replay,
    visits: list[tuple[int, Match]],
    offsets: FloatArray,
    unsure: FloatArray,
    tolerance_m: float,
) -> FloatArray:
    """Return the offset that drift may have added at each stop (n,).

    Where half of the visits lie off, it may have added any. Else drift does not leave and come back between
    two stops that hold; but before the first and after the last one it may have grown.
    """
    whole = np.hypot(*offsets.T)
    if np.median(whole) > tolerance_m / 2:
        return np.full(len(unsure), np.inf)
    most = unsure.copy()
    for at, beside in ((0, 1), (-1, -2)):
        between = sorted((visits[at][1].standstill.begin_ns, visits[beside][1].standstill.begin_ns))
        path_m = replay.run.poses.between(*between).length_m
        most[visits[at][0]] += float(whole[beside]) + STRETCH * path_m
    return most


def visits_of(replay: Replay) -> list[tuple[int, Match]]:
    """Return the last standstill at each visited stop, with the stop's index, in order of time."""
    last = {match.stop: match for match in replay.matches if match.stop is not None}
    return sorted(last.items(), key=lambda item: item[1].standstill.begin_ns)


def is_tied(replay: Replay) -> bool:
    """True for poses that the earth, a map or stopgo itself ties to the site, without a jump that lasts."""
    placed = replay.placed
    tied = placed.by_earth or placed.source.frame in (SITE, "map", "world")
    return tied and lasting_jump(replay.run.poses) is None


def lasting_jump(track: Track) -> tuple[int, float] | None:
    """Return the time and size of the first jump from which poses do not come back; None without one."""
    if len(track) < 2:
        return None
    step, seconds = np.hypot(*np.diff(track.xy, axis=0).T), np.diff(track.ns) / 1e9
    jumps = np.flatnonzero((step > JUMP_M) & (step > JUMP_M_S * seconds)).tolist()
    closed: set[int] = set()
    for number, k in enumerate(jumps):
        back = next((m for m in jumps[number + 1 :] if _comes_back(track, k, m)), None)
        closed |= set() if back is None else {m for m in jumps if k <= m <= back}
        if k not in closed:
            return int(track.ns[k + 1]), float(step[k])
    return None


def _comes_back(track: Track, leaves: int, returns: int) -> bool:
    """True if the jump after a pose is undone by a later one, soon and to where the robot was."""
    seconds = (track.ns[returns + 1] - track.ns[leaves]) / 1e9
    away = float(np.hypot(*(track.xy[returns + 1] - track.xy[leaves])))
    return bool(seconds <= HEALED_S and away <= JUMP_M + seconds)


def _around(count: int) -> list[IntArray]:
    """Return the indices of the visits around each of `count`, without its own."""
    others = [np.flatnonzero(np.arange(count) != k) for k in range(count)]
    return [near[np.argsort(np.abs(near - k), kind="stable")[:NEIGHBOURS]] for k, near in enumerate(others)]


def _common(offsets: FloatArray) -> FloatArray:
    """Return the median offset of the visits around each, without its own (n, 2)."""
    return np.array([np.median(offsets[near], axis=0) for near in _around(len(offsets))])


def _left_of(offsets: FloatArray, common: FloatArray) -> float:
    """Return the fraction of the offsets that those of the visits around do not predict.

    Drift leaves a small part; real position errors have no such order.
    """
    left, whole = np.hypot(*(offsets - common).T), np.hypot(*offsets.T)
    return float(np.median(left) / max(float(np.median(whole)), 1e-9))


def _residual(replay: Replay, offsets: FloatArray) -> float:
    """Return the median that a fit to the stops leaves, as few stops may really lie off; 0 without a fit."""
    alignment = replay.run.alignment
    if alignment is None or alignment.residual_rms_m is None:
        return 0.0
    return float(np.median(np.hypot(*offsets.T)))


def _drift(
    replay: Replay, visits: list[tuple[int, Match]], stops: FloatArray, tolerance_m: float
) -> DriftFit | None:
    """Return the fit of the drift to the visits, for a path without gaps and jumps."""
    track = replay.run.poses
    if not len(track) or track.gaps.any() or lasting_jump(track) is not None:
        return None
    path = smoothed_track(track, replay.matches)
    ns: IntArray = np.array([match.standstill.end_ns for _, match in visits], np.int64)
    xy = np.array([match.standstill.xy for _, match in visits])
    start = np.array([replay.mission.start.x, replay.mission.start.y])
    planned = stops[[k for k, _ in visits]]
    return drift_fit(path, ns, xy, planned, start=start, tolerance_m=tolerance_m)
