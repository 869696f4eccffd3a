"""Drift of odometry, estimated from the standstills at stops: a wrong scale, and a wrong rate of turning.

Wheels that are a little larger than assumed, and a gyroscope with an offset, bend and stretch a path in the
same way all the time. Six numbers describe that: shift and turn of the whole, scale, and turns per metre and
per second. They are fitted to the offsets of all visits. Each stop is then judged by the fit without it, so
that a position error at one stop is distinguished from drift. Without enough visits, or with offsets
that such a drift does not explain, there is no answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.run.run_log import Track

PARAMETERS = 6
LEAST_STOPS = 6
"""Number of stops that the fit needs: two numbers each, against six that are fitted."""
MOST_LEFT_OUT = 0.25
"""Largest fraction of stops at which the robot may have stood elsewhere."""
ROUNDS = 4
"""Rounds of the fit: turns of a long path are not small."""
LEAST_SIGMA_M = 0.005
SIGMAS = 2.0
LARGEST_SCALE, LARGEST_TURN_M, LARGEST_TURN_S = 0.03, 0.01, 0.002
"""Limits of plausible odometry: scale, and turns in radians per metre and per second."""


@dataclass(frozen=True, eq=False)
class DriftFit:
    """Offsets of the visits from their stops, without the drift."""

    left_m: FloatArray
    """Distance of each visit from its stop that the drift of all others does not explain (n,)."""
    unsure_m: FloatArray
    """Uncertainty of that (n,)."""


def drift_fit(
    track: Track, ns: IntArray, xy: FloatArray, stops: FloatArray, *, start: FloatArray, tolerance_m: float
) -> DriftFit | None:
    """Fit the drift of a track to its visits; None if no plausible drift explains them.

    Parameters
    ----------
    track
        Path of the run, without noise, in the mission's frame.
    ns, xy
        Time (n,) and position (n, 2) of each visit.
    stops
        Planned positions of the same visits (n, 2).
    start
        Position where the run began, which the drift must not move.
    """
    if len(ns) < LEAST_STOPS or len(track) < 2:
        return None
    moved = _Path.of(track, np.concatenate([track.ns[:1], ns]), np.concatenate([track.xy[:1], xy]))
    wanted = np.concatenate([start[None], stops])
    used = np.ones(len(wanted), bool)
    while True:
        found = _fitted(moved, wanted, used)
        if found is None:
            return None
        left, unsure = found
        bad = np.flatnonzero(used & (left > tolerance_m))
        if not len(bad):
            return DriftFit(left[1:], unsure[1:]) if used[0] and left[0] <= tolerance_m else None
        used[bad[left[bad].argmax()]] = False
        if not used[0] or (~used).sum() > MOST_LEFT_OUT * len(ns) or used.sum() <= LEAST_STOPS:
            return None


@dataclass(frozen=True, eq=False)
class _Path:
    """Steps of a path, and the index of each visit in it."""

    xy: FloatArray
    """(n, 2)."""
    metres: FloatArray
    """Length so far (n,)."""
    seconds: FloatArray
    at: IntArray
    """Index of each visit."""
    off: FloatArray
    """Position of each visit over that of the path there."""

    @classmethod
    def of(cls, track: Track, ns: IntArray, xy: FloatArray) -> _Path:
        step = np.hypot(*np.diff(track.xy, axis=0).T)
        at = np.clip(np.searchsorted(track.ns, ns), 0, len(track) - 1)
        metres = np.concatenate([[0.0], np.cumsum(step)])
        return cls(track.xy, metres, (track.ns - track.ns[0]) / 1e9, at, xy - track.xy[at])

    def corrected(self, values: FloatArray) -> FloatArray:
        """Return the path (n, 2) without a drift of six values."""
        x, y, turn, scale, by_metre, by_second = values
        angle = turn + by_metre * self.metres + by_second * self.seconds
        step = np.diff(self.xy, axis=0) * (1.0 + scale)
        cos, sin = np.cos(angle[1:]), np.sin(angle[1:])
        turned = np.stack([cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], axis=-1)
        moved = np.concatenate([self.xy[:1], self.xy[0] + np.cumsum(turned, axis=0)])
        return np.asarray(moved + np.array([x, y]))

    def columns(self, path: FloatArray) -> FloatArray:
        """Return how each value moves each visit: (visits, 2, 6)."""
        step, to = np.diff(path, axis=0), path - path[0]
        ones = np.ones(len(path))
        bent = [
            _left(np.concatenate([[[0.0, 0.0]], np.cumsum(step * weight[1:, None], axis=0)]))
            for weight in (self.metres, self.seconds)
        ]
        zero = np.zeros(len(path))
        parts = [np.stack([ones, zero], -1), np.stack([zero, ones], -1), _left(to), to, *bent]
        return np.stack(parts, axis=-1)[self.at]


def _left(xy: FloatArray) -> FloatArray:
    """Return vectors (n, 2) turned by 90 degrees to the left."""
    return np.stack([-xy[:, 1], xy[:, 0]], axis=-1)


def _fitted(path: _Path, wanted: FloatArray, used: BoolArray) -> tuple[FloatArray, FloatArray] | None:
    """Return what each visit lacks by the fit without it, and how sure that is; None if it is implausible."""
    values = np.zeros(PARAMETERS)
    for _ in range(ROUNDS):
        corrected = path.corrected(values)
        offsets = wanted - (corrected[path.at] + path.off)
        columns = path.columns(corrected)
        values = values + _least_squares(columns[used], offsets[used])
    _, _, _, scale, by_metre, by_second = np.abs(values)
    if scale > LARGEST_SCALE or by_metre > LARGEST_TURN_M or by_second > LARGEST_TURN_S:
        return None
    offsets = wanted - (path.corrected(values)[path.at] + path.off)
    return _left_out(columns, offsets, used)


def _least_squares(columns: FloatArray, offsets: FloatArray) -> FloatArray:
    scale = np.maximum(np.abs(columns).max(axis=(0, 1)), 1e-9)
    table = (columns / scale).reshape(-1, PARAMETERS)
    return np.asarray(np.linalg.lstsq(table, offsets.reshape(-1), rcond=1e-9)[0]) / scale


def _left_out(columns: FloatArray, offsets: FloatArray, used: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the residual of each visit by the fit of all others, and its uncertainty (n,)."""
    left, unsure = np.zeros(len(offsets)), np.zeros(len(offsets))
    scale = np.maximum(np.abs(columns).max(axis=(0, 1)), 1e-9)
    for k in range(len(offsets)):
        others = used.copy()
        others[k] = False
        table = (columns[others] / scale).reshape(-1, PARAMETERS)
        wanted = offsets[others].reshape(-1)
        values = np.linalg.lstsq(table, wanted, rcond=1e-9)[0]
        spread = wanted - table @ values
        sigma = max(LEAST_SIGMA_M, float(np.sqrt(spread @ spread / max(1, len(wanted) - PARAMETERS))))
        mine = columns[k] / scale
        covariance = mine @ np.linalg.pinv(table.T @ table, rcond=1e-12) @ mine.T
        left[k] = np.hypot(*(offsets[k] - mine @ values))
        unsure[k] = SIGMAS * sigma * float(np.sqrt(max(0.0, np.linalg.eigvalsh(covariance)[-1])))
    return left, unsure
