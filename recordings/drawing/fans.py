"""Outline of what a viewpoint sees: the far ends of its lines of sight, else the viewpoint itself."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray

BRIDGED_M = 0.15
"""Lines whose ends are nearer than this are joined; units are visible as a whole, so corners have gaps."""
LEAST = 1e-9
"""Smallest angle, and smallest area in m², that counts."""


def sight_outline(eye: FloatArray, lines: FloatArray) -> FloatArray:
    """Return the closed outline (p, 2) between a viewpoint (2,) and the lines (k, 2, 2) that it sees.

    Where one line is behind another, as a wall behind a beam, the outline follows the farther one.
    """
    a, b = lines[:, 0] - eye, lines[:, 1] - eye
    orientation = _cross(a, b)
    a, b = np.where(orientation[:, None] < 0, b, a), np.where(orientation[:, None] < 0, a, b)
    real = np.abs(orientation) > LEAST
    a, b = a[real], b[real]
    if not len(a):
        return np.stack([eye, eye])
    begin = np.arctan2(a[:, 1], a[:, 0]) % (2 * np.pi)
    span = np.arctan2(_cross(a, b), (a * b).sum(axis=1))
    edges = _distinct_angles(np.sort(np.concatenate([begin, begin + span]) % (2 * np.pi)))
    after = np.roll(edges, -1)
    after[-1] += 2 * np.pi
    middle = (edges + after) / 2
    inside = (middle[:, None] - begin) % (2 * np.pi) < span
    if not inside.any():  # every visible line is practically edge-on
        return np.stack([eye, eye])
    farthest = np.where(inside, _distance(middle[:, None], a, b), -1.0).argmax(axis=1)
    ends = [_along(angle, a[farthest], b[farthest]) for angle in (edges, after)]
    return eye + _closed_line(np.stack(ends, axis=1), np.any(inside, axis=1))


def _distinct_angles(angles: FloatArray) -> FloatArray:
    """Return sorted angles without repetitions."""
    distinct = angles[np.concatenate([[True], np.diff(angles) > LEAST])]
    wraps = len(distinct) > 1 and distinct[0] + 2 * np.pi - distinct[-1] < LEAST
    return distinct[:-1] if wraps else distinct


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _distance(angle: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance, in a direction, to the line through a and b."""
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = _cross(direction, b - a)
    return _cross(a, b - a) / np.where(np.abs(across) < LEAST, LEAST, across)


def _along(angle: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the points (n, 2) of the lines in these directions."""
    return _distance(angle, a, b)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _closed_line(far_lines: FloatArray, seen: BoolArray) -> FloatArray:
    """Join the visible far lines (n, 2, 2) into one closed line; gaps pass the viewpoint (0, 0)."""
    first = int(np.flatnonzero(seen)[0])
    order = np.concatenate([np.arange(first, len(seen)), np.arange(first)])
    visible = far_lines[order[seen[order]]]
    gap = ~np.roll(seen, -1)[order[seen[order]]]
    apart = np.hypot(*(np.roll(visible[:, 0], -1, axis=0) - visible[:, 1]).T)
    points: list[FloatArray] = []
    for line_part, open_, far in zip(visible, gap.tolist(), apart.tolist(), strict=True):
        points += [line_part[0], line_part[1]]
        if open_ and far > BRIDGED_M:
            points.append(np.zeros(2))
    line = np.array([*points, points[0]])
    moved = np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > LEAST])
    return np.asarray(line[moved])
