"""Room names on a plan, at positions that cover as little as possible of stops, route and columns."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.files.sheet import PaperSheet
from stopgo.mission.files.svg import group, shortened, text, text_width
from stopgo.mission.floor import Room
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray

NAME, AREA = 2.6, 2.5
"""Text sizes in millimetres."""
LEAST = 9.0
"""Millimetres that a name may take even in a narrower room."""
AROUND = 0.4
"""Millimetres kept free round a label."""
STOPS, WAY, WALLS = 60, 10, 7
"""Cost of each point of a stop, of the route (which a label may cross) and of an element.

Costs are whole numbers: their sums are equal on every machine.
"""
OUTSIDE = 60
"""Cost of each of nine points of a label that lies outside its room."""
LABEL = 20
"""Cost of each of 28 points of another label."""
STRIP = 10.0
"""Height in millimetres of the strips by which points are found."""
_TRIES = 28
"""Positions tried along each side of a room's bounding box."""
_STEPS = np.arange(_TRIES)[:, None]
_ROUNDING = 1e-6
"""Millimetres by which a label may seem to leave the bounds of a room that it just fits."""


@dataclass(frozen=True, eq=False)
class Busy:
    """Points on paper (n, 2) that labels should not cover, and how much each matters (n,)."""

    xy: FloatArray
    weight: FloatArray
    below: Busy | None = None
    """More points, which several share."""

    @classmethod
    def of(cls, *layers: tuple[int, list[FloatArray]], below: Busy | None = None) -> Busy:
        """From (weight, points) of each layer."""
        kept = [(weight, np.concatenate(points)) for weight, points in layers if points]
        weights = [np.full(len(points), float(weight)) for weight, points in kept]
        return cls(np.concatenate([points for _, points in kept]), np.concatenate(weights), below)

    def and_also(self, weight: int, points: FloatArray) -> Busy:
        return self.joined(Busy(points, np.full(len(points), float(weight))))

    def joined(self, other: Busy) -> Busy:
        """The points of both."""
        xy = np.concatenate([self.xy.T, other.xy.T], axis=1).T
        return Busy(xy, np.concatenate([self.weight, other.weight]))

    def only(self, chosen: BoolArray) -> Busy:
        """Those of the points (n,) that are chosen."""
        return Busy(self.xy.T.compress(chosen, axis=1).T, self.weight[chosen])

    def near(self, low: FloatArray, high: FloatArray) -> Busy:
        """Those between two corners, in any order."""
        xy, weight, first = self._strips
        (left, bottom), (right, top) = low.tolist(), high.tolist()
        begin, end = (math.floor(y / STRIP) - self._lowest for y in (bottom, top))
        found = [slice(0)]
        for strip in range(max(begin, 0), min(end + 1, len(first) - 1)):
            x = xy[0, first[strip] : first[strip + 1]]
            found.append(slice(*(first[strip] + x.searchsorted((left, right)))))
        xy = np.concatenate([xy[:, there] for there in found], axis=1)
        within = (xy[1] > bottom) & (xy[1] < top)
        own = Busy(xy.T, np.concatenate([weight[there] for there in found])).only(within)
        return own if self.below is None else own.joined(self.below.near(low, high))

    @cached_property
    def _lowest(self) -> int:
        return math.floor(self.xy[:, 1].min() / STRIP) if len(self.xy) else 0

    @cached_property
    def _strips(self) -> tuple[FloatArray, FloatArray, list[int]]:
        """Points (2, n) and weights by strips STRIP high and by x in each, and where each strip begins."""
        strip = (np.floor(self.xy[:, 1] / STRIP) - self._lowest).astype(np.int64)
        order = np.lexsort((self.xy[:, 0], strip))
        many = int(strip.max(initial=-1)) + 1
        begins = np.searchsorted(strip[order], np.arange(many + 1)).tolist()
        return self.xy[order].T.copy(), self.weight[order], begins


@dataclass(frozen=True, eq=False)
class Label:
    """Lines of (text, size) about a centre on paper, and what they cover there."""

    lines: list[tuple[str, float]]
    centre: FloatArray
    half: FloatArray
    """Half its width and height."""
    cost: float

    @property
    def points(self) -> FloatArray:
        """Points (28, 2) all over it, from corner to corner, for other labels to keep off."""
        return np.asarray(self.centre + _ALL_OVER * self.half)


