"""Limits on views: the visible units that are not too flat, not too near and not too sparsely scanned.

From one position, the points of a line that are not too flat form one stretch around the foot of the
perpendicular. The same holds for points that are not too sparse, and for points that are too near. So of a
run of visible units one stretch remains, with at most one hole. `clipped` computes it in closed form;
`well_seen` tests single midpoints. Both decide exactly, with the limits' floating-point values as exact
numbers. A midpoint exactly at a limit is seen.

Coordinates are whole grid steps from the position, within 2**30, and units are at least 1 mm long, as in
`stopgo.planner.visibility.sight.sightlines`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from stopgo.mission.document.limits import ViewLimits
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.geometry.shapes import GRID

CLOSE = 1e-9
"""Relative difference below which numbers are compared exactly."""


@dataclass(frozen=True, eq=False)
class SeenSegments:
    """Segments relative to positions that see them, each in a number of equal units."""

    a: IntArray
    """Start of each segment, relative to the position (n, 2)."""
    b: IntArray
    units: IntArray
    """(n,)."""

    def among(self, chosen: IntArray) -> SeenSegments:
        """Some of the segments."""
        return SeenSegments(self.a[chosen], self.b[chosen], self.units[chosen])


def well_seen(stretches: SeenSegments, unit: IntArray, limits: ViewLimits) -> BoolArray:
    """True where the midpoint of a unit (n,) of each segment is within the limits."""
    return _square_on(stretches, unit, limits) & ~_too_near(stretches, unit, limits)


def clipped(
    stretches: SeenSegments, low: IntArray, high: IntArray, limits: ViewLimits
) -> tuple[IntArray, IntArray, IntArray]:
    """The part within the limits of the runs of units low..high (n,): run, first and last unit."""
    middle, half = _round_the_foot(stretches, limits)
    nearest = np.clip(np.rint(middle), low, high).astype(np.int64)
    nearest = _first_that(
        lambda unit: _square_on(stretches, unit, limits),
        nearest, np.maximum(nearest - 1, low), np.minimum(nearest + 1, high),
    )  # fmt: skip
    some = np.flatnonzero(_square_on(stretches, nearest, limits))
    seen = stretches.among(some)
    first, last = (
        _end_of(lambda unit: _square_on(seen, unit, limits), nearest[some], limit[some], guess[some])
        for limit, guess in ((low, middle - half), (high, middle + half))
    )
    return _without_near(seen, some, first, last, limits)


def _first_that(test: Callable[[IntArray], BoolArray], *guesses: IntArray) -> IntArray:
    """The first guess that passes, else the last one (n,)."""
    found = guesses[-1].copy()
    for guess in guesses[-2::-1]:
        found = np.where(test(guess), guess, found)
    return found


def _end_of(
    test: Callable[[IntArray], BoolArray], inner: IntArray, outer: IntArray, guess: FloatArray
) -> IntArray:
    """The unit farthest from `inner` towards `outer` up to which all units pass; `inner` does (n,)."""
    step = np.sign(outer - inner)
    at = np.clip(np.where(step > 0, np.floor(guess), np.ceil(guess)), *np.sort([inner, outer], axis=0))
    at = at.astype(np.int64)
    while (wrong := (at != inner) & ~test(at)).any():
        at[wrong] -= step[wrong]
    while (more := (at != outer) & test(np.where(at == outer, at, at + step))).any():
        at[more] += step[more]
    return at


def _without_near(
    stretches: SeenSegments, run: IntArray, low: IntArray, high: IntArray, limits: ViewLimits
) -> tuple[IntArray, IntArray, IntArray]:
    """The runs low..high without the units that are too near."""
    middle = _foot(stretches)
    nearest = np.clip(np.rint(middle), low, high).astype(np.int64)

    def near(unit: IntArray) -> BoolArray:
        return _too_near(stretches, unit, limits)

    nearest = _first_that(near, nearest, np.maximum(nearest - 1, low), np.minimum(nearest + 1, high))
    hole = near(nearest)
    half = _units_within(stretches, (limits.near / GRID) ** 2)
    begin, end = high + 1, high.copy()
    some = np.flatnonzero(hole)
    within = stretches.among(some)
    for limit, ends, sign in ((low, begin, -1), (high, end, 1)):
        guess = (middle + sign * half)[some]
        ends[some] = _end_of(lambda u: _too_near(within, u, limits), nearest[some], limit[some], guess)
    runs = np.concatenate([run, run])
    first, last = np.concatenate([low, end + 1]), np.concatenate([begin - 1, np.where(hole, high, end)])
    order = np.lexsort((first, runs))
    order = order[first[order] <= last[order]]
    return runs[order], first[order], last[order]


def _foot(stretches: SeenSegments) -> FloatArray:
    """Foot of the perpendicular from the position, counted in units from the first unit's midpoint."""
    a, along = stretches.a.astype(float), (stretches.b - stretches.a).astype(float)
    return -(a * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1.0) * stretches.units - 0.5


