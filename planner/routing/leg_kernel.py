"""Times of shortest paths, traced from their ends to one point, with their first and last headings.

Plain functions over lists or arrays: the same source runs interpreted and compiled, with the types of
`leg_kernel_compiled.pxd`. Node numbers are far below 2**62.
"""

from __future__ import annotations

import math
from typing import Any

TURN = 6.283185307179586
"""A full turn in radians, 2π."""


def follow(
    source: int, ends: int, x: Any, y: Any, before: Any, speed: float, acceleration: float, turn_rate: float,
    slack: float, seconds: Any, leaving: Any, arriving: Any,
) -> None:  # fmt: skip
    """Trace the paths from a point to the points `source + 1` to `ends - 1`; those without a path stay.

    `x`, `y` are the nodes' positions, the points first; `before` is the node before each on its path from the
    source, negative without one. Collinear pieces count as one, as they are driven: bends are none where the
    straight line passes them within `slack` metres. `seconds`, `leaving` and `arriving` receive times from
    rest to rest, and headings in radians.
    """
    for end in range(source + 1, ends):
        there = before[end]
        if there < 0:
            continue
        here, begin, spent, run, heading, last = end, end, 0.0, 0.0, 0.0, 0.0
        while there >= 0:
            along, across = x[here] - x[there], y[here] - y[there]
            length, angle = math.hypot(along, across), math.atan2(across, along)
            turn = bend(heading, angle)
            if turn * length * run > slack * (length + run):
                spent += straight(run, speed, acceleration) + turn / turn_rate
                begin, run = here, 0.0
            if begin != here:
                along, across = x[begin] - x[there], y[begin] - y[there]
                length, angle = math.hypot(along, across), math.atan2(across, along)
            run, heading = length, angle
            if begin == end:
                last = heading
            here = there
            there = before[here] if here != source else -1
        seconds[end] = spent + straight(run, speed, acceleration)
        leaving[end], arriving[end] = heading, last


def bend(one: float, other: float) -> float:
    """Angle between two headings from -π to π, in radians."""
    apart = abs(one - other)
    return min(apart, TURN - apart)


def straight(length: float, speed: float, acceleration: float) -> float:
    """Seconds of a straight drive from rest to rest, as `straight_time` has them."""
    if length >= speed * speed / acceleration:
        return length / speed + speed / acceleration
    return 2.0 * math.sqrt(length / acceleration)