_ALL_OVER = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 4)), axis=-1).reshape(-1, 2)


def room_labels(
    rooms: Sequence[Room], sheet: PaperSheet, *, avoid: Busy, known: KnownLabels | None = None
) -> str:
    """Return name and area of each room, away from `avoid` and each other.

    Without space for both, the name is alone, then only its first word; a room without space even for that
    has no label here. The labels `known` are those of all rooms, off what is below `avoid`.
    """
    labels = known.off(avoid, rooms) if known else _labels(_smallest_first(rooms), sheet, avoid)
    style: dict[str, object] = {"paint_order": "stroke", "stroke": "#ffffff", "stroke_width": 0.5}
    drawn = ("".join(_lines(label)) for label in labels if label is not None)
    return group("names", drawn, text_anchor="middle", fill="#222222", stroke_linejoin="round", **style)


def _smallest_first(rooms: Sequence[Room]) -> list[Room]:
    """The rooms to name: the smallest have the least choice."""
    return sorted((room for room in rooms if room.polygons), key=lambda room: room.area)


def _labels(rooms: Sequence[Room], sheet: PaperSheet, avoid: Busy) -> list[Label | None]:
    return _in_turn(len(rooms), lambda k, written: _label(rooms[k], sheet, avoid, written))


def _in_turn(many: int, label_of: Callable[[int, FloatArray], Label | None]) -> list[Label | None]:
    """The label of each room, from its number and the points (2, 28, n) of the n labels before it."""
    labels: list[Label | None] = []
    written, count = np.empty((*_ALL_OVER.T.shape, many)), 0
    for k in range(many):
        label = label_of(k, written[:, :, :count])
        if label is not None:
            written[:, :, count] = label.points.T
            count += 1
        labels.append(label)
    return labels


@dataclass(frozen=True, eq=False)
class KnownLabels:
    """Labels of all rooms of a floor on a sheet, off the points that several missions share."""

    sheet: PaperSheet
    rooms: list[Room]
    """The smallest first."""
    labels: list[Label | None]
    within: FloatArray
    """Lower and upper corner of what is considered for each label (n, 2, 2)."""

    @classmethod
    def of(cls, rooms: Sequence[Room], sheet: PaperSheet, avoid: Busy) -> KnownLabels:
        named = _smallest_first(rooms)
        within = [_considered(room, sheet) for room in named]
        return cls(sheet, named, _labels(named, sheet, avoid), np.reshape(within, (-1, 2, 2)))

    def off(self, avoid: Busy, rooms: Sequence[Room]) -> list[Label | None]:
        """Labels of some rooms off more points: only near these, and near labels that differ, others."""
        shown = {id(room) for room in rooms}
        cells = np.unique(np.floor(avoid.xy / STRIP), axis=0) * STRIP
        again = self._near(cells, cells + STRIP)

        def label_of(k: int, written: FloatArray) -> Label | None:
            known, label = self.labels[k], None
            if id(self.rooms[k]) in shown:
                label = _label(self.rooms[k], self.sheet, avoid, written) if again[k] else known
            for changed in (label, known) if not _alike(label, known) else ():
                if changed is not None:
                    corners = changed.centre - changed.half, changed.centre + changed.half
                    again[:] |= self._near(*(corner[None] for corner in corners))
            return label

        return _in_turn(len(self.rooms), label_of)

    def _near(self, low: FloatArray, high: FloatArray) -> BoolArray:
        """True for the rooms for whose labels something between any of these corners (m, 2) is considered."""
        begins, ends = self.within[:, None, 0], self.within[:, None, 1]
        both = np.all((begins <= high) & (low <= ends), axis=2)
        return np.asarray(np.any(both, axis=1))


def _alike(one: Label | None, other: Label | None) -> bool:
    if one is None or other is None:
        return one is other
    return one.lines == other.lines and np.array_equal(one.centre, other.centre)


def _considered(room: Room, sheet: PaperSheet) -> tuple[FloatArray, FloatArray]:
    """Corners of the room with the widest margin of any of its labels."""
    corners = np.concatenate(_rings_on(sheet, room))
    low, high = corners.min(axis=0), corners.max(axis=0)
    layouts = (lines for several in _layouts(room, _widest(low, high)) for lines in several)
    margin = np.max([_half(lines) for lines in layouts], axis=0) + 2 * AROUND
    return low - margin, high + margin


