"""Visibility by a test of every line against every edge: as whole matrices, and again in fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from stopgo.planner.visibility.sight.sightlines import LineByLine, Midpoints


def visible_pairs(viewpoints, edges, a, b, units, is_face, *, reach):
    """Matrix (viewpoints, units) of what is seen; all in whole grid steps, edges (e, 2, 2)."""
    midpoints = Midpoints.of(a, b, units, is_face)
    lines = LineByLine(midpoints, edges, reach=reach)
    matrix = np.zeros((len(viewpoints), len(midpoints.odd)), dtype=bool)
    for row, place in zip(matrix, viewpoints, strict=True):
        row[lines.seen_from(place)] = True
    return matrix


def seen_in_fractions(place, a, b, odd, pieces, edges, *, is_face, reach) -> bool:
    """True if the position sees one midpoint, in Python's integers, which have no bounds."""
    q, a, b = (tuple(map(int, point)) for point in (place, a, b))
    t = Fraction(int(odd), int(pieces))
    m = (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
    if is_face and _turn(a, b, q) <= 0:
        return False
    if reach is not None and (m[0] - q[0]) ** 2 + (m[1] - q[1]) ** 2 > int(reach) ** 2:
        return False
    left_open, right_open = True, True
    for c, d in edges.tolist():
        if _turn(c, d, q) * _turn(c, d, m) < 0:
            on_c, on_d = _turn(q, m, c), _turn(q, m, d)
            left_open &= (on_c > 0) == (on_d > 0)
            right_open &= (on_c >= 0) == (on_d >= 0)
    return left_open or right_open


def _turn(p, q, r):
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
