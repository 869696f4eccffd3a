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
from stopgo.planner.overlap.control import SeenPoint
from stopgo.planner.overlap.pairs import FLOOR_M, LEVER_M, NOISE_M

TARGET_M = 2e-3
"""Error of a target's centre in a scan, metres (standard deviation)."""
MOST_FRAMES = 3
"""Scans tried as the frame of a network, those nearest to its middle."""


def information_of(moments: FloatArray, at: FloatArray) -> FloatArray:
    """Information (3, 3) of a pair from its normal matrix about the origin, for a scan at a point (2,).

    The error that no length of wall averages out is added at that point.
    """
    to_point = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]], [0.0, 0.0, 1.0]])
    from_point = np.linalg.inv(to_point)
    alone = NOISE_M**2 * np.linalg.inv(moments)
    least = FLOOR_M**2 * np.diag([1.0, 1.0, 1.0 / LEVER_M**2])
    return np.asarray(np.linalg.inv(alone + from_point @ least @ from_point.T), np.float64)


def network_errors(
    xy: FloatArray,
    ends: Sequence[tuple[int, int]],
    information: Sequence[FloatArray],
    seen: Sequence[SeenPoint] = (),
) -> tuple[FloatArray, int | None]:
    """The `scan_covariances`, and the scan whose frame they are in; None for that of the control points.

    Control points hold the frame if the largest component sees two of them. Else it is that of the scan,
    of three in the middle of this component, with the least worst error.
    """
    largest = max(_components(len(xy), ends), key=len, default=[])
    if set(_held(len(xy), ends, seen)) & set(largest):
        return scan_covariances(xy, ends, information, [], seen), None
    away = np.hypot(*(xy[largest] - xy[largest].mean(axis=0)).T)
    nearest = np.argsort(np.round(away, 3), kind="stable")[:MOST_FRAMES]
    middle = [largest[k] for k in nearest.tolist()]
    tried = [(scan_covariances(xy, ends, information, [k]), k) for k in middle]
    return min(tried, key=lambda one: _worst(worst_errors(one[0])))


def _worst(errors: FloatArray) -> float:
    """The greatest finite error, rounded so that float noise prefers no frame."""
    return round(float(np.max(errors[np.isfinite(errors)], initial=0.0)), 6)


def worst_errors(covariances: FloatArray) -> FloatArray:
    """Standard deviation of each scan's position in its worst direction, metres (n,)."""
    return np.array([major for major, _, _ in error_ellipses(covariances)])


def error_ellipses(covariances: FloatArray) -> FloatArray:
    """Standard error ellipse of each scan's position (n, 3): half axes in metres, and radians from +x."""
    found = np.full((len(covariances), 3), np.inf)
    held = np.isfinite(covariances).all(axis=(1, 2))
    if held.any():
        variance, axes = np.linalg.eigh(covariances[held])
        found[held, :2] = np.sqrt(np.maximum(variance[:, ::-1], 0.0))
        found[held, 2] = np.arctan2(axes[:, 1, 1], axes[:, 0, 1]) % np.pi
    return found


def scan_covariances(
    xy: FloatArray,
    ends: Sequence[tuple[int, int]],
    information: Sequence[FloatArray],
    anchors: Sequence[int],
    seen: Sequence[SeenPoint] = (),
) -> FloatArray:
    """Covariance of each scan's position, square metres (n, 2, 2).

    Parameters
    ----------
    xy
        Positions of the scans (n, 2).
    ends, information
        Two scans of each pair, and its information about the origin (3, 3).
    anchors
        Scans whose poses are known.
    seen
        Scans, and the control points that they see. Two points hold all scans that pairs join to these.
        A scan that nothing holds has an infinite variance.
    """
    count = len(xy)
    joined = _joined(count, ends, [*anchors, *_held(count, ends, seen)])
    free = [k for k in range(count) if joined[k] and k not in anchors]
    normal = normal_matrix({k: 3 * place for place, k in enumerate(free)}, ends, information, seen)
    covariance = np.linalg.inv(normal) if free else normal
    found = np.zeros((count, 2, 2))
    found[~np.array(joined, dtype=bool)] = np.inf
    for place, k in enumerate(free):
        own = covariance[3 * place : 3 * place + 3, 3 * place : 3 * place + 3]
        there = shift_at(xy[k])
        found[k] = there @ own @ there.T
    return found


def normal_matrix(
    row: dict[int, int],
    ends: Sequence[tuple[int, int]],
    information: Sequence[FloatArray],
    seen: Sequence[SeenPoint] = (),
) -> FloatArray:
    """Return the normal matrix of the free scans, whose first rows these are."""
    normal = np.zeros((3 * len(row), 3 * len(row)))
    if len(ends):
        pair = np.array([(row.get(a, -1), row.get(b, -1)) for a, b in ends])
        first, second = pair[:, [0, 1, 0, 1]].ravel(), pair[:, [0, 1, 1, 0]].ravel()
        blocks = np.array(information)[:, None] * np.array([1.0, 1.0, -1.0, -1.0])[:, None, None]
        free = (first >= 0) & (second >= 0)
        at = first[free, None, None] + np.arange(3)[:, None], second[free, None, None] + np.arange(3)
        np.add.at(normal, at, blocks.reshape(-1, 3, 3)[free])
    for k, point in seen:
        if k in row:
            move = shift_at(point) / TARGET_M
            normal[row[k] : row[k] + 3, row[k] : row[k] + 3] += move.T @ move
    return normal


def _held(count: int, ends: Sequence[tuple[int, int]], seen: Sequence[SeenPoint]) -> list[int]:
    """Scans of the components that see two control points or more."""
    components = _components(count, ends) if seen else []
    return [k for component in components if sees_two_points(component, seen) for k in component]


def shift_at(point: FloatArray) -> FloatArray:
    """Return the matrix (2, 3) from a small motion (vx, vy, ω) about the origin to the shift at a point."""
    return np.array([[1.0, 0.0, -point[1]], [0.0, 1.0, point[0]]])


def sees_two_points(scans: Sequence[int], seen: Sequence[SeenPoint]) -> bool:
    """Return True if these scans together see two different control points or more."""
    return len({tuple(np.round(point, 3).tolist()) for k, point in seen if k in scans}) > 1


def _components(count: int, ends: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Scans by connected component, in the order of their first scans."""
    found: list[list[int]] = []
    left = dict.fromkeys(range(count))
    while left:
        joined = _joined(count, ends, [next(iter(left))])
        found.append([k for k in left if joined[k]])
        left = {k: None for k in left if not joined[k]}
    return found


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
