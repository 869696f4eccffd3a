"""Where and when a robot stood still, from its poses alone, noisy as they may be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.run.run_log import Track

BIN_S = 0.2
"""Poses are averaged over as long as this first: logs have from one to hundreds a second."""
HALF = 4
"""Bins on each side whose means are compared to tell whether the robot moves."""
STILL_M_S, STILL_RAD_S = 0.04, 0.06
"""Slower than this a robot stands, as far as poses without noise can tell."""
SIGMAS = 4.0
"""Speeds that noise alone brings about are below this many of its standard deviations."""
FASTEST_STILL = 0.4
"""Of the mission's speed: with more noise than that allows nothing can be told."""
LEAST_S = 2.0
"""A shorter halt is none."""
JOIN_S, JOIN_M = 0.7, 0.3
"""Two halts so near to each other in time and place are one: the robot's position was corrected meanwhile."""
EDGE_M, EDGE_RAD = 0.015, 0.03
"""A robot that is farther than this, and noise, from where it stands has left, or has not yet come."""
BLIND_S, BLIND_M = 3.0, 0.15
"""A robot that is as far from where it was before a silence as long as this has driven meanwhile."""
LARGEST_BINS = 5_000_000


@dataclass(frozen=True)
class Standing:
    """One halt."""

    begin_ns: int
    end_ns: int
    x: float
    y: float
    heading: float
    """The middle one of all poses, each coordinate by itself."""
    moved_m: float
    """How far the robot's position, averaged over a second, went from there while it stood."""

    @property
    def seconds(self) -> float:
        return (self.end_ns - self.begin_ns) / 1e9

    @property
    def xy(self) -> tuple[float, float]:
        return (self.x, self.y)


def standings(track: Track, *, speed: float = 0.5, turns: bool = True) -> tuple[Standing, ...]:
    """All halts in order of time.

    A robot halts while neither its place nor, if `turns`, its heading changes faster than noise explains.
    The noise is measured from the poses themselves, by second differences, which a steady drive does not
    change. While no poses come, a robot that is where it was has stood, and one that is elsewhere has driven.

    Parameters
    ----------
    speed
        Of the mission, m/s: halts are looked for far below it.
    turns
        Whether the headings are measured, and not made from the way itself.
    """
    if len(track) < 2:
        return ()
    bins = _Bins.of(track, turns=turns)
    if len(bins.xy) <= 2 * HALF:
        return ()
    still = _still(bins, speed=speed) & ~bins.blind
    found = [_edged(track, bins, *span) for span in _spans(still)]
    joined = _joined([span for span in found if span is not None], bins)
    halts = (_standing(track, bins, *span) for span in joined)
    return tuple(halt for halt in halts if halt.seconds >= LEAST_S)