def _rings_on(sheet: PaperSheet, room: Room) -> list[FloatArray]:
    return [sheet.on_paper(ring) for part in room.polygons for ring in part.rings]


def _label(room: Room, sheet: PaperSheet, avoid: Busy, written: FloatArray) -> Label | None:
    """The fullest that crosses no wall and no other label; they are at the points `written` (2, 28, n)."""
    rings = _rings_on(sheet, room)
    corners = np.concatenate(rings)
    places = LabelPlaces(rings, corners.min(axis=0), corners.max(axis=0), avoid, written)
    for layouts in _layouts(room, _widest(places.low, places.high)):
        best: Label | None = None
        for lines in layouts:
            label = _placed(lines, places)
            if label is not None and (best is None or label.cost < best.cost):
                best = label
            if best is not None and not best.cost:
                return best
        if best is not None:
            return best
    return None


def _layouts(room: Room, widest: float) -> Iterator[list[list[tuple[str, float]]]]:
    """Yield possible labels, the longest first: on one line or two, with and without the area."""
    area = (f"{room.area:.1f} m²", AREA)
    names = [wrapped(room.label, width=widest), wrapped(room.label, width=0.0, cut=widest)]
    different = names if names[0] != names[1] else names[:1]
    on_lines = [[(name, NAME) for name in halves] for halves in different]
    yield [[*lines, area] for lines in on_lines]
    yield on_lines
    yield [[(room.label.partition(" ")[0], NAME)]]


def _placed(lines: list[tuple[str, float]], places: LabelPlaces) -> Label | None:
    """Return the label at its best place; None if it crosses a wall, a stop or another label there."""
    half = _half(lines)
    found = places.best(half)
    return None if found is None else Label(lines, found[1], half, found[0])


def _widest(low: FloatArray, high: FloatArray) -> float:
    """Millimetres that a label may take in a room between these corners."""
    return max(float(high[0] - low[0]) - 1.0, LEAST)


def _half(lines: list[tuple[str, float]]) -> FloatArray:
    """Half the width and height of a label."""
    size = (max(text_width(*item) for item in lines), sum(size + 0.4 for _, size in lines))
    return np.array(size) / 2


def wrapped(name: str, *, width: float, cut: float | None = None) -> list[str]:
    """The name on one line if that is `width` at most, else on two broken at the space that makes
    them most alike, each cut to `cut` (else `width`)."""
    if text_width(name, NAME) <= width:
        return [name]
    breaks = [(name[:at], name[at + 1 :]) for at, letter in enumerate(name) if letter == " "]
    halves = min(breaks, key=lambda pair: max(text_width(half, NAME) for half in pair), default=(name,))
    return [shortened(half, size=NAME, width=cut or width) for half in halves if half]


def _lines(label: Label) -> Iterator[str]:
    x, top = (label.centre - (0.0, label.half[1])).tolist()
    for content, size in label.lines:
        top += size + 0.4
        yield text(x, top - 0.2 * size, content, size=size)


