"""A room's main axes, and the corners of a grid of square cells along them (paper, 3.2.1)."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray
from stopgo.planner.geometry.shapes import GRID, segments_of

SAME_ANGLE = 1e-6
"""Directions this close (radians) are one; the longest segment then gives it."""


def room_grid(room: BaseGeometry, *, spacing: float) -> FloatArray:
    """Corners (n, 2) of cells at most `spacing` wide that divide the room's rectangle evenly."""
    if room.is_empty:
        return np.empty((0, 2))
    axes = main_axes(room)
    low, high = _extent(room, axes)
    cells = np.maximum(1, np.ceil((high - low - 4 * GRID) / spacing)).astype(int)
    u, v = (np.linspace(low[k], high[k], cells[k] + 1) for k in range(2))
    corners = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    return corners @ axes


def main_axes(room: BaseGeometry) -> FloatArray:
    """Rows: the direction most of the room's outline runs in, up to right angles, and its normal."""
    segments = segments_of(room)
    along = segments[:, 1] - segments[:, 0]
    length = np.hypot(*along.T)
    angle = np.arctan2(along[:, 1], along[:, 0]) % (np.pi / 2)
    group = np.round(angle / SAME_ANGLE) % round(np.pi / 2 / SAME_ANGLE)
    groups, index = np.unique(group, return_inverse=True)
    heaviest = int(np.argmax(np.round(np.bincount(index, weights=length, minlength=len(groups)), 6)))
    members = np.flatnonzero(index == heaviest)
    best = float(angle[members[int(np.argmax(np.round(length[members], 6)))]])
    cosine, sine = np.cos(best), np.sin(best)
    return np.array([[cosine, sine], [-sine, cosine]])


def _extent(room: BaseGeometry, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    turned = shapely.get_coordinates(room) @ axes.T
    return turned.min(axis=0), turned.max(axis=0)
