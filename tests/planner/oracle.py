"""Brute-force visibility: every viewpoint against every unit against every occluder edge, in integers."""

from __future__ import annotations

import numpy as np
from numba import njit


def visible_pairs(viewpoints, edges, a, b, units, is_face, *, reach):
    """Matrix (viewpoints, units) of what is seen, all coordinates in whole grid steps.

    A unit is seen if a ray turned by an arbitrarily small angle to the left, or to the right, reaches it:
    corners that lie exactly on the ray count as lying on the other side.
    """
    segment = np.repeat(np.arange(len(units)), units)
    first = np.concatenate([[0], np.cumsum(units)])[:-1]
    odd = 2 * (np.arange(len(segment)) - first[segment]) + 1
    pieces = 2 * units[segment]
    near = _in_reach(viewpoints, a[segment], b[segment], odd, pieces, reach)
    return _unblocked(viewpoints, edges, a[segment], b[segment], odd, pieces, is_face[segment], near)


@njit(cache=True)
def _orient(px, py, qx, qy, rx, ry):
    return (qx - px) * (ry - py) - (qy - py) * (rx - px)


@njit(cache=True)
def _unblocked(viewpoints, edges, a, b, odd, pieces, is_face, near_enough):
    seen = np.zeros((len(viewpoints), len(a)), dtype=np.bool_)
    for v in range(len(viewpoints)):
        x, y = viewpoints[v]
        for u in range(len(a)):
            if not near_enough[v, u]:
                continue
            if is_face[u] and _orient(a[u, 0], a[u, 1], b[u, 0], b[u, 1], x, y) <= 0:
                continue
            left_open, right_open = True, True
            for e in range(len(edges)):
                cx, cy, dx, dy = edges[e]
                near = _orient(cx, cy, dx, dy, x, y)
                at_a = _orient(cx, cy, dx, dy, a[u, 0], a[u, 1])
                at_b = _orient(cx, cy, dx, dy, b[u, 0], b[u, 1])
                far = (pieces[u] - odd[u]) * at_a + odd[u] * at_b
                if near == 0 or far == 0 or (near > 0) == (far > 0):
                    continue
                c_a, c_b = _orient(x, y, a[u, 0], a[u, 1], cx, cy), _orient(x, y, b[u, 0], b[u, 1], cx, cy)
                d_a, d_b = _orient(x, y, a[u, 0], a[u, 1], dx, dy), _orient(x, y, b[u, 0], b[u, 1], dx, dy)
                c = (pieces[u] - odd[u]) * c_a + odd[u] * c_b
                d = (pieces[u] - odd[u]) * d_a + odd[u] * d_b
                if (c > 0) != (d > 0):
                    left_open = False
                if (c >= 0) != (d >= 0):
                    right_open = False
                if not (left_open or right_open):
                    break
            seen[v, u] = left_open or right_open
    return seen


def _in_reach(viewpoints, a, b, odd, pieces, reach):
    if reach is None:
        return np.ones((len(viewpoints), len(a)), dtype=np.bool_)
    inside = np.zeros((len(viewpoints), len(a)), dtype=np.bool_)
    for v, q in enumerate(viewpoints):
        away = pieces[:, None] * (a - q) + odd[:, None] * (b - a)
        squared = (away.astype(float) ** 2).sum(axis=1)
        limit = (pieces.astype(float) * reach) ** 2
        inside[v] = squared < limit
        for u in np.flatnonzero(np.abs(squared - limit) <= 1e-9 * limit):
            x, y = int(away[u, 0]), int(away[u, 1])
            inside[v, u] = x * x + y * y <= (int(pieces[u]) * reach) ** 2
    return inside
