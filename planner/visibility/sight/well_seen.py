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
from collections.abc import Callable, Iterator
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
    """The part within the limits of the runs of units low..high (n,): run, first and last unit.

    Where no end of the part is near the middle of a unit, floating-point numbers decide.
    """
    pieces, clear = _by_formula(stretches, low, high, limits)
    rest = np.flatnonzero(~clear)
    run, first, last = _tested(stretches.among(rest), low[rest], high[rest], limits)
    known = [np.where(clear, [begin, end], [[1], [0]]) for begin, end in pieces]
    every = np.arange(len(low))
    return _in_order(
        np.concatenate([every, every, rest[run]]),
        np.concatenate([known[0][0], known[1][0], first]),
        np.concatenate([known[0][1], known[1][1], last]),
    )


CLEAR = 1e-6
"""Relative difference above which floating-point numbers decide: their error is a thousandth of it."""


def _by_formula(
    stretches: SeenSegments, low: IntArray, high: IntArray, limits: ViewLimits
) -> tuple[list[tuple[IntArray, IntArray]], BoolArray]:
    """First and last unit of both pieces (n,) that `clipped` leaves, empty or not; and where these are clear.

    The second piece is the one beyond the units that are too near.
    """
    length, away = _length_and_distance(stretches)
    middle, scale, clear = _foot(stretches), stretches.units / length, length > 1.0
    rise, near = round(limits.rise / GRID), float(round(limits.near / GRID))

    def ends_of(squared_reach: Any) -> tuple[IntArray, IntArray]:
        """The units low..high whose midpoints are within reach; what is not clear is noted."""
        nonlocal clear
        square = squared_reach - away**2
        half = np.sqrt(np.maximum(square, 0.0)) * scale
        slack = CLEAR * (1.0 + np.abs(middle) + half)
        clear &= np.abs(square) > CLEAR * (np.abs(squared_reach) + away**2)
        for edge in (middle - half, middle + half):
            inside = (edge > low - 1 - slack) & (edge < high + 1 + slack)
            clear &= (square < 0) | ~inside | (np.abs(edge - np.rint(edge)) > slack)
        first = np.where(square < 0, high + 1, np.clip(np.ceil(middle - half), low, high + 1))
        last = np.where(square < 0, high, np.clip(np.floor(middle + half), low - 1, high))
        return first.astype(np.int64), last.astype(np.int64)

    first, last = low, high
    for reach in _squared_reaches(away, rise, limits):
        begin, end = ends_of(reach)
        first, last = np.maximum(first, begin), np.minimum(last, end)
    begin, end = ends_of(near**2)
    none = begin > end
    return [
        (first, np.where(none, last, np.minimum(last, begin - 1))),
        (np.where(none, last + 1, np.maximum(first, end + 1)), last),
    ], clear


def _squared_reaches(away: FloatArray, rise: int, limits: ViewLimits) -> Iterator[FloatArray]:
    """Squared distances up to which points of a line are neither too flat nor too sparse (n,).

    The line is so far away (n,), all in grid steps.
    """
    if limits.max_incidence is not None:
        yield (away / math.cos(limits.max_incidence)) ** 2 - float(rise) ** 2
    if limits.farthest_per_height is not None:
        yield limits.farthest_per_height / GRID * away - float(rise) ** 2


def _tested(
    stretches: SeenSegments, low: IntArray, high: IntArray, limits: ViewLimits
) -> tuple[IntArray, IntArray, IntArray]:
    """`clipped` by tests of single midpoints."""
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
    return _in_order(
        np.concatenate([run, run]),
        np.concatenate([low, end + 1]),
        np.concatenate([begin - 1, np.where(hole, high, end)]),
    )


def _in_order(run: IntArray, first: IntArray, last: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The pieces of runs that have units, by run and by their first unit."""
    some = np.flatnonzero(first <= last)
    order = some[np.lexsort((first[some], run[some]))]
    return run[order], first[order], last[order]


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
    _, away = _length_and_distance(stretches)
    half = np.full(len(away), 1e15)
    for reach in _squared_reaches(away, round(limits.rise / GRID), limits):
        half = np.minimum(half, _units_within(stretches, reach))
    return _foot(stretches), half


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
