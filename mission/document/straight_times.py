"""Durations of many straight drives at once; a module of its own, so that robots start without numpy."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import FloatArray


def straight_times(lengths: FloatArray, *, speed: float, acceleration: float) -> FloatArray:
    """Return `straight_time` of many lengths at once, to the same last digit."""
    short: FloatArray = 2 * np.sqrt(lengths / acceleration)
    return np.where(lengths >= speed**2 / acceleration, lengths / speed + speed / acceleration, short)
