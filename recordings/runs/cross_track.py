"""How far a position lies beside a route: signed, positive to the left of the driving direction."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mission.geometry import FloatArray


def cross_track(ways: Iterable[FloatArray], *, x: float, y: float) -> float:
    """Distance in metres from (x, y) to the nearest of the polylines (n, 2)."""
    pieces = [np.stack([way[:-1], way[1:]], axis=1) for way in ways]
    a, b = np.concatenate(pieces).transpose(1, 0, 2)
    along, to_point = b - a, np.array([x, y]) - a
    length2 = (along**2).sum(axis=1)
    t = np.divide((to_point * along).sum(axis=1), length2, out=np.zeros_like(length2), where=length2 > 0)
    away = to_point - np.clip(t, 0.0, 1.0)[:, None] * along
    distance = np.hypot(away[:, 0], away[:, 1])
    nearest = int(np.argmin(distance))
    side = along[nearest, 0] * to_point[nearest, 1] - along[nearest, 1] * to_point[nearest, 0]
    return float(np.copysign(distance[nearest], side))
