"""Gaps in a robot's poses: times during which its position is unknown. Decided only here.

A robot sends poses at a rate of its own. A recording keeps at least one each `KEPT_S`, even of a
standstill. A step between two poses is a gap if it is longer than `GAP_STEPS` usual steps, or if the robot
restarted in it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stopgo.mission.geometry import BoolArray, IntArray, frozen

KEPT_S = 1.0
"""Longest step in seconds between the kept poses of a stationary robot."""
GAP_STEPS = 3
"""Number of usual steps above which poses are missing."""


def gap_limit_ns(steps_ns: ArrayLike) -> float:
    """Return the longest step without a gap, for a robot whose poses have these steps (n,), nanoseconds."""
    steps = np.asarray(steps_ns, dtype=np.float64)
    usual = float(np.median(steps)) if len(steps) else 0.0
    return GAP_STEPS * max(usual, KEPT_S * 1e9)


def gaps_after(ns: IntArray, restarts_ns: tuple[int, ...] = ()) -> BoolArray:
    """Return a mask (n - 1,) of the poses (n,) that a gap follows.

    `restarts_ns` are times of the first data after each restart of the robot.
    """
    steps = np.diff(ns)
    gaps = steps > gap_limit_ns(steps[steps > 0])
    for restart_ns in restarts_ns:
        first = int(np.searchsorted(ns, restart_ns, side="left"))
        if 0 < first < len(ns):
            gaps[first - 1] = True
    return frozen(gaps, np.bool_)