def _units_within(stretches: SeenSegments, squared_reach: FloatArray | float) -> FloatArray:
    """Units on either side of the foot that are within reach; negative where none is."""
    length, away = _length_and_distance(stretches)
    square = squared_reach - away**2
    return np.where(square < 0, -1.0, np.sqrt(np.maximum(square, 0.0)) / length * stretches.units)


def _length_and_distance(stretches: SeenSegments) -> tuple[FloatArray, FloatArray]:
    """Length of each segment, and the distance of the position from its line, in grid steps."""
    length = np.maximum(np.hypot(*(stretches.b - stretches.a).astype(float).T), 1e-9)
    return length, np.abs(_area(stretches).astype(float)) / length


def _area(stretches: SeenSegments) -> IntArray:
    (ax, ay), (bx, by) = stretches.a.T, stretches.b.T
    return np.asarray(ax * by - ay * bx, dtype=np.int64)


def _round_the_foot(stretches: SeenSegments, limits: ViewLimits) -> tuple[FloatArray, FloatArray]:
    """The foot, and the number of units on either side of it that are neither too flat nor too sparse."""
    length, away = _length_and_distance(stretches)
    rise = limits.rise / GRID
    half = np.full(len(length), np.inf)
    if limits.max_incidence is not None:
        half = _units_within(stretches, (away / math.cos(limits.max_incidence)) ** 2 - rise**2)
    if limits.farthest_per_height is not None:
        half = np.minimum(half, _units_within(stretches, limits.farthest_per_height / GRID * away - rise**2))
    return _foot(stretches), np.minimum(half, 1e15)


@dataclass(frozen=True)
class _Measures:
    """Measures of midpoints: exact whole numbers, or arrays of approximate floating-point numbers."""

    area: Any
    """Twice the area of the triangle of the position and the segment."""
    along: Any
    """The segment's length, squared."""
    squared: Any
    """The distance of the midpoint times `pieces`, squared."""
    slant: Any
    """The same for the farthest point straight above or below it."""
    pieces: Any


def _square_on(stretches: SeenSegments, unit: IntArray, limits: ViewLimits) -> BoolArray:
    """True for units that are neither too flat nor too sparse."""
    found, rise = np.ones(len(unit), dtype=bool), round(limits.rise / GRID)
    if limits.max_incidence is not None:
        found &= _at_most(stretches, unit, _incidence, math.cos(limits.max_incidence), rise)
    if limits.farthest_per_height is not None:
        found &= _at_most(stretches, unit, _spacing, limits.farthest_per_height / GRID, rise)
    return found


def _too_near(stretches: SeenSegments, unit: IntArray, limits: ViewLimits) -> BoolArray:
    return ~_at_most(stretches, unit, _blind, float(round(limits.near / GRID)))


def _incidence(m: _Measures, cosine: Any) -> tuple[Any, Any]:
    """cos i = h / d at least: cos² d² <= h², h being area / length, and d the slant distance."""
    return cosine**2 * m.along * m.slant, m.area**2 * m.pieces**2


def _spacing(m: _Measures, most: Any) -> tuple[Any, Any]:
    """d² <= k h, squared."""
    return m.slant**2 * m.along, most**2 * m.area**2 * m.pieces**4


def _blind(m: _Measures, near: Any) -> tuple[Any, Any]:
    return near**2 * m.pieces**2, m.squared


def _at_most(
    stretches: SeenSegments,
    unit: IntArray,
    sides: Callable[[_Measures, Any], tuple[Any, Any]],
    limit: float,
    rise: int = 0,
) -> BoolArray:
    """True where the left side is at most the right one, for each midpoint; exact where they are close."""
    odd, pieces = 2 * unit + 1, 2 * stretches.units
    offset = (pieces - odd)[:, None] * stretches.a + odd[:, None] * stretches.b
    area, along = _area(stretches), stretches.b - stretches.a
    squared = (offset.astype(float) ** 2).sum(axis=1)
    rough = _Measures(
        area.astype(float),
        (along.astype(float) ** 2).sum(axis=1),
        squared,
        squared + (float(rise) * pieces) ** 2,
        pieces.astype(float),
    )
    left, right = sides(rough, limit)
    found: BoolArray = left < right
    for k in np.flatnonzero(np.abs(left - right) <= CLOSE * right):
        (x, y), (dx, dy), p = offset[k].tolist(), along[k].tolist(), int(pieces[k])
        slant = x * x + y * y + (rise * p) ** 2
        exact = _Measures(int(area[k]), dx * dx + dy * dy, x * x + y * y, slant, p)
        least, most = sides(exact, Fraction(limit))
        found[k] = least <= most
    return found
