"""Shares of the turns at a stop, one for each leg there, so that a sum over legs counts turns too.

A tour uses two legs at a stop. The turn between them takes at least the sum of their shares. Legs out of a
room by its one door share half a turn; legs along a corridor, in opposite directions, share none.
"""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import FloatArray

ROUNDS = 12
"""Rounds in which all shares of a stop rise together."""


def turn_shares(away: FloatArray, *, turn_rate: float, scan: float | None = None) -> FloatArray:
    """Seconds of turning (legs,) of legs that leave a stop with the headings `away` (legs,).

    For any two legs the sum of their shares is at most the seconds to turn from one into the other, by way
    of the heading `scan` if it is given. Legs of the lower index are served first where legs compete.
    """
    turn = _turns(away, scan) / turn_rate
    share = np.zeros(len(away))
    for _ in range(ROUNDS):
        share += (turn - share[:, None] - share[None, :]).min(axis=1) / 2
    for k in range(len(away)):
        left = turn[k] - share - share[k]
        left[k] /= 2
        share[k] += max(0.0, float(left.min()))
    return share


def _turns(away: FloatArray, scan: float | None) -> FloatArray:
    """Radians (legs, legs) turned between arriving by one leg and leaving by another, in either direction."""
    if scan is None:
        return _apart(away[:, None] + np.pi, away[None, :])
    come, go = _apart(away + np.pi, scan), _apart(away, scan)
    through = come[:, None] + go[None, :]
    return np.minimum(through, through.T)


def _apart(a: FloatArray, b: FloatArray | float) -> FloatArray:
    """Radians between headings, the short way round."""
    turned: FloatArray = np.abs(np.remainder(a - b + np.pi, 2 * np.pi) - np.pi)
    return turned
