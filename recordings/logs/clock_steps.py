"""Times of a log whose clock was set while it was written: the order of writing decides.

A stamp that alone lies far from both neighbours is wrong, and its pose is left out. From a step back on, the
times count on from the last one before it. A step forward may be a gap, unless the robot drove through it
without moving farther than from one pose to the next. A log with many such steps is of a robot that writes
no poses while it stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray

STEP_NS = 10**9
"""Least step; poses that are out of order by less are only sorted."""
MOST_STEPS = 20
"""Limit of steps; with more, the log is out of order, and no clock was set."""
MOST_FORWARD = 2
"""Limit of long times without poses; with more, a robot that writes no poses while it stands is likely."""
ALONE_NS, ALONE_USUAL = 60 * 10**9, 1000
"""Least distance of a wrong stamp from its neighbours, also as a multiple of the usual interval."""
DRIVES_M_S = 0.1
LEAST_POSES = 5


@dataclass(frozen=True, eq=False)
class MendedTimes:
    """Times in the order of writing (n,)."""

    ns: IntArray
    kept: BoolArray
    """False for poses whose stamp is wrong (n,)."""
    lines: tuple[str, ...]
    """Steps and wrong stamps, one line each."""
    steps_ns: tuple[int, ...] = ()
    """Times of the steps, as mended: how long each took is unknown."""


def mended_times(ns: IntArray, xy: FloatArray, *, forward: bool = True) -> MendedTimes:
    """Return the times of poses (n, 2) without the steps of their clock.

    `forward`: steps forward are mended too. They are not where other messages have times of the same clock.
    """
    if len(ns) < LEAST_POSES:
        return MendedTimes(ns, np.ones(len(ns), bool), ())
    usual = max(1, int(np.median(np.abs(np.diff(ns)))))
    kept = ~_alone(ns, max(ALONE_NS, ALONE_USUAL * usual))
    wrong = int((~kept).sum())
    lines = [f"{wrong} of {len(ns)} poses have a time far from that of their neighbours; left out"]
    times, places = ns[kept].copy(), xy[kept]
    step = np.diff(times)
    back = np.flatnonzero(step < -STEP_NS)
    if len(back) > MOST_STEPS:
        return MendedTimes(ns, kept, tuple(lines[: bool(wrong)]))
    ahead = _forward_steps(step, places, usual).tolist() if forward else []
    steps = sorted({*back.tolist(), *ahead, *_undone(step, back, usual)})
    lines += [
        f"the clock steps {'back' if step[k] < 0 else 'forward'} by {abs(step[k]) / 1e9:.1f} s "
        f"after pose {k + 1} of {len(times)}; times continue in the order of writing"
        for k in steps
    ]
    for k in steps:
        times[k + 1 :] += usual - step[k]
    steps_ns = tuple(int(times[k]) for k in steps)
    mended = ns.copy()
    mended[kept] = times
    return MendedTimes(mended, kept, tuple(lines[0 if wrong else 1 :]), steps_ns)


def longest_usual_ns(usual_ns: int) -> int:
    """Return the longest time between poses that is neither a gap nor a clock that was set."""
    return max(STEP_NS, 10 * usual_ns)


def _undone(step: IntArray, back: IntArray, usual: int) -> list[int]:
    """Return the steps forward that undo a step back before them: the clock was set right again."""
    found = []
    for k in back.tolist():
        again = np.flatnonzero(np.abs(step + step[k]) <= longest_usual_ns(usual))
        found += [m for m in again.tolist() if m > k and m not in found][:1]
    return found


def _alone(ns: IntArray, far_ns: int) -> BoolArray:
    """True for stamps far from both neighbours, which are near each other; at an end, from the next two."""
    before = np.concatenate([ns[2:3], ns[:-1]])
    after = np.concatenate([ns[1:], ns[-3:-2]])
    alone = (np.abs(ns - before) > far_ns) & (np.abs(ns - after) > far_ns) & (np.abs(after - before) < far_ns)
    return np.asarray(alone, bool)


def _forward_steps(step: IntArray, xy: FloatArray, usual: int) -> IntArray:
    """Return the steps forward through which the robot drove on as from one pose to the next."""
    moved = np.hypot(*np.diff(xy, axis=0).T)
    inner = np.flatnonzero(step > longest_usual_ns(usual))
    if len(inner) > MOST_FORWARD:
        return np.zeros(0, np.int64)
    inner = inner[(inner > 0) & (inner < len(step) - 1)]
    speeds = moved / np.maximum(step, 1)
    speed = np.minimum(speeds[inner - 1], speeds[inner + 1])
    expected = speed * usual
    drives = speed * 1e9 > DRIVES_M_S
    return np.asarray(inner[drives & (np.abs(moved[inner] - expected) < expected / 2)])
