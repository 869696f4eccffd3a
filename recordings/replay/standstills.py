"""Standstills of a robot: when and where it was stationary, found from its poses alone, even noisy ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.run.run_log import Track

BIN_S = 0.2
"""Length of the bins that poses are averaged over: logs have from one to hundreds of poses a second."""
HALF = 4
"""Number of bins on each side whose means are compared to find movement."""
STILL_M_S, STILL_RAD_S = 0.04, 0.06
"""Speed below which a robot is stationary, if its poses have no noise."""
SIGMAS = 4.0
"""Number of standard deviations that speeds from noise alone do not exceed."""
FASTEST_STILL = 0.4
"""Limit as a fraction of the mission's speed: with more noise, nothing can be found."""
LEAST_S = 2.0
"""Shortest standstill."""
JOIN_S, JOIN_M = 0.7, 0.3
"""Two standstills this near in time and position are one: the robot's position was corrected between them."""
DENSE_S = 1.0
"""Largest step between poses whose differences are noise."""
EDGE_M, EDGE_RAD = 0.015, 0.03
"""Distance, besides noise, at which a robot has left its standstill, or not yet reached it."""
JUMPED_NS, JUMP_EDGE_NS = 6 * 10**9, 10**9
"""Longest time for which poses jump away, and time around it in which the steps are searched."""
JUMP_M, JUMP_SPEEDS = 0.1, 3.0
"""Length of a jump, and its speed as a multiple of the mission's."""
BLIND_S, BLIND_M = 3.0, 0.15
"""Gap without poses, and distance across it, from which on the robot has moved meanwhile."""
LARGEST_BINS = 5_000_000


@dataclass(frozen=True)
class Standstill:
    """One standstill."""

    begin_ns: int
    end_ns: int
    x: float
    y: float
    heading: float
    """Median of all poses, each coordinate by itself."""
    moved_m: float
    """Greatest distance from there of the robot's position averaged over a second."""

    @property
    def seconds(self) -> float:
        return (self.end_ns - self.begin_ns) / 1e9

    @property
    def xy(self) -> tuple[float, float]:
        return (self.x, self.y)


def find_standstills(track: Track, *, speed: float = 0.5, turns: bool = True) -> tuple[Standstill, ...]:
    """Return all standstills in order of time.

    A robot is stationary while neither its position nor, if `turns`, its heading changes faster than noise
    explains. The noise is measured from the poses themselves, by second differences, which a steady drive
    does not change. In a gap without poses, a robot that is where it was has been stationary, else it has
    moved.

    Parameters
    ----------
    speed
        Speed of the mission, m/s: standstills are searched far below it.
    turns
        True if the headings are measured, and not made from the path itself.
    """
    if len(track) < 2:
        return ()
    bins = _Bins.of(track, turns=turns)
    if len(bins.xy) <= 2 * HALF:
        return ()
    stationary = _stationary(bins, speed=speed) & ~bins.blind
    found = [_refined_span(track, bins, *span) for span in _spans(stationary)]
    merged = _merged([span for span in found if span is not None], bins)
    merged = _joined_over_jumps(merged, track, bins, speed=speed)
    standstills = (_standstill(track, bins, *span) for span in merged)
    return tuple(standstill for standstill in standstills if standstill.seconds >= LEAST_S)


