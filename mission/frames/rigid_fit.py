"""Rigid fit: the rotation and shift that bring points onto their partners, by least squares.

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
"""Root mean square distance of the points from their middle; below it the rotation is uncertain."""
MIRRORED = 1.01
"""Factor by which points of a mirrored map fit better mirrored; noise of collinear points stays below."""
LARGEST_SCALE = 0.02
"""Scale off 1 by more than this: other units, or points that do not belong together."""
LARGEST_RMS_M = 0.5
"""Residuals up to this, or `LARGEST_SCALE` of the points' spread, are those of maps that drift."""
LEAST_WIDTH = 0.02
"""Points nearer to one line than this fraction of their spread cannot show that a map is mirrored."""


@dataclass(frozen=True, eq=False)
class RigidFit:
    """A rotation, then a shift, and the residuals of the pairs."""

    transform: Transform
    residuals: FloatArray
    """Residual of each pair in metres (n,); all 0 for two pairs of the same distance."""
    scale: float
    """Distance ratio of the second points to the first; reported, not applied."""
    spread_m: float
    """Root mean square distance of the first points from their middle."""
    width_m: float
    """Root mean square distance of the first points from the line along them."""

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt((self.residuals**2).mean()))

    @property
    def max_m(self) -> float:
        """The largest residual."""
        return float(self.residuals.max())

    @property
    def is_doubtful(self) -> bool:
        """True if the residuals are those of points that were exchanged or noted wrongly."""
        return self.rms_m > max(LARGEST_RMS_M, LARGEST_SCALE * self.spread_m)

    @property
    def unshown(self) -> str:
        """Return in words a mistake that these points cannot show; empty if there is none."""
        if len(self.residuals) == 2:
            return "two points cannot show a mistake: add a third"
        if self.width_m < LEAST_WIDTH * self.spread_m:
            return "points on one line cannot show that the map is mirrored: add one off that line"
        return ""


def rigid_fit(first: FloatArray, second: FloatArray) -> RigidFit:
    """Return the rotation and shift from points (n, 2) to their partners (n, 2), in metres.

    Raises
    ------
    InputError
        Fewer than two pairs, points too near each other to fix a rotation, another scale, or a mirrored map.
    """
    if len(first) < 2:
        raise InputError("one pair of points: two are needed, and a third checks them")
    a, b = first - first.mean(axis=0), second - second.mean(axis=0)
    spread, other = (float(np.sqrt((points**2).sum(axis=1).mean())) for points in (a, b))
    if min(spread, other) < LEAST_SPREAD_M:
        raise InputError(
            f"the points are within {min(spread, other):.2f} m of their middle, too near each other to fix "
            f"a rotation; choose points at least {4 * LEAST_SPREAD_M:g} m apart"
        )
    along, across = _products(a, b)
    scale = other / spread
    if abs(scale - 1) > LARGEST_SCALE:
        raise InputError(
            f"the map's points are {scale:.3f} times as far apart as those of the site; "
            "are both in metres, and in the same order?"
        )
    if _is_mirrored(a, b, math.hypot(along, across)):
        raise InputError("the map is mirrored: exchange its x and y, or change the sign of one of them")
    transform = least_squares(first, second)
    residuals = frozen(np.hypot(*(transform.points(first) - second).T))
    width = float(np.linalg.svd(a, compute_uv=False)[1]) / math.sqrt(len(a))
    return RigidFit(transform, residuals, scale, spread, width)


def least_squares(first: FloatArray, second: FloatArray, weight: FloatArray | None = None) -> Transform:
    """Return the rotation and shift of least squared distances, each with its weight if given (n,)."""
    share = np.full((len(first), 1), 1 / len(first)) if weight is None else (weight / weight.sum())[:, None]
    middle, other = ((share * points).sum(axis=0) for points in (first, second))
    along, across = _products(share * (first - middle), second - other)
    turned = Transform(x=0.0, y=0.0, heading=math.atan2(across, along))
    x, y = turned.point(tuple(middle.tolist()))
    return Transform(x=float(other[0]) - x, y=float(other[1]) - y, heading=turned.heading)


def _products(a: FloatArray, b: FloatArray) -> tuple[float, float]:
    """Sums of the inner and outer products of pairs: cosine and sine of the rotation, times a factor."""
    return float((a * b).sum()), float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def _is_mirrored(a: FloatArray, b: FloatArray, fits: float) -> bool:
    """True if the points fit better with one axis mirrored; collinear points cannot show it."""
    return math.hypot(*_products(a, b * (1.0, -1.0))) > MIRRORED * fits
