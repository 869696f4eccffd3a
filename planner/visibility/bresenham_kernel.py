"""Bresenham's line over an occupancy raster, many lines at a time.

Plain functions over lists or arrays of whole numbers: the same source runs interpreted and compiled, with the
types of `bresenham_kernel_compiled.pxd`. No number exceeds twice the raster's width and height.
"""

from __future__ import annotations

from typing import Any


def clear_lines(
    occupied: Any, width: int, x: int, y: int, end_x: Any, end_y: Any, own: Any, clear: Any
) -> None:
    """Mark in `clear` each end whose line from (x, y) is free; `own` where its cell does not block."""
    for k in range(len(end_x)):
        if clear_line(occupied, width, x, y, end_x[k], end_y[k], own[k]):
            clear[k] = 1


def clear_line(occupied: Any, width: int, x: int, y: int, end_x: int, end_y: int, own: bool) -> bool:
    """Bresenham's line over cells, row by row in `occupied`, until it ends or is blocked."""
    dx, dy = abs(end_x - x), -abs(end_y - y)
    step_x, step_y = 1 if end_x > x else -1, 1 if end_y > y else -1
    error = dx + dy
    while x != end_x or y != end_y:
        if occupied[y * width + x]:
            return False
        twice = 2 * error
        if twice >= dy:
            error += dy
            x += step_x
        if twice <= dx:
            error += dx
            y += step_y
    return own or not occupied[y * width + x]
