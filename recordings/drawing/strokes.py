"""Polygons as shapes that Rerun can draw: outlines, hatches and fills for 2D, triangles for 3D. Numpy only.

Rerun's 2D views fill no polygons, so a solid is filled with parallel chords as wide as their spacing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.geometry import FloatArray, IntArray, Polygon
from stopgo.mission.stages import Targets


@dataclass(frozen=True, eq=False)
class Strokes:
    """Straight strokes (k, 2, 2) and half the width of each (k,), in metres."""

    lines: FloatArray
    radii: FloatArray


def hatch(polygons: Iterable[Polygon], *, spacing: float, angle: float) -> FloatArray:
    """Return chords (k, 2, 2) of the polygons at `angle`, on one raster, so that neighbours line up."""
    rotation = _rotation(angle)
    lines = [np.empty((0, 2, 2))]
    for polygon in polygons:
        edges = _edges(polygon) @ rotation
        first, last = (np.floor(edges[..., 1].min() / spacing), np.ceil(edges[..., 1].max() / spacing))
        lines.append(_chords(edges, (np.arange(first, last) + 0.5) * spacing))
    return np.concatenate(lines) @ rotation.T


def fill(polygons: Iterable[Polygon], *, spacing: float) -> Strokes:
    """Return strokes with round ends that cover the polygons, parallel to each polygon's longest edge."""
    lines, radii = [np.empty((0, 2, 2))], [np.empty(0)]
    for polygon in polygons:
        rotation = _rotation(_longest_direction(polygon))
        edges = _edges(polygon) @ rotation
        low, high = edges[..., 1].min(), edges[..., 1].max()
        count = max(1, int(np.ceil((high - low) / spacing)))
        step = (high - low) / count
        chords = _chords(edges, low + (np.arange(count) + 0.5) * step)
        lines.append(_shortened(chords, step / 2) @ rotation.T)
        radii.append(np.full(len(chords), step / 2))
    return Strokes(np.concatenate(lines), np.concatenate(radii))


def name_point(polygon: Polygon) -> FloatArray:
    """Return a free position for a room's name: inside, near the top, where the room is wide."""
    height = max(float(np.ptp(polygon.exterior[:, 1])), 1e-3)
    chords = hatch([polygon], spacing=height / 9, angle=0.0)
    length = np.ptp(chords[:, :, 0], axis=1)
    if not len(chords) or length.max() == 0:
        return polygon.exterior.mean(axis=0)
    wide = chords[length > 0.6 * length.max()].mean(axis=1)
    return wide[np.argmax(wide[:, 1])]


def triangles(polygons: Iterable[Polygon]) -> FloatArray:
    """Return triangles (k, 3, 2) that cover the polygons: trapezoids between vertex heights."""
    parts = [np.empty((0, 3, 2))]
    for polygon in polygons:
        parts.append(_trapezoids(_edges(polygon)))
    return np.concatenate(parts)


def walls(strips: Iterable[FloatArray], *, low: float, high: float) -> FloatArray:
    """Return upright faces (k, 3, 3) below line strips, two triangles per segment."""
    a, b = _ends(strips)
    floor, top = np.full((len(a), 1), low), np.full((len(a), 1), high)
    a0, a1, b0, b1 = (np.hstack([xy, z]) for xy in (a, b) for z in (floor, top))
    return np.stack([np.stack([a0, b0, b1], axis=1), np.stack([a0, b1, a1], axis=1)], axis=1).reshape(
        -1, 3, 3
    )


def level(flat: NDArray[Any], z: float) -> NDArray[Any]:
    """Return flat triangles or points (…, 2) at the height `z` (…, 3)."""
    return np.concatenate([flat, np.full((*flat.shape[:-1], 1), z)], axis=-1)


def lines_by_value(targets: Targets, value: IntArray) -> tuple[FloatArray, IntArray]:
    """Join neighbouring units of a segment with one value; return lines (p, 2, 2) and their values (p,)."""
    segment = targets.unit_segment
    if not len(segment):
        return np.empty((0, 2, 2)), np.empty(0, dtype=np.int64)
    new = np.flatnonzero(np.diff(segment) | np.diff(value)) + 1
    first = np.concatenate([[0], new])
    last = np.concatenate([new - 1, [len(segment) - 1]])
    return range_lines(targets, segment[first], first, last), value[first]