@dataclass(frozen=True, eq=False)
class LabelPlaces:
    """Positions for the label of a room, and what is near.

    `rings` of the room are on paper, between the corners `low` and `high`; the points of other labels
    `written` are (2, 28, n).
    """

    rings: list[FloatArray]
    low: FloatArray
    high: FloatArray
    avoid: Busy
    written: FloatArray

    def best(self, half: FloatArray) -> tuple[float, FloatArray] | None:
        """Cost and centre of a label that is inside the room with its corners, off all else, near the middle.

        None if it covers there what it may not cross. Where it leaves the room's bounds, three of its nine
        points at least are outside; a place between the bounds that costs less is the best of all.
        """
        x, y = (
            at[bisect_left(at, low + reach - _ROUNDING) : bisect_right(at, high - reach + _ROUNDING)]
            for at, reach, low, high in zip(self._tried, half, self.low, self.high, strict=True)
        )
        if not len(x) or not len(y):
            return None
        found = self._best_of(x, y, half, self._close)
        if found is None or found[0] < 3 * OUTSIDE:
            return found
        return self._best_of(self._tried[0], self._tried[1], half, self._near(half))

    @cached_property
    def _tried(self) -> FloatArray:
        """Positions along x and y (2, n)."""
        return (self.low + _STEPS * ((self.high - self.low) / (_TRIES - 1))).T

    @cached_property
    def _close(self) -> tuple[Busy, Busy]:
        """Points that a label between the room's bounds may cover."""
        return self._near(AROUND + _ROUNDING)

    def _near(self, margin: FloatArray | float) -> tuple[Busy, Busy]:
        """The points near the room that a label may not cross, and those of the route."""
        low, high = self.low - margin, self.high + margin
        begin, end = low[:, None], high[:, None]
        touching = ((self.written[:, -1] > begin) & (self.written[:, 0] < end)).all(axis=0)
        around = self.written.compress(touching, axis=2).reshape(2, -1)
        close = around.compress(((around > begin) & (around < end)).all(axis=0), axis=1)
        busy = self.avoid.near(low, high)
        way = busy.weight == WAY
        return busy.only(~way).and_also(LABEL, close.T), busy.only(way)

    def _best_of(
        self, x: FloatArray, y: FloatArray, half: FloatArray, near: tuple[Busy, Busy]
    ) -> tuple[float, FloatArray] | None:
        crossed, on_way = near
        cost = covered_weight(x, y, half + AROUND, crossed)
        if cost.min() > 0:
            return None
        cost += OUTSIDE * _outside(x, y, half, self.rings)
        way = covered_weight(x, y, half + AROUND, on_way)
        cost += way
        least = float(cost.min())
        row, column = np.nonzero(cost == least)
        middle, size = (self.low + self.high) / 2, self.high - self.low + 1e-9
        far = np.hypot((x[column] - middle[0]) / size[0], (y[row] - middle[1]) / size[1])
        nearest = far.round(6).argmin()
        row, column = row[nearest], column[nearest]
        return None if least > way[row, column] else (least, np.array([x[column], y[row]]))


def covered_weight(x: FloatArray, y: FloatArray, half: FloatArray, avoid: Busy) -> FloatArray:
    """Return the weight of the points under a label at each position of the grid x by y (rows of y)."""
    columns, rows = (
        (at[:, None] - reach < of) & (of < at[:, None] + reach)
        for at, of, reach in zip((x, y), avoid.xy.T, half, strict=True)
    )
    return np.asarray((rows * avoid.weight) @ columns.T.astype(np.float64))


def _outside(x: FloatArray, y: FloatArray, half: FloatArray, rings: list[FloatArray]) -> IntArray:
    """Return the number of a label's nine points outside the rings, at each position (rows of y)."""
    sides = np.array([-1.0, 0.0, 1.0])[:, None]
    within = inside((x + half[0] * sides).ravel(), (y + half[1] * sides).ravel(), rings)
    return np.asarray((~within).reshape(3, len(y), 3, len(x)).sum(axis=(0, 2)))


def inside(x: FloatArray, y: FloatArray, rings: list[FloatArray]) -> BoolArray:
    """Return True for points of the grid x by y inside the rings, by the even-odd rule (rows of y)."""
    result = np.zeros((len(y), len(x)), dtype=bool)
    for ring in rings:
        after = np.concatenate([ring[1:], ring[:1]])
        level = y[:, None]
        spans = (ring[:, 1] > level) != (after[:, 1] > level)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = ring[:, 0] + (level - ring[:, 1]) * (after[:, 0] - ring[:, 0]) / (after[:, 1] - ring[:, 1])
        at = np.where(spans, at, -np.inf)
        for edge in np.flatnonzero(spans.any(axis=0)):
            result ^= x < at[:, edge, None]
    return result


def points_along(lines: Sequence[FloatArray], *, spacing: float) -> FloatArray:
    """Points (n, 2) on polylines at most `spacing` apart, for `avoid`."""
    none = np.empty((0, 2))
    begin = np.concatenate([none, *(line[:-1] for line in lines)])
    along = np.concatenate([none, *(line[1:] for line in lines)]) - begin
    steps = np.maximum(1, (np.hypot(*along.T) / spacing).astype(np.int64) + 1)
    of = np.repeat(np.arange(len(begin)), steps + 1)
    step = np.arange(len(of)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)
    return np.asarray(begin[of] + (step / steps[of])[:, None] * along[of])
