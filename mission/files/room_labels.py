"""Writes room names into a plan, where they cover as little as can be of stops, route and columns."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from mission.files.sheet import Sheet
from mission.files.svg import group, shortened, text, text_width
from mission.floor import Room
from mission.geometry import BoolArray, FloatArray, IntArray

NAME, AREA = 2.3, 1.8
"""Text sizes in millimetres."""
_TRIES = 28
"""Places tried along each side of a room's bounding box."""


def room_labels(rooms: tuple[Room, ...], sheet: Sheet, *, avoid: FloatArray, reach: float) -> str:
    """Name and area of each room; `avoid` are points (n, 2) on paper, each with `reach` mm about it."""
    labels = (_label(room, sheet, avoid, reach) for room in rooms if room.polygons)
    style: dict[str, object] = {"paint_order": "stroke", "stroke": "#ffffff", "stroke_width": 0.5}
    return group("names", labels, text_anchor="middle", fill="#222222", stroke_linejoin="round", **style)


def _label(room: Room, sheet: Sheet, avoid: FloatArray, reach: float) -> str:
    rings = [sheet.on_paper(ring) for part in room.polygons for ring in part.rings]
    widest = float(np.ptp(np.concatenate(rings)[:, 0]))
    name = shortened(room.label, size=NAME, width=max(widest, 12.0))
    area = f"{room.area:.1f} m²"
    half = np.array([max(text_width(name, NAME), text_width(area, AREA)), NAME + AREA + 0.6]) / 2
    x, y = _best_place(rings, half, avoid, reach).tolist()
    return "".join((
        text(x, y - half[1] + 0.8 * NAME, name, size=NAME),
        text(x, y + half[1] - 0.15 * AREA, area, size=AREA, fill="#666666"),
    ))  # fmt: skip


def _best_place(rings: list[FloatArray], half: FloatArray, avoid: FloatArray, reach: float) -> FloatArray:
    """Centre of the label: inside the room with all its corners, clear of `avoid`, near the middle."""
    corners = np.concatenate(rings)
    low, high = corners.min(axis=0), corners.max(axis=0)
    tried = np.stack(np.meshgrid(*(np.linspace(low, high, _TRIES).T)), axis=-1).reshape(-1, 2)
    outside = sum(
        (~inside(tried + half * side, rings)).astype(np.int64)
        for side in ((-1, -1), (0, -1), (1, -1), (-1, 0), (0, 0), (1, 0), (-1, 1), (0, 1), (1, 1))
    )
    covered = _covered(tried, half + reach, avoid)
    far = np.hypot(*((tried - (low + high) / 2) / (high - low + 1e-9)).T)
    order = np.lexsort((np.arange(len(tried)), np.round(far, 6), covered + 4 * outside))
    return np.asarray(tried[order[0]])


def _covered(tried: FloatArray, half: FloatArray, avoid: FloatArray) -> IntArray:
    """How many of the points lie under a label at each place."""
    around = (np.abs(avoid - (tried[0] + tried[-1]) / 2) < half + np.ptp(tried, axis=0) / 2).all(axis=-1)
    near = np.abs(avoid[None, around, :] - tried[:, None, :]) < half
    return np.asarray(near.all(axis=-1).sum(axis=1))


def inside(points: FloatArray, rings: list[FloatArray]) -> BoolArray:
    """Whether each point (n, 2) is inside the rings, by the even-odd rule."""
    result = np.zeros(len(points), dtype=bool)
    x, y = points[:, 0, None], points[:, 1, None]
    for ring in rings:
        after = np.roll(ring, -1, axis=0)
        spans = (ring[:, 1] > y) != (after[:, 1] > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = ring[:, 0] + (y - ring[:, 1]) * (after[:, 0] - ring[:, 0]) / (after[:, 1] - ring[:, 1])
        result ^= (spans & (x < at)).sum(axis=1) % 2 == 1
    return result


def points_along(legs: list[FloatArray], *, spacing: float) -> Iterator[FloatArray]:
    """Points on polylines at most `spacing` apart, for `avoid`."""
    for leg in legs:
        for a, b in pairwise(leg):
            count = max(2, int(np.hypot(*(b - a)) / spacing) + 2)
            yield a + np.linspace(0, 1, count)[:, None] * (b - a)
