"""Jumps of a robot's poses that last: before or after one, its position was wrong by as much."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.run.run_log import Track

JUMP_M, JUMP_M_S = 0.5, 5.0
"""Distance and speed from which on the step between two poses is a jump."""
HEALED_S = 5.0
"""Time within which poses come back from a jump that does not last."""
LEAST_CORRECTION_M, SIGMAS = 0.1, 8.0
"""Least step aside of the path that counts, also as a multiple of the poses' noise."""
STEPS = 5
"""Number of steps on each side whose median is the robot's speed."""
BRAKING, FEW = 1.2, 0.95
"""Change of speed in a step, as a multiple of the usual speed, and the fraction of steps below that."""
LONGEST_S, RESTART_NS = 1.0, 10**9
"""Longest step between poses that tells of a speed, and time around a restart in which a jump is its own."""


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


def lasting_error_m(track: Track) -> float:
    """Return the size of the greatest step aside of the path that lasts; 0 without one.

    The robot's speed around a step predicts the next pose. Steps aside that follow each other within HEALED_S
    count together, so that a jump away and back counts nothing. Where the robot restarted it may have been
    moved, and a longer time without poses predicts nothing.
    """
    if len(track) <= 2 * STEPS:
        return 0.0
    aside, seconds = _aside(track), np.diff(track.ns) / 1e9
    size = np.hypot(*aside.T)
    least = max(LEAST_CORRECTION_M, SIGMAS * float(np.median(size)))
    steps = np.flatnonzero(size > least + BRAKING * _usual_speed(track) * seconds)
    if not len(steps):
        return 0.0
    apart = np.flatnonzero(np.diff(track.ns[steps]) > HEALED_S * 1e9) + 1
    return max(_left_by(aside[group], least) for group in np.split(steps, apart))


def _usual_speed(track: Track) -> float:
    """Return the speed that few steps exceed, m/s."""
    speed = np.hypot(*np.diff(track.xy, axis=0).T) / np.maximum(np.diff(track.ns) / 1e9, 1e-3)
    return float(np.quantile(speed, FEW))


def _left_by(aside: FloatArray, limit: float) -> float:
    """Return how far steps aside (n, 2) lead together; less than the limit is their noise."""
    left = float(np.hypot(*aside.sum(axis=0)))
    return left if left > limit else 0.0


def _aside(track: Track) -> FloatArray:
    """Return the part of each step between poses that the speed around does not predict (n - 1, 2)."""
    seconds = np.diff(track.ns) / 1e9
    step = np.diff(track.xy, axis=0)
    speed = step / np.maximum(seconds, 1e-3)[:, None]
    padded = np.pad(speed, ((STEPS, STEPS), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * STEPS + 1, axis=0)
    aside = step - np.median(windows, axis=-1) * seconds[:, None]
    aside[(seconds > LONGEST_S) | _near_restart(track)] = 0.0
    return np.asarray(aside)


def _near_restart(track: Track) -> BoolArray:
    """True for the steps around a restart (n - 1,)."""
    near = np.zeros(len(track) - 1, bool)
    for restart_ns in track.restarts_ns:
        near |= np.abs(track.ns[1:] - restart_ns) <= RESTART_NS
    return near