@dataclass(frozen=True, eq=False)
class _Bins:
    """Poses averaged over time bins of one length."""

    begin_ns: int
    step_ns: int
    xy: FloatArray
    """(n, 2)."""
    heading: FloatArray
    """Headings without jumps of 360 degrees between neighbours (n,)."""
    noise: FloatArray
    """Standard deviation of a bin's x, y (metres) and heading (radians), (3,)."""
    blind: BoolArray
    """True where the robot moved or turned in a gap without poses (n,)."""
    turns: bool
    """True if headings are used."""

    @property
    def poses(self) -> FloatArray:
        """Poses as x, y, heading (n, 3)."""
        return np.column_stack([self.xy, self.heading])

    @property
    def reach(self) -> FloatArray:
        """Greatest apparent distance of a stationary robot from its pose, in x, y and heading (3,)."""
        turn = EDGE_RAD if self.turns else np.inf
        return np.array([EDGE_M, EDGE_M, turn]) + SIGMAS * self.noise

    @classmethod
    def of(cls, track: Track, *, turns: bool) -> _Bins:
        span = int(track.ns[-1] - track.ns[0])
        step = max(round(BIN_S * 1e9), span // LARGEST_BINS)
        index = ((track.ns - track.ns[0]) // step).astype(np.int64)
        count = int(index[-1]) + 1
        table = np.column_stack([track.xy, np.unwrap(track.heading)])
        many = np.bincount(index, minlength=count)
        sums = np.stack([np.bincount(index, column, minlength=count) for column in table.T], axis=-1)
        occupied = np.flatnonzero(many)
        means = sums[occupied] / many[occupied, None]
        every = np.arange(count)
        filled = _without_spikes(
            np.stack([np.interp(every, occupied, column) for column in means.T], axis=-1)
        )
        noise = _noise(means, occupied)
        turn = EDGE_RAD + SIGMAS * float(noise[2]) if turns else np.inf
        reach = np.array([BLIND_M + SIGMAS * float(noise[:2].max()), turn])
        blind = _blind(occupied, means, step / 1e9, reach)
        return cls(int(track.ns[0]), step, filled[:, :2], filled[:, 2], noise, blind, turns)

    def index(self, ns: int) -> int:
        return min(max((ns - self.begin_ns) // self.step_ns, 0), len(self.xy) - 1)

    def ns(self, index: int) -> int:
        """Return the begin of a bin."""
        return self.begin_ns + index * self.step_ns


def _without_spikes(values: FloatArray) -> FloatArray:
    """Return each column's (n, k) medians of three: a single wrong pose interrupts no standstill."""
    medians = values.copy()
    if len(values) > 2:
        medians[1:-1] = np.median(np.stack([values[:-2], values[1:-1], values[2:]]), axis=0)
    return medians


def _blind(occupied: IntArray, poses: FloatArray, step_s: float, reach: FloatArray) -> BoolArray:
    """Return the bins in gaps without poses across which the robot moved, or turned: poses (n, 3)."""
    blind = np.zeros(int(occupied[-1]) + 1, bool)
    step = np.diff(poses, axis=0)
    moved = (np.hypot(*step[:, :2].T) > reach[0]) | (np.abs(step[:, 2]) > reach[1])
    for k in np.flatnonzero(moved & (np.diff(occupied) * step_s > BLIND_S)):
        blind[occupied[k] + 1 : occupied[k + 1]] = True
    return blind


def _noise(values: FloatArray, occupied: IntArray) -> FloatArray:
    """Return the standard deviation of each column (n, 3), from the median of second differences.

    Of poses farther apart than DENSE_S, a difference is the robot's manoeuvre, and shows nothing of noise.
    """
    dense = occupied[2:] - occupied[:-2] <= 2 * DENSE_S / BIN_S
    if dense.sum() < 3:
        return np.zeros(3)
    second = np.abs(values[2:] - 2 * values[1:-1] + values[:-2])[dense]
    return np.asarray(1.4826 * np.median(second, axis=0) / np.sqrt(6.0))


def _stationary(bins: _Bins, *, speed: float) -> BoolArray:
    """True where the robot is stationary, per bin (n,): the means before and after hardly differ."""
    apart_s = (HALF + 1) * bins.step_ns / 1e9
    noise = bins.noise * np.sqrt(2.0 / HALF) / apart_s
    limit = max(STILL_M_S, min(SIGMAS * float(noise[:2].max()), FASTEST_STILL * speed))
    moving = np.hypot(*_change(bins.xy).T) / apart_s
    stationary: BoolArray = moving < limit
    if bins.turns:
        stationary &= np.abs(_change(bins.heading[:, None])[:, 0]) / apart_s < max(
            STILL_RAD_S, SIGMAS * noise[2]
        )
    return stationary


def _change(values: FloatArray) -> FloatArray:
    """Return the mean of the HALF values after each minus that of the HALF before (n, k)."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    count = len(values)
    before = (sums[HALF : count - HALF] - sums[: count - 2 * HALF]) / HALF
    after = (sums[2 * HALF + 1 : count + 1] - sums[HALF + 1 : count - HALF + 1]) / HALF
    return np.pad(after - before, ((HALF, HALF), (0, 0)), mode="edge")


def _spans(stationary: BoolArray) -> list[tuple[int, int]]:
    """Return the first and last bin of each run of true values."""
    padded = np.concatenate([[False], stationary, [False]]).astype(np.int8)
    first, behind = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
    return list(zip(first.tolist(), (behind - 1).tolist(), strict=True))


def _refined_span(track: Track, bins: _Bins, first: int, last: int) -> tuple[int, int] | None:
    """Return the begin and end of a standstill: while the robot keeps the pose of its middle."""
    quarter, middle = (last - first) // 4, (first + last) // 2
    pose = np.median(bins.poses[first + quarter : last - quarter + 1], axis=0)
    near = _near(bins.poses, pose, bins.reach)
    if not near[middle]:
        return None
    low, high = max(0, first - 2 * HALF), min(len(near) - 1, last + 2 * HALF)
    away_before, away_after = np.flatnonzero(~near[low:middle]), np.flatnonzero(~near[middle : high + 1])
    begin = low + int(away_before[-1]) + 1 if len(away_before) else first
    end = middle + int(away_after[0]) - 1 if len(away_after) else last
    return _exact(track, bins, pose, begin, end)


def _exact(track: Track, bins: _Bins, pose: FloatArray, begin: int, end: int) -> tuple[int, int]:
    """Return the same, to one pose: without noise, a bin is too coarse."""
    around = track.between(bins.ns(begin) - bins.step_ns, bins.ns(end + 1) + bins.step_ns)
    poses = np.column_stack([around.xy, np.unwrap(around.heading)]) if len(around) else np.empty((0, 3))
    poses[:, 2] += (
        2 * np.pi * np.round((pose[2] - np.median(poses[:, 2])) / (2 * np.pi)) if len(poses) else 0.0
    )
    inside = np.flatnonzero(_near(poses, pose, bins.reach * (1.0 + (bins.noise > 1e-6))))
    if not len(inside):
        return bins.ns(begin), bins.ns(end + 1)
    return int(around.ns[inside[0]]), int(around.ns[inside[-1]])


def _near(poses: FloatArray, pose: FloatArray, reach: FloatArray) -> BoolArray:
    """True for poses (n, 3) that equal another pose within `reach`."""
    away = np.hypot(*(poses[:, :2] - pose[:2]).T)
    near: BoolArray = (away <= reach[:2].max()) & (np.abs(poses[:, 2] - pose[2]) <= reach[2])
    return near


def _merged(spans: list[tuple[int, int]], bins: _Bins) -> list[tuple[int, int]]:
    """Join standstills that are separated only by a position correction or a short twitch."""
    merged: list[tuple[int, int]] = []
    for begin, end in spans:
        if merged and (begin - merged[-1][1]) / 1e9 <= JOIN_S:
            here, there = _middle(bins, begin, end), _middle(bins, *merged[-1])
            if math.dist(here, there) <= JOIN_M:
                merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
                continue
        merged.append((begin, end))
    return merged


def _joined_over_jumps(
    spans: list[tuple[int, int]], track: Track, bins: _Bins, *, speed: float
) -> list[tuple[int, int]]:
    """Join standstills at one position between which the poses jump away and back, as no robot moves."""
    joined: list[tuple[int, int]] = []
    for begin, end in spans:
        for k in range(len(joined) - 1, -1, -1):
            since, until = joined[k]
            if begin - until > JUMPED_NS:
                break
            near = math.dist(_middle(bins, begin, end), _middle(bins, since, until)) <= float(bins.reach[0])
            if near and _jumps_between(track, until, begin, speed=speed):
                joined[k:] = [(since, max(end, until))]
                break
        else:
            joined.append((begin, end))
            continue
        if joined[-1][1] < end:
            joined.append((begin, end))
    return joined


def _jumps_between(track: Track, begin_ns: int, end_ns: int, *, speed: float) -> bool:
    """True if the poses between two times begin and end with a step much faster than the robot drives."""
    around = track.between(begin_ns - JUMP_EDGE_NS, end_ns + JUMP_EDGE_NS)
    if len(around) < 3:
        return False
    step = np.hypot(*np.diff(around.xy, axis=0).T)
    moving = np.flatnonzero(step > JUMP_M)
    fast = step > np.maximum(JUMP_M, JUMP_SPEEDS * speed * np.diff(around.ns) / 1e9)
    return len(moving) >= 2 and bool(fast[moving[0]] and fast[moving[-1]])


def _middle(bins: _Bins, begin_ns: int, end_ns: int) -> FloatArray:
    return np.asarray(np.median(bins.xy[bins.index(begin_ns) : bins.index(end_ns) + 1], axis=0))


def _standstill(track: Track, bins: _Bins, begin_ns: int, end_ns: int) -> Standstill:
    poses = track.between(begin_ns, end_ns)
    x, y = (
        (float(value) for value in np.median(poses.xy, axis=0))
        if len(poses)
        else bins.xy[bins.index(begin_ns)]
    )
    turn = np.unwrap(poses.heading)
    heading = float(np.remainder(np.median(turn) + np.pi, 2 * np.pi) - np.pi) if len(poses) else 0.0
    first, last = bins.index(begin_ns) + 1, bins.index(end_ns)
    return Standstill(
        begin_ns, end_ns, float(x), float(y), heading, _moved(bins.xy[first:last], np.array([x, y]))
    )


def _moved(xy: FloatArray, position: FloatArray) -> float:
    """Return the greatest distance of a one-second mean from the position."""
    over = round(1 / BIN_S)
    if len(xy) < over:
        return 0.0
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(xy - position, axis=0)])
    return float(np.hypot(*((sums[over:] - sums[:-over]) / over).T).max())
