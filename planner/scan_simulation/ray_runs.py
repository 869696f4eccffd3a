"""Scanner + solids -> runs of rays that surely meet the same surface; one ray of each is cast.

In a column of rays the surface changes only where the column crosses an edge, or a level surface that meets
an upright one. Rays within MARGIN of such a place, and where two surfaces lie at the same distance, are cast
one by one: there single precision decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray

MARGIN = 2e-4
"""Angle in radians by which single precision may displace an edge: of triangles up to 400 m away, twice."""
SAME_M = 1e-3
"""Surfaces at distances that differ less than this may be met in either order."""


@dataclass(frozen=True, eq=False)
class SurfaceLines:
    """Faces and edges around a scanner at 0, each from `a` to `b` in the plan; edges are as high as low."""

    a: FloatArray
    """(m, 2)."""
    b: FloatArray
    low: FloatArray
    """(m,)."""
    high: FloatArray
    levels: FloatArray
    """All heights of level surfaces, ascending (l,)."""

    def run_starts(self, azimuth: FloatArray, elevation: FloatArray, step: float) -> IntArray:
        """First rays of the runs of a block, numbered column by column, ascending.

        Columns at ascending `azimuth`, and rows at `elevation` (radians), are a `step` apart.
        """
        crossings = _Crossings(self, azimuth, step)
        starts = np.zeros((len(azimuth), len(elevation) + 1), dtype=bool)
        starts[:, 0] = True
        for column, one, other in crossings.changes():
            low, high = (np.arctan2(end, 1.0) for end in (np.minimum(one, other), np.maximum(one, other)))
            first = np.ceil((low - MARGIN - elevation[0]) / step)
            last = np.floor((high + MARGIN - elevation[0]) / step) + 1
            first, last = (np.clip(row, 0, len(elevation)).astype(np.int64) for row in (first, last))
            of, row = ranges(first, last + 1)
            starts[column[of], row] = True
        return np.flatnonzero(starts[:, :-1])


class _Crossings:
    """Parts of lines within MARGIN of a column's vertical plane, the nearest of each column.

    What lies behind a wall that reaches from the lowest to the highest level is left out.
    """

    def __init__(self, lines: SurfaceLines, azimuth: FloatArray, step: float) -> None:
        line, column = _lines_in_columns(lines, azimuth, step)
        ahead = np.column_stack([np.cos(azimuth), np.sin(azimuth)])[column]
        away, aside = [], []
        for end in (lines.a[line], lines.b[line]):
            away.append(end[:, 0] * ahead[:, 0] + end[:, 1] * ahead[:, 1])
            aside.append(end[:, 1] * ahead[:, 0] - end[:, 0] * ahead[:, 1])
        begin, end = _inside(
            [far * np.tan(MARGIN) + side for far, side in zip(away, aside, strict=True)],
            [far * np.tan(MARGIN) - side for far, side in zip(away, aside, strict=True)],
        )
        one, other = (np.maximum(away[0] + part * (away[1] - away[0]), 1e-9) for part in (begin, end))
        through = (begin > 0) & (end < 1) & (lines.low[line] <= lines.levels[0])
        through &= lines.high[line] >= lines.levels[-1]
        wall = np.full(len(azimuth), np.inf)
        np.minimum.at(wall, column[through], np.maximum(one, other)[through])
        kept = (begin <= end) & (np.minimum(one, other) <= wall[column] + SAME_M)
        self._lines, self._line, self._column = lines, line[kept], column[kept]
        self._begin, self._end, self._one, self._other = begin[kept], end[kept], one[kept], other[kept]

    def changes(self) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
        """Columns (n,), and tangents of two elevations between which the surface may change, in any order."""
        low, high = self._lines.low[self._line], self._lines.high[self._line]
        yield self._column, low / self._one, low / self._other
        up = np.flatnonzero(low < high)
        column, one, other, low, high = (
            item[up] for item in (self._column, self._one, self._other, low, high)
        )
        yield column, high / one, high / other
        begin, end = self._begin[up], self._end[up]
        yield column, (low + begin * (high - low)) / one, (low + end * (high - low)) / other
        for level in self._lines.levels:
            met = (low < level) & (level < high)
            yield column[met], level / one[met], level / other[met]
        bottom, top = np.minimum(low / one, low / other), np.maximum(high / one, high / other)
        side = (begin == 0) | (end == 1)
        yield column[side], bottom[side], top[side]
        yield from _alike(column, np.minimum(one, other), np.maximum(one, other), bottom, top)


def _alike(
    column: IntArray, near: FloatArray, far: FloatArray, bottom: FloatArray, top: FloatArray
) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """Columns (n,) and tangents between which two faces are at the same distance."""
    order = np.lexsort((near, column))
    column = column[order]
    near, far, bottom, top = (item[order] for item in (near, far, bottom, top))
    for lag in count(1):
        same = (column[lag:] == column[:-lag]) & (near[lag:] <= far[:-lag] + SAME_M)
        if not same.any():
            return
        low, high = np.maximum(bottom[lag:], bottom[:-lag]), np.minimum(top[lag:], top[:-lag])
        same &= low <= high
        yield column[lag:][same], low[same], high[same]


def _lines_in_columns(lines: SurfaceLines, azimuth: FloatArray, step: float) -> tuple[IntArray, IntArray]:
    """Pairs of a line and a column within MARGIN of it; a line below the scanner has all columns."""
    one, other = (np.arctan2(end[:, 1], end[:, 0]) for end in (lines.a, lines.b))
    turn = np.remainder(other - one + np.pi, 2 * np.pi) - np.pi
    begin = np.remainder(np.where(turn < 0, other, one) - MARGIN - azimuth[0], 2 * np.pi)
    end = begin + np.abs(turn) + 2 * MARGIN
    below = np.abs(turn) > np.pi - 0.1
    begin[below], end[below] = 0.0, 2 * np.pi
    pairs = []
    for back in (0.0, 2 * np.pi):
        first, last = np.ceil((begin - back) / step), np.floor((end - back) / step) + 1
        first, last = (np.clip(item, 0, len(azimuth)).astype(np.int64) for item in (first, last))
        pairs.append(ranges(first, last))
    line, column = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return line, column


def ranges(first: IntArray, last: IntArray) -> tuple[IntArray, IntArray]:
    """Every number from `first` to before `last` of each range, with the number of its range."""
    many = np.maximum(last - first, 0)
    of = np.repeat(np.arange(len(many)), many)
    return of, np.arange(len(of)) + np.repeat(first - np.cumsum(many) + many, many)


def _inside(*limits: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Fractions of lines between which values, given at both ends, are all positive; else end < begin."""
    begin, end = np.zeros(len(limits[0][0])), np.ones(len(limits[0][0]))
    for one, other in limits:
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = one / (one - other)
        begin = np.where(one < 0, np.maximum(begin, np.where(other < 0, np.inf, zero)), begin)
        end = np.where((other < 0) & (one >= 0), np.minimum(end, zero), end)
    return begin, end