def range_lines(targets: Targets, segment: IntArray, first: IntArray, last: IntArray) -> FloatArray:
    """Return ranges of units, `first` to `last` inclusive on `segment`, as lines (k, 2, 2)."""
    lines = np.stack([targets.a[segment], targets.b[segment]], axis=1)
    offset, count = targets.first_unit[:-1][segment], targets.units[segment]
    part = np.flatnonzero((first > offset) | (last + 1 < offset + count))
    t = np.stack([first - offset, last + 1 - offset], axis=1)[part] / count[part, None]
    a, b = lines[part, 0], lines[part, 1]
    lines[part] = a[:, None] + t[:, :, None] * (b - a)[:, None]
    return lines


def dashes(ends: FloatArray, length: float) -> FloatArray:
    """Return dashes (k, 2, 2) of a length along a straight line (2, 2), as far apart as they are long."""
    whole = float(np.hypot(*(ends[1] - ends[0])))
    begins = np.arange(0.0, whole, 2 * length)
    t = np.stack([begins, np.minimum(begins + length, whole)], axis=1) / max(whole, length)
    return ends[0] + t[:, :, None] * (ends[1] - ends[0])


def circle(radius: float, points: int = 32) -> FloatArray:
    """Return a closed circle (points + 1, 2) around the origin."""
    angle = np.linspace(0.0, 2 * np.pi, points + 1)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _rotation(angle: float) -> FloatArray:
    """Return the matrix M that rotates lines at `angle` onto the x axis by `xy @ M`."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _edges(polygon: Polygon) -> FloatArray:
    edges = [np.empty((len(ring), 2, 2)) for ring in polygon.rings]
    for edge, ring in zip(edges, polygon.rings, strict=True):
        edge[:, 0], edge[:-1, 1], edge[-1:, 1] = ring, ring[1:], ring[:1]
    return np.concatenate(edges)


def _crossings(edges: FloatArray, heights: FloatArray) -> tuple[IntArray, IntArray]:
    """Return which edges reach which ascending heights, each from its lower end to below its upper one."""
    first, last = heights.searchsorted((edges[..., 1].min(axis=1), edges[..., 1].max(axis=1)))
    count = last - first
    edge = np.repeat(np.arange(len(edges)), count)
    return edge, np.arange(len(edge)) + np.repeat(first + count - count.cumsum(), count)


def _chords(edges: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the parts (k, 2, 2) of lines at ascending heights inside the edges, by the even-odd rule."""
    edge, row = _crossings(edges, heights)
    a, b, y = edges[edge, 0], edges[edge, 1], heights[row]
    x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    order = np.lexsort((x, row))
    return np.stack([x[order], y[order]], axis=1).reshape(-1, 2, 2)


def _shortened(chords: FloatArray, by: float) -> FloatArray:
    """Shorten horizontal chords by `by` at each end, at most to their middle."""
    cut = np.minimum(by, np.ptp(chords[:, :, 0], axis=1) / 2)
    return chords + np.stack([np.stack([cut, -cut], axis=1), np.zeros((len(chords), 2))], axis=2)


def _longest_direction(polygon: Polygon) -> float:
    vectors = np.roll(polygon.exterior, -1, axis=0) - polygon.exterior
    longest = vectors[np.argmax((vectors**2).sum(axis=1))]
    return float(np.arctan2(longest[1], longest[0]))


def _trapezoids(edges: FloatArray) -> FloatArray:
    """Return two triangles (k, 3, 2) of each trapezoid between neighbouring heights of the edges' ends."""
    heights = np.unique(edges[..., 1])
    edge, band = _crossings(edges, heights)
    a, b = edges[edge, 0], edges[edge, 1]
    slope = (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    ends = np.empty((len(edge), 2, 2))
    ends[:, :, 1] = np.stack([heights[band], heights[band + 1]], axis=1)
    ends[:, :, 0] = a[:, :1] + (ends[:, :, 1] - a[:, 1:]) * slope[:, None]
    ends = ends[np.lexsort((ends[:, 0, 0] + ends[:, 1, 0], band))]
    left, right = ends[::2], ends[1::2]
    corners = np.concatenate([left, right], axis=1)  # lower left, upper left, lower right, upper right
    lower, upper = corners[:, [0, 2, 3]], corners[:, [0, 3, 1]]
    bands = np.sort(band)[::2]
    return np.concatenate([lower, upper])[np.argsort(np.tile(bands, 2), kind="stable")]


def _ends(strips: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    parts = [strip for strip in strips if len(strip) > 1]
    if not parts:
        return np.empty((0, 2)), np.empty((0, 2))
    return np.concatenate([part[:-1] for part in parts]), np.concatenate([part[1:] for part in parts])
