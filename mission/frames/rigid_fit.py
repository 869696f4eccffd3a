"""Pairs of points -> the turn and shift that bring the first of each onto the second, by least squares.

Umeyama, Least-Squares Estimation of Transformation Parameters Between Two Point Patterns, IEEE PAMI 13(4),
1991, in the plane and without scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.frames.transform import Transform
from stopgo.mission.geometry import FloatArray, frozen

LEAST_SPREAD_M = 0.5
"""Root mean square distance of the points from their middle, below which the turn is guessed."""
MIRRORED = 1.01
"""By so much points fit better on a mirrored map if it is one; noise of points in a line does less."""
LARGEST_SCALE = 0.02
"""Scale off 1 by more than this: other units, or points that do not belong together."""


@dataclass(frozen=True, eq=False)
class RigidFit:
    """A turn, then a shift, and how far each pair is left apart by it."""

    transform: Transform
    residuals: FloatArray
    """Metres (n,), of each pair; all 0 for two pairs of the same distance."""
    scale: float
    """How much larger the second points lie apart than the first; it is told, not applied."""

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt((self.residuals**2).mean()))

    @property
    def max_m(self) -> float:
        """The largest residual."""
        return float(self.residuals.max())


def rigid_fit(first: FloatArray, second: FloatArray) -> RigidFit:
    """The turn and shift from points (n, 2) to their partners (n, 2), in metres.

    Raises
    ------
    InputError
        Fewer than two pairs, points too near each other to tell a turn, another scale, or a mirrored map.
    """
    if len(first) < 2:
        raise InputError("one pair of points: two are needed, and a third tells whether they are right")
    a, b = first - first.mean(axis=0), second - second.mean(axis=0)
    spread, other = (float(np.sqrt((points**2).sum(axis=1).mean())) for points in (a, b))
    if min(spread, other) < LEAST_SPREAD_M:
        raise InputError(
            f"the points lie within {min(spread, other):.2f} m of their middle, too near each other to tell "
            f"a turn; choose points at least {4 * LEAST_SPREAD_M:g} m apart"
        )
    along, across = _products(a, b)
    scale = other / spread
    if abs(scale - 1) > LARGEST_SCALE:
        raise InputError(
            f"the points of the map lie {scale:.3f} times as far apart as those of the site; "
            "are both in metres, and in the same order?"
        )
    if _is_mirrored(a, b, math.hypot(along, across)):
        raise InputError("the map is mirrored: exchange its x and y, or turn the sign of one of them")
    heading = math.atan2(across, along)
    cos, sin = math.cos(heading), math.sin(heading)
    turned = first @ np.array([[cos, sin], [-sin, cos]])
    x, y = (second.mean(axis=0) - turned.mean(axis=0)).tolist()
    away = turned + np.array([x, y]) - second
    return RigidFit(Transform(x=x, y=y, heading=heading), frozen(np.hypot(*away.T)), scale)


def _products(a: FloatArray, b: FloatArray) -> tuple[float, float]:
    """Sums of the inner and outer products of pairs: cosine and sine of the turn, but for a factor."""
    return float((a * b).sum()), float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def _is_mirrored(a: FloatArray, b: FloatArray, fits: float) -> bool:
    """Whether the points fit better with one axis turned round; points in a line cannot tell."""
    return math.hypot(*_products(a, b * (1.0, -1.0))) > MIRRORED * fits
