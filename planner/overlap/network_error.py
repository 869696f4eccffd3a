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

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages.network import FLOOR_M, NOISE_M
from stopgo.planner.overlap.control import SeenPoint
from stopgo.planner.overlap.normal_equations import NormalEquations
from stopgo.planner.overlap.pairs import LEVER_M

TARGET_M = 2e-3
"""Error of a target's centre in a scan, metres (standard deviation)."""
MOST_FRAMES = 3
"""Scans tried as the frame of a network, those nearest to its middle."""


def information_of(moments: FloatArray, at: FloatArray, noise: float) -> FloatArray:
    """Information (3, 3) of a pair from its normal matrix about the origin, for a scan at a point (2,).

    The error that no length of wall averages out is added at that point. `noise` is the scanner's
    `noise_factor`: the pair's errors are larger by it.
    """
    to_point = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]], [0.0, 0.0, 1.0]])
    from_point = np.linalg.inv(to_point)
    alone = NOISE_M**2 * np.linalg.inv(moments)
    least = FLOOR_M**2 * np.diag([1.0, 1.0, 1.0 / LEVER_M**2])
    return np.asarray(np.linalg.inv(noise**2 * (alone + from_point @ least @ from_point.T)), np.float64)


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
    network = _HeldNetwork(len(xy), ends, information, [largest[nearest[0]]])
    tried = [(network.position_covariances(xy, largest[k]), largest[k]) for k in nearest.tolist()]
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
    return _HeldNetwork(len(xy), ends, information, anchors, seen).position_covariances(xy)


class _HeldNetwork:
    """The scans that anchors or control points hold, and the covariances of their motions."""

    def __init__(
        self,
        count: int,
        ends: Sequence[tuple[int, int]],
        information: Sequence[FloatArray],
        anchors: Sequence[int],
        seen: Sequence[SeenPoint] = (),
    ) -> None:
        self.held = np.array(_joined(count, ends, [*anchors, *_held(count, ends, seen)]), dtype=bool)
        free = np.flatnonzero(self.held)
        self.free = free[~np.isin(free, anchors)]
        self.equations = normal_equations(count, self.free, ends, information, seen)
        self.covariances = np.zeros((count, 3, 3))
        self.covariances[self.free] = self.equations.inverse_at_scans()

    def position_covariances(self, xy: FloatArray, frame: int | None = None) -> FloatArray:
        """Covariance of each scan's position (n, 2, 2), where one scan is the frame also in that of another.

        All motions are about one origin: in the frame of another scan its motion is taken from each.
        """
        moved = self.covariances
        if frame is not None and frame in self.free:
            unit = np.zeros((len(self.free), 3, 3))
            unit[self.free == frame] = np.eye(3)
            common = np.zeros_like(moved)
            common[self.free] = self.equations.solved(unit)
            moved = moved + moved[frame] - common - common.transpose(0, 2, 1)
        there = np.array([shift_at(at) for at in xy]).reshape(-1, 2, 3)
        found = there @ moved @ there.transpose(0, 2, 1)
        found[~self.held] = np.inf
        return np.asarray(found)


def normal_equations(
    count: int,
    free: IntArray,
    ends: Sequence[tuple[int, int]],
    information: Sequence[FloatArray],
    seen: Sequence[SeenPoint] = (),
) -> NormalEquations:
    """Return the normal equations of the free scans, in their order; the others do not move."""
    pairs = np.array(ends, dtype=np.int64).reshape(-1, 2)
    blocks = np.array(information, dtype=np.float64).reshape(-1, 3, 3)
    own = np.zeros((count, 3, 3))
    for side in pairs.T:
        np.add.at(own, side, blocks)
    for k, point in seen:
        move = shift_at(point) / TARGET_M
        own[k] += move.T @ move
    row = np.full(count, -1)
    row[free] = np.arange(len(free))
    both = (row[pairs] >= 0).all(axis=1)
    return NormalEquations(own[free], row[pairs[both]], -blocks[both])


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
