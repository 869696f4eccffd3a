"""Position errors of visits, each with its uncertainty: what drift, a shifted map or a fit may have added.

Offsets that point to one side at stops that follow each other are drift, or a frame that lies elsewhere.
Both look the same as a robot that stood elsewhere each time, so that the common part is uncertain. Where the
visits suffice, a fit of the drift separates both (`drift_model`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.own import SITE
from stopgo.recordings.replay.drift_model import DriftFit, drift_fit
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.jumps import lasting_jump
from stopgo.recordings.replay.matching import Match
from stopgo.recordings.replay.path_and_time import smoothed_track
from stopgo.recordings.replay.replayed import Replay

PARKED = 2
"""Standstills at no stop that every run has: before its start, and at the end."""
NEIGHBOURS = 4
"""Number of visits around a stop whose common offset is its uncertainty."""
COHERENT = 0.5
"""Fraction of the offsets below which their neighbours must predict them, for a frame tied to the site."""
MEDIAN = 1.2
"""Root mean square of normal errors in the plane, as a multiple of their median."""
SIGMAS, STILL_M, LEAST_MEANS = 2.0, 0.1, 4
"""Standard deviations of noise; distance across a gap up to which the robot stood in it; least for a mean."""
STEP_M = 0.01
"""Step of latitudes and longitudes in an autopilot's items and reports, 1e-7 degrees."""
SCATTERED, LEAST_SCATTERED = 0.9, 6
"""Fraction from which on they do not follow each other as drift does, and the number of visits needed."""


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
    spread_m: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Uncertainty that the noise of the poses leaves at each stop (n,)."""
    moved_m: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Motion during the last standstill at each stop (n,): noise may join two standstills into one."""
    noise_m: float = 0.0
    """Standard deviation of a pose of a stationary robot."""

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
    return _with_noise(_common_errors(replay), replay)


def _common_errors(replay: Replay) -> PositionErrors:
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
        few = np.median(np.hypot(*offsets.T)) <= least
        scattered = few or (len(replay.extra) <= PARKED and not _path_is_lost(replay.run.poses))
        most = sure.copy() if scattered else np.full(len(stops), np.inf)
        most[list(indices[_drifting_since(offsets, least) :])] = np.inf
        return PositionErrors(sure, most, None, indices)
    by_stop = dict(zip(indices, np.hypot(*common.T).tolist(), strict=True))
    everywhere = float(np.hypot(*np.median(offsets, axis=0)))
    unsure = np.maximum([by_stop.get(k, everywhere) for k in range(len(stops))], _residual(replay, offsets))
    if drift is None and len(visits) >= LEAST_SCATTERED and left >= SCATTERED:
        return PositionErrors(unsure, sure, None, indices)
    return PositionErrors(unsure, _most(replay, visits, offsets, unsure, least), drift, indices)


def _drifting_since(offsets: FloatArray, tolerance_m: float) -> int:
    """Return the visit since which the offsets (n, 2) grow like drift until the last one; n if they do not.

    They begin within tolerance, and each is at least as large as the one before it.
    """
    size, since = np.hypot(*offsets.T), len(offsets) - 1
    while since > 0 and size[since - 1] <= size[since]:
        since -= 1
    grows = size[-1] > max(tolerance_m, 2 * size[since]) and size[since] <= tolerance_m
    return since if grows and len(offsets) - since >= LEAST_MEANS else len(offsets)


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


def _with_noise(errors: PositionErrors, replay: Replay) -> PositionErrors:
    """Return the errors with the noise of the poses, and what it leaves of the last standstill at each stop.

    That is the uncertainty of the mean of its seconds, or of a few poses with the noise of all standstills.
    """
    spread, moved, few = np.zeros(len(replay.mission.stops)), np.zeros(len(replay.mission.stops)), {}
    noises: list[FloatArray] = []
    for k, match in visits_of(replay):
        standstill = match.standstill
        moved[k] = standstill.moved_m if replay.inferred else 0.0
        poses = replay.run.poses.between(standstill.begin_ns, standstill.end_ns)
        if not replay.inferred:  # a reported visit contains some of the driving
            near = np.hypot(*(poses.xy - standstill.xy).T) <= STILL_M
            poses = Track.of(poses.ns[near], poses.xy[near], poses.heading[near])
        if len(poses) < 2:
            few[k] = 1
            continue
        off = poses.xy - standstill.xy
        means = [off[group].mean(axis=0) for group in _groups(((poses.ns - poses.ns[0]) // 10**9).tolist())]
        noises.append(np.hypot(*off.T) * (len(off) / (len(off) - 1)) ** 0.5)
        spread[k] = SIGMAS * _deviation(np.hypot(*np.array(means).T)) / len(means) ** 0.5
        if len(means) < LEAST_MEANS:
            few[k] = len(poses)
    noise_m = _deviation(np.concatenate(noises)) if noises else 0.0
    for k, count in few.items():
        spread[k] = max(spread[k], SIGMAS * noise_m / count**0.5)
    if replay.placed.by_earth:
        spread += STEP_M
    return replace(errors, spread_m=spread, moved_m=moved, noise_m=noise_m)


def _deviation(away: FloatArray) -> float:
    """Return the standard deviation of distances (n,) in the plane, by their median, without jumps."""
    return MEDIAN * float(np.median(away))


def _groups(values: list[int]) -> list[IntArray]:
    """Return the indices of equal values that follow each other."""
    return np.split(np.arange(len(values)), np.flatnonzero(np.diff(values)) + 1)


def is_tied(replay: Replay) -> bool:
    """True for poses that the earth, a map or stopgo itself ties to the site, without a jump that lasts."""
    placed = replay.placed
    tied = placed.by_earth or placed.source.frame in (SITE, "map", "world")
    return tied and lasting_jump(replay.run.poses) is None


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


def _path_is_lost(track: Track) -> bool:
    """True if the path is not known from pose to pose: the robot moved in a gap, or its poses jumped."""
    moved = np.hypot(*np.diff(track.xy, axis=0).T) > STILL_M
    return bool((track.gaps & moved).any()) or lasting_jump(track) is not None


def _drift(
    replay: Replay, visits: list[tuple[int, Match]], stops: FloatArray, tolerance_m: float
) -> DriftFit | None:
    """Return the fit of the drift to the visits, for a path without gaps and jumps."""
    track = replay.run.poses
    if not len(track) or _path_is_lost(track):
        return None
    path = smoothed_track(track, replay.matches)
    ns: IntArray = np.array([match.standstill.end_ns for _, match in visits], np.int64)
    xy = np.array([match.standstill.xy for _, match in visits])
    start = np.array([replay.mission.start.x, replay.mission.start.y])
    planned = stops[[k for k, _ in visits]]
    return drift_fit(path, ns, xy, planned, start=start, tolerance_m=tolerance_m)