@dataclass(frozen=True, eq=False)
class _Bins:
    """Poses averaged over pieces of time of the same length."""

    begin_ns: int
    step_ns: int
    xy: FloatArray
    """(n, 2)."""
    heading: FloatArray
    """Without turns of 360 degrees between neighbours (n,)."""
    noise: FloatArray
    """Standard deviation of a bin's x, y (metres) and heading (radians), (3,)."""
    blind: BoolArray
    """Whether the robot moved there while no poses came (n,)."""
    turns: bool
    """Whether its headings count."""

    @property
    def poses(self) -> FloatArray:
        """x, y, heading (n, 3)."""
        return np.column_stack([self.xy, self.heading])

    @property
    def reach(self) -> FloatArray:
        """How far from where it stands the robot may seem to be, in x, y and heading (3,)."""
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
        held = np.flatnonzero(many)
        means = sums[held] / many[held, None]
        every = np.arange(count)
        filled = np.stack([np.interp(every, held, column) for column in means.T], axis=-1)
        noise = _noise(means)
        blind = _blind(held, means[:, :2], step / 1e9, BLIND_M + SIGMAS * float(noise[:2].max()))
        return cls(int(track.ns[0]), step, filled[:, :2], filled[:, 2], noise, blind, turns)

    def index(self, ns: int) -> int:
        return min(max((ns - self.begin_ns) // self.step_ns, 0), len(self.xy) - 1)

    def ns(self, index: int) -> int:
        """When a bin begins."""
        return self.begin_ns + index * self.step_ns


def _blind(held: IntArray, xy: FloatArray, step_s: float, reach: float) -> BoolArray:
    """Bins without poses for a while, at whose end the robot was elsewhere than at their beginning."""
    blind = np.zeros(int(held[-1]) + 1, bool)
    moved = np.hypot(*np.diff(xy, axis=0).T) > reach
    for k in np.flatnonzero(moved & (np.diff(held) * step_s > BLIND_S)):
        blind[held[k] + 1 : held[k + 1]] = True
    return blind


def _noise(values: FloatArray) -> FloatArray:
    """Standard deviation of each column (n, 3), by the median of second differences."""
    if len(values) < 5:
        return np.zeros(3)
    second = np.abs(values[2:] - 2 * values[1:-1] + values[:-2])
    return np.asarray(1.4826 * np.median(second, axis=0) / np.sqrt(6.0))


def _still(bins: _Bins, *, speed: float) -> BoolArray:
    """Whether the robot stands in each bin (n,): means of the bins before and after hardly differ."""
    apart_s = (HALF + 1) * bins.step_ns / 1e9
    noise = bins.noise * np.sqrt(2.0 / HALF) / apart_s
    limit = max(STILL_M_S, min(SIGMAS * float(noise[:2].max()), FASTEST_STILL * speed))
    moving = np.hypot(*_change(bins.xy).T) / apart_s
    still: BoolArray = moving < limit
    if bins.turns:
        still &= np.abs(_change(bins.heading[:, None])[:, 0]) / apart_s < max(STILL_RAD_S, SIGMAS * noise[2])
    return still


def _change(values: FloatArray) -> FloatArray:
    """The mean of the HALF values after each minus that of the HALF before (n, k); at the ends as beside."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    count = len(values)
    before = (sums[HALF : count - HALF] - sums[: count - 2 * HALF]) / HALF
    after = (sums[2 * HALF + 1 : count + 1] - sums[HALF + 1 : count - HALF + 1]) / HALF
    return np.pad(after - before, ((HALF, HALF), (0, 0)), mode="edge")


def _spans(still: BoolArray) -> list[tuple[int, int]]:
    """First and last bin of each run of true ones."""
    padded = np.concatenate([[False], still, [False]]).astype(np.int8)
    first, behind = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
    return list(zip(first.tolist(), (behind - 1).tolist(), strict=True))


def _edged(track: Track, bins: _Bins, first: int, last: int) -> tuple[int, int] | None:
    """When the halt began and ended: as long as the robot stays as it stood in the middle of it."""
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
    """The same to a pose: without noise a bin is coarse."""
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
    """Whether poses (n, 3) are where another is, and turned as it is."""
    away = np.hypot(*(poses[:, :2] - pose[:2]).T)
    near: BoolArray = (away <= reach[:2].max()) & (np.abs(poses[:, 2] - pose[2]) <= reach[2])
    return near


def _joined(spans: list[tuple[int, int]], bins: _Bins) -> list[tuple[int, int]]:
    """Halts that only a correction of the robot's position, or a short twitch, has parted."""
    joined: list[tuple[int, int]] = []
    for begin, end in spans:
        if joined and (begin - joined[-1][1]) / 1e9 <= JOIN_S:
            here, there = _middle(bins, begin, end), _middle(bins, *joined[-1])
            if math.dist(here, there) <= JOIN_M:
                joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
                continue
        joined.append((begin, end))
    return joined


def _middle(bins: _Bins, begin_ns: int, end_ns: int) -> FloatArray:
    return np.asarray(np.median(bins.xy[bins.index(begin_ns) : bins.index(end_ns) + 1], axis=0))


def _standing(track: Track, bins: _Bins, begin_ns: int, end_ns: int) -> Standing:
    poses = track.between(begin_ns, end_ns)
    x, y = (
        (float(value) for value in np.median(poses.xy, axis=0))
        if len(poses)
        else bins.xy[bins.index(begin_ns)]
    )
    turn = np.unwrap(poses.heading)
    heading = float(np.remainder(np.median(turn) + np.pi, 2 * np.pi) - np.pi) if len(poses) else 0.0
    first, last = bins.index(begin_ns) + 1, bins.index(end_ns)
    return Standing(
        begin_ns, end_ns, float(x), float(y), heading, _moved(bins.xy[first:last], np.array([x, y]))
    )


def _moved(xy: FloatArray, place: FloatArray) -> float:
    """Greatest distance of a second's mean from the place."""
    over = round(1 / BIN_S)
    if len(xy) < over:
        return 0.0
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(xy - place, axis=0)])
    return float(np.hypot(*((sums[over:] - sums[:-over]) / over).T).max())
