"""Jumps of a robot's poses that last: before or after one, its position was wrong by as much."""

from __future__ import annotations

import math

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
FASTER = 1.5
"""Speed in a longer step, as a multiple of the usual one, up to which the robot may have driven it."""
DRIVES_M_S, UNSTEADY, BENDS = 0.1, 0.1, 1.02
"""Least speed of driving, its change that is still steady, and the route's length by the straight step's."""
MISSING_STEPS = 3
"""Number of usual steps above which poses are missing, and may hide a jump."""


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
    count together, so that a jump away and back counts nothing. A longer time without poses predicts nothing,
    but limits how far the robot came. Where it restarted it may have been moved.
    """
    if len(track) <= 2 * STEPS:
        return 0.0
    aside, seconds = _aside(track), np.diff(track.ns) / 1e9
    size = np.hypot(*aside.T)
    least = max(LEAST_CORRECTION_M, SIGMAS * float(np.median(size)))
    speed, long = _usual_speed(track), seconds > LONGEST_S
    steps = np.flatnonzero(size > least + np.where(long, FASTER, BRAKING) * speed * seconds)
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
    aside = np.where((seconds > LONGEST_S)[:, None], step, aside)
    aside[_near_restart(track)] = 0.0
    return np.asarray(aside)


def hidden_jump(
    track: Track, off_m: FloatArray, route_m: FloatArray, least_m: float
) -> tuple[int, float] | None:
    """Return the time and size of the greatest step aside that a time without poses hides; None without one.

    It begins on the route and ends off it, or the robot drives the same way before and after and should be
    elsewhere: by a jump of the poses, or by a detour that nobody saw. `off_m` and `route_m` (n,) are the
    distance from the route and along it. Up to `least_m` is noise.
    """
    steps = np.diff(track.ns)
    if not len(steps) or len(off_m) != len(track):
        return None
    away, found = np.abs(off_m), (0, 0.0)
    for k in np.flatnonzero((steps > MISSING_STEPS * np.median(steps)) & ~_near_restart(track)).tolist():
        left = away[k] <= least_m < away[k + 1]
        size = math.dist(track.xy[k], track.xy[k + 1]) if left else _unpredicted_m(track, route_m, k)
        if size > max(least_m, found[1]):
            found = (int(track.ns[k + 1]), size)
    return found if found[1] else None


def _unpredicted_m(track: Track, route_m: FloatArray, k: int) -> float:
    """Return how far the pose after a step is from where steady driving leads; 0 where it is not steady."""
    if not STEPS <= k < len(track) - 1 - STEPS:
        return 0.0
    xy, seconds = track.xy, track.ns / 1e9 - track.ns[k] / 1e9
    before = (xy[k] - xy[k - STEPS]) / max(seconds[k] - seconds[k - STEPS], 1e-3)
    after = (xy[k + 1 + STEPS] - xy[k + 1]) / max(seconds[k + 1 + STEPS] - seconds[k + 1], 1e-3)
    speed, step = math.hypot(*before), xy[k + 1] - xy[k]
    steady = speed > DRIVES_M_S and math.dist(before, after) <= UNSTEADY * speed
    bends = route_m[k + 1] - route_m[k] > BENDS * math.hypot(*step)
    if not steady or bends or seconds[k + 1] > HEALED_S or math.hypot(*step) <= LEAST_CORRECTION_M:
        return 0.0
    aside = math.hypot(*(step - (before + after) / 2 * seconds[k + 1]))
    return aside if aside > LEAST_CORRECTION_M + UNSTEADY / 2 * speed * seconds[k + 1] else 0.0


def _near_restart(track: Track) -> BoolArray:
    """True for the steps around a restart (n - 1,)."""
    near = np.zeros(len(track) - 1, bool)
    for restart_ns in track.restarts_ns:
        near |= np.abs(track.ns[1:] - restart_ns) <= RESTART_NS
    return near
