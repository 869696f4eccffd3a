"""Poses and path of a robot that are worth drawing: poses that differ, and the path through them."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.run.pose_gaps import KEPT_S, gap_limit_ns
from stopgo.mission.run.run_log import Track

SAME_M, SAME_RAD = 0.001, math.radians(0.1)
"""Limits below which a pose counts as equal to the last one and is left out, except one each `KEPT_S`."""
POINT_DISTANCE_M = 0.05
"""Smallest distance between two points of the driven path."""
STRIP_S = 1.0
"""Duration of one strip of the path."""
MOST_STEPS = 1000
"""Number of last steps that show the robot's usual one."""


TimedPose = tuple[int, float, float, float]
"""Time in nanoseconds, x, y and heading."""


class Thinner:
    """Leaves out poses that equal the one before, over any number of tracks.

    Where all steps of a robot are shorter than `KEPT_S`, those of the kept poses are, too; a longer one keeps
    both its ends. So the kept poses have the gaps of all poses.
    """

    def __init__(self) -> None:
        self._kept: TimedPose | None = None
        self._held: TimedPose | None = None
        """Newest pose, if it is left out so far."""

    def thin(self, track: Track) -> Track:
        """Return the poses to keep, the held one of the track before among them."""
        kept: list[TimedPose] = []
        for pose in zip(track.ns.tolist(), *track.xy.T.tolist(), track.heading.tolist(), strict=True):
            if self._held is not None and self._is_late(pose):
                kept.append(self._keep(self._held))
            if self._kept is None or self._is_late(pose) or not _same(self._kept, pose):
                kept.append(self._keep(pose))
            else:
                self._held = pose
        return _track(kept)

    def held(self) -> Track:
        """Return the newest pose if it was left out, else none; from then on it is kept."""
        return _track([] if self._held is None else [self._keep(self._held)])

    def _keep(self, pose: TimedPose) -> TimedPose:
        self._kept, self._held = pose, None
        return pose

    def _is_late(self, pose: TimedPose) -> bool:
        """True if a pose is too long after the last kept one, or the clock went back."""
        assert self._kept is not None
        return not 0 <= pose[0] - self._kept[0] <= KEPT_S * 1e9


def _same(a: TimedPose, b: TimedPose) -> bool:
    return (
        math.hypot(b[1] - a[1], b[2] - a[2]) < SAME_M
        and abs(math.remainder(b[3] - a[3], math.tau)) < SAME_RAD
    )


def _track(poses: list[TimedPose]) -> Track:
    ns = frozen([pose[0] for pose in poses], np.int64)
    xy = np.array([pose[1:3] for pose in poses], dtype=np.float64).reshape(-1, 2)
    return Track(ns, frozen(xy), frozen([pose[3] for pose in poses]))


@dataclass(frozen=True, eq=False)
class TrailGap:
    """A part of the path that no pose shows."""

    begin_ns: int
    end_ns: int
    ends: FloatArray
    """Last position before, and first after it (2, 2)."""

    @property
    def seconds(self) -> float:
        """Duration; negative or 0 if the robot's clock went back in it."""
        return (self.end_ns - self.begin_ns) / 1e9


class Trail:
    """Path that a robot has driven, in strips of a second or of one track."""

    def __init__(self) -> None:
        self._end: tuple[float, float] | None = None
        """End of the path drawn so far."""
        self._last_ns = 0
        self._steps_ns: deque[int] = deque(maxlen=MOST_STEPS)
        self._before_gap: tuple[float, float] | None = None
        self.unseen: list[TrailGap] = []
        """Gaps since this list was last emptied."""

    def end(self) -> None:
        """Begin again with the next pose: the path to it is unknown."""
        self._before_gap, self._end = self._end or self._before_gap, None

    def extended(self, track: Track) -> tuple[IntArray, list[FloatArray]]:
        """Return the strips that these poses add, and the end time of each; add to `unseen`."""
        times: list[int] = []
        strips: list[list[tuple[float, float]]] = []
        strip_begin_ns = None
        for ns, x, y in zip(track.ns.tolist(), *track.xy.T.tolist(), strict=True):
            if self._end is None or self._misses(ns):
                self.end()
                self._end, strip_begin_ns = self._begin_again(ns, (x, y)), None
            elif ns > self._last_ns:
                self._steps_ns.append(ns - self._last_ns)
            self._last_ns = ns
            if math.hypot(x - self._end[0], y - self._end[1]) < POINT_DISTANCE_M:
                continue
            if strip_begin_ns is None or ns - strip_begin_ns > STRIP_S * 1e9:
                strip_begin_ns = ns
                strips.append([self._end])
                times.append(ns)
            self._end = (x, y)
            strips[-1].append(self._end)
            times[-1] = ns
        return frozen(times, np.int64), [np.array(strip) for strip in strips]

    def _misses(self, ns: int) -> bool:
        step = ns - self._last_ns
        return step > gap_limit_ns(()) and step > gap_limit_ns(self._steps_ns)

    def _begin_again(self, ns: int, position: tuple[float, float]) -> tuple[float, float]:
        """Note the gap before a position, if there is one, and return the position."""
        if self._before_gap is not None:
            gap = TrailGap(self._last_ns, ns, np.array([self._before_gap, position]))
            self.unseen.append(gap)
            self._before_gap = None
            if gap.seconds > 0:
                self._steps_ns.append(ns - self._last_ns)
        return position
