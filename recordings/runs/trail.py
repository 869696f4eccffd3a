"""What of a robot's poses is worth drawing: those that differ, and the path through them."""

from __future__ import annotations

import math

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.run.run_log import Track

SAME_M, SAME_RAD, SAME_S = 0.001, math.radians(0.1), 1.0
"""A pose this near to the last one is left out, but for one each second."""
PIECE_M = 0.05
"""The driven path goes from pose to pose at least this far apart."""
STRIP_S = 1.0
"""For how long one strip of the path goes on."""
SILENT_S = 10.0
"""After a silence as long as this nobody knows the way the robot took, and none is drawn."""


class Thinner:
    """Leaves out poses that are as the one before, over any number of tracks."""

    def __init__(self) -> None:
        self._last: tuple[int, float, float, float] | None = None

    def thin(self, track: Track) -> Track:
        """The poses that differ from the last one that was kept."""
        kept = []
        last = self._last
        rows = zip(track.ns.tolist(), *track.xy.T.tolist(), track.heading.tolist(), strict=True)
        for index, pose in enumerate(rows):
            if last is None or not _same(last, pose):
                kept.append(index)
                last = pose
        self._last = last
        return Track(frozen(track.ns[kept], np.int64), frozen(track.xy[kept]), frozen(track.heading[kept]))


def _same(a: tuple[int, float, float, float], b: tuple[int, float, float, float]) -> bool:
    return (
        b[0] - a[0] < SAME_S * 1e9
        and math.hypot(b[1] - a[1], b[2] - a[2]) < SAME_M
        and abs(math.remainder(b[3] - a[3], math.tau)) < SAME_RAD
    )


class Trail:
    """The path that a robot has driven, strip by strip, each a second long or as long as a track."""

    def __init__(self) -> None:
        self._end: tuple[float, float] | None = None
        """Where the path was drawn to."""
        self._heard_ns = 0

    def end(self) -> None:
        """Begin anew with the next pose: nobody knows the way to it."""
        self._end = None

    def lengthened(self, track: Track) -> tuple[IntArray, list[FloatArray]]:
        """The strips that these poses add, and when each ends."""
        times: list[int] = []
        strips: list[list[tuple[float, float]]] = []
        begun_ns = None
        for ns, x, y in zip(track.ns.tolist(), *track.xy.T.tolist(), strict=True):
            if self._end is None or ns - self._heard_ns > SILENT_S * 1e9:
                self._end, begun_ns = (x, y), None
            self._heard_ns = ns
            if math.hypot(x - self._end[0], y - self._end[1]) < PIECE_M:
                continue
            if begun_ns is None or ns - begun_ns > STRIP_S * 1e9:
                begun_ns = ns
                strips.append([self._end])
                times.append(ns)
            self._end = (x, y)
            strips[-1].append(self._end)
            times[-1] = ns
        return frozen(times, np.int64), [np.array(strip) for strip in strips]
