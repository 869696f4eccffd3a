"""Room names on a plan, at positions that cover as little as possible of stops, route and columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

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


@dataclass(frozen=True, eq=False)
class Busy:
    """Points on paper (n, 2) that labels should not cover, and how much each matters (n,)."""

    xy: FloatArray
    weight: IntArray

    @classmethod
    def of(cls, *layers: tuple[int, list[FloatArray]]) -> Busy:
        """From (weight, points) of each layer."""
        kept = [(weight, np.concatenate(points)) for weight, points in layers if points]
        weights = [np.full(len(points), weight) for weight, points in kept]
        return cls(np.concatenate([points for _, points in kept]), np.concatenate(weights))

    def and_also(self, weight: int, points: FloatArray) -> Busy:
        weights = np.full(len(points), weight)
        return Busy(np.concatenate([self.xy, points]), np.concatenate([self.weight, weights]))

    def near(self, low: FloatArray, high: FloatArray) -> Busy:
        """Those between two corners, in any order."""
        order, x, first = self._strips
        begin, end = (
            np.clip(np.floor(y / STRIP) - self._lowest, 0, len(first) - 1) for y in (low[1], high[1])
        )
        found = [np.empty(0, dtype=np.int64)]
        for strip in range(int(begin), min(int(end) + 1, len(first) - 1)):
            there = slice(first[strip], first[strip + 1])
            within = np.searchsorted(x[there], [low[0], high[0]])
            found.append(order[there][within[0] : within[1]])
        index = np.concatenate(found)
        y = self.xy[index, 1]
        index = index[(y > low[1]) & (y < high[1])]
        return Busy(self.xy[index], self.weight[index])

    @cached_property
    def _lowest(self) -> float:
        return math.floor(self.xy[:, 1].min() / STRIP) if len(self.xy) else 0.0

    @cached_property
    def _strips(self) -> tuple[IntArray, FloatArray, IntArray]:
        """Points by strips STRIP high and by x in each: their order, x, and where each strip begins."""
        strip = (np.floor(self.xy[:, 1] / STRIP) - self._lowest).astype(np.int64)
        order = np.lexsort((self.xy[:, 0], strip))
        many = int(strip.max(initial=-1)) + 1
        return order, self.xy[order, 0], np.searchsorted(strip[order], np.arange(many + 1))


@dataclass(frozen=True, eq=False)
class Label:
    """Lines of (text, size) about a centre on paper, and what they cover there."""

    lines: list[tuple[str, float]]
    centre: FloatArray
    half: FloatArray
    """Half its width and height."""
    cost: float
    crosses: bool
    """A wall, a stop or another label."""

    @property
    def points(self) -> FloatArray:
        """Points (28, 2) all over it, from corner to corner, for other labels to keep off."""
        grid = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 4)), axis=-1).reshape(-1, 2)
        return self.centre + grid * self.half


def room_labels(rooms: tuple[Room, ...], sheet: PaperSheet, *, avoid: Busy) -> str:
    """Return name and area of each room, away from `avoid` and each other.

    Without space for both, the name is alone, then only its first word; a room without space even for that
    has no label here.
    """
    labels: list[Label] = []
    written = np.empty((0, 28, 2))
    # The smallest rooms first: they have the least choice.
    for room in sorted((room for room in rooms if room.polygons), key=lambda room: room.area):
        label = _label(room, sheet, avoid, written)
        if label is not None:
            labels.append(label)
            written = np.concatenate([written, label.points[None]])
    style: dict[str, object] = {"paint_order": "stroke", "stroke": "#ffffff", "stroke_width": 0.5}
    drawn = ("".join(_lines(label)) for label in labels)
    return group("names", drawn, text_anchor="middle", fill="#222222", stroke_linejoin="round", **style)


def _label(room: Room, sheet: PaperSheet, avoid: Busy, written: FloatArray) -> Label | None:
    """The fullest that crosses no wall and no other label; they are at the points `written` (n, 28, 2)."""
    rings = [sheet.on_paper(ring) for part in room.polygons for ring in part.rings]
    for layouts in _layouts(room, max(float(np.ptp(np.concatenate(rings)[:, 0])) - 1.0, LEAST)):
        best: Label | None = None
        for lines in layouts:
            label = _placed(lines, rings, avoid, written)
            if not label.crosses and (best is None or label.cost < best.cost):
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


def _placed(
    lines: list[tuple[str, float]], rings: list[FloatArray], avoid: Busy, written: FloatArray
) -> Label:
    size = (max(text_width(*item) for item in lines), sum(size + 0.4 for _, size in lines))
    half = np.array(size) / 2
    cost, crossed, centre = _best_place(rings, half, avoid, written)
    return Label(lines, centre, half, cost, crossed > 0)


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


def _best_place(
    rings: list[FloatArray], half: FloatArray, avoid: Busy, written: FloatArray
) -> tuple[float, float, FloatArray]:
    """Cost of a label, how much of it is for what it may not cross, and its centre.

    It is inside the room with its corners, off all else, and near the middle.
    """
    corners = np.concatenate(rings)
    low, high = corners.min(axis=0), corners.max(axis=0)
    x, y = np.linspace(low, high, _TRIES).T
    tried = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    touching = (written[:, -1] > low - half) & (written[:, 0] < high + half)
    around = written[touching.all(axis=1)].reshape(-1, 2)
    close = around[((around > low - half) & (around < high + half)).all(axis=1)]
    busy = avoid.near(low - half, high + half).and_also(LABEL, close)
    outside = OUTSIDE * _outside(x, y, half, rings)
    cost = covered_weight(x, y, half + AROUND, busy) + outside
    far: FloatArray = np.hypot(*((tried - (low + high) / 2) / (high - low + 1e-9)).T)
    order = np.lexsort((np.arange(len(tried)), np.round(far, 6), cost))
    best = order[0]
    way = busy.xy[busy.weight == WAY]
    on_way = WAY * np.count_nonzero((np.abs(way - tried[best]) < half + AROUND).all(axis=1))
    return float(cost[best]), float(cost[best] - on_way), np.asarray(tried[best])


def covered_weight(x: FloatArray, y: FloatArray, half: FloatArray, avoid: Busy) -> FloatArray:
    """Return the weight of the points under a label at each position of the grid x by y, row by row.

    A point lies under a block of neighbouring positions. Its weight is added where a block begins and taken
    away where it ends; the running sums along both sides of the grid are the weights.
    """
    sides = zip((y, x), avoid.xy.T[::-1], half[::-1], strict=True)
    rows, columns = (
        (np.searchsorted(at + reach, of, side="right"), np.searchsorted(at - reach, of, side="left"))
        for at, of, reach in sides
    )
    shape = (len(y) + 1, len(x) + 1)
    change = np.zeros(shape)
    for (row, add), (column, more) in product(
        zip(rows, (1, -1), strict=True), zip(columns, (1, -1), strict=True)
    ):
        place = np.ravel_multi_index((row, column), shape)
        change += np.bincount(place, add * more * avoid.weight, change.size).reshape(shape)
    return np.asarray(change.cumsum(axis=0).cumsum(axis=1)[:-1, :-1].ravel())


def _outside(x: FloatArray, y: FloatArray, half: FloatArray, rings: list[FloatArray]) -> FloatArray:
    """Return the number of a label's nine points outside the rings, at each grid position, row by row."""
    sides = np.array([-1.0, 0.0, 1.0])[:, None]
    within = inside((x + half[0] * sides).ravel(), (y + half[1] * sides).ravel(), rings)
    counts = (~within).reshape(3, len(y), 3, len(x)).sum(axis=(0, 2))
    return np.asarray(counts.ravel(), dtype=np.float64)


def inside(x: FloatArray, y: FloatArray, rings: list[FloatArray]) -> BoolArray:
    """Return True for points of the grid x by y inside the rings, by the even-odd rule (rows of y)."""
    result = np.zeros((len(y), len(x)), dtype=bool)
    for ring in rings:
        after = np.roll(ring, -1, axis=0)
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
