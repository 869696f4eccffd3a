"""Pairs that register -> predicted error of every scan in the frame of one of them, by the whole network.

Registration measures the pose of one scan in another. With small errors as twists (vx, vy, ω) about the
origin of the floor, a pair measures the difference of two twists with the information M / NOISE_M², where M
is the pair's normal matrix about that origin. All pairs together are a least squares problem, as in the
design of geodetic networks: its normal matrix is a graph Laplacian of 3 × 3 blocks. Without the rows of the
scan that holds the frame, its inverse is the covariance of the others. Loops lower the errors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.planner.overlap.pairs import FLOOR_M, LEVER_M, NOISE_M


def information_of(moments: FloatArray, at: FloatArray) -> FloatArray:
    """Information (3, 3) of a pair from its normal matrix about the origin, for a scan at a point (2,).

    The error that no length of wall averages out is added at that point.
    """
    to_point = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]], [0.0, 0.0, 1.0]])
    from_point = np.linalg.inv(to_point)
    alone = NOISE_M**2 * np.linalg.inv(moments)
    least = FLOOR_M**2 * np.diag([1.0, 1.0, 1.0 / LEVER_M**2])
    return np.asarray(np.linalg.inv(alone + from_point @ least @ from_point.T), np.float64)


def scan_errors(
    xy: FloatArray, ends: Sequence[tuple[int, int]], information: Sequence[FloatArray], anchors: Sequence[int]
) -> FloatArray:
    """Standard deviation of each scan's position in its worst direction, metres (n,).

    Parameters
    ----------
    xy
        Positions of the scans (n, 2).
    ends, information
        Two scans of each pair, and its information about the origin (3, 3).
    anchors
        Scans whose poses are known. A scan that no pairs join to one has the error infinity.
    """
    count = len(xy)
    joined = _joined(count, ends, anchors)
    free = [k for k in range(count) if joined[k] and k not in anchors]
    row = {k: 3 * place for place, k in enumerate(free)}
    normal = np.zeros((3 * len(free), 3 * len(free)))
    for (a, b), block in zip(ends, information, strict=True):
        for i, j, sign in ((a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)):
            if i in row and j in row:
                normal[row[i] : row[i] + 3, row[j] : row[j] + 3] += sign * block
    covariance = np.linalg.inv(normal) if free else normal
    errors = np.where(joined, 0.0, np.inf)
    for k in free:
        own = covariance[row[k] : row[k] + 3, row[k] : row[k] + 3]
        there = np.array([[1.0, 0.0, -xy[k, 1]], [0.0, 1.0, xy[k, 0]]])
        errors[k] = np.sqrt(np.linalg.eigvalsh(there @ own @ there.T)[-1])
    return errors


def _joined(count: int, ends: Sequence[tuple[int, int]], anchors: Sequence[int]) -> list[bool]:
    """True for each scan that pairs join to an anchor."""
    near: list[list[int]] = [[] for _ in range(count)]
    for a, b in ends:
        near[a].append(b)
        near[b].append(a)
    found, waiting = set(anchors), list(anchors)
    while waiting:
        for other in near[waiting.pop()]:
            if other not in found:
                found.add(other)
                waiting.append(other)
    return [k in found for k in range(count)]
