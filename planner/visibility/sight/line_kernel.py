"""Lines of sight from one position, each tested against every edge that is near enough to block it.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
`line_kernel_compiled.pxd`. Coordinates are whole grid steps within ±2**29, and units are at least 1 mm
long, so a line times its `pieces` is below 2**55. Longer products are two numbers, high * 2**SPLIT + low.

A line is rotated by an arbitrarily small angle, once to the left and once to the right, and is open if one
of the two is. Floating point decides where the bound of its error lets it, and whole numbers where not.

Data
----
- `reach`: the range in grid steps, at most 2**31.
- `chosen`: midpoints to be tested (n,).
- `a`, `b`: ends of every midpoint's segment, x and y in turn (2 m,).
- `odd`, `pieces`: its fraction of the line from a to b is odd / pieces (m,).
- `face`: 1 for midpoints that are seen only from the left of a -> b (m,).
- `edges`: both ends of every edge, x and y in turn (4 e,).
- `near`, `away`: edges by ascending distance (k,), and the distances, at most 1 step too long (k,).
- `hidden_by`: an edge that hid each midpoint from an earlier position, -1 if none is known (m,). It is tested
  first, since it often hides the midpoint from the next position, too. It receives those that are found.
"""

from __future__ import annotations

from typing import Any

SPLIT, LOW = 27, 134217727
DOUBT = 1.7763568394002505e-15
"""2**-49: error of a sum in floating point, of the sizes of its products. It is 16 roundings of 7 at most."""
LEFT, RIGHT, BOTH = 1, 2, 3
"""The rotated lines that an edge blocks."""


def mark_seen(
    x: int, y: int, reach: int, chosen: Any, a: Any, b: Any, odd: Any, pieces: Any, face: Any, edges: Any,
    near: Any, away: Any, hidden_by: Any, seen: Any,
) -> None:  # fmt: skip
    """Mark the midpoints that the position x, y sees.

    `seen` has zeros (n,), and receives 1 for what is seen.
    """
    for k in range(len(chosen)):
        unit = chosen[k]
        ax, ay, bx, by = a[2 * unit] - x, a[2 * unit + 1] - y, b[2 * unit] - x, b[2 * unit + 1] - y
        if face[unit] and ax * by - ay * bx <= 0:
            continue
        rest = pieces[unit] - odd[unit]
        to_x, to_y = rest * ax + odd[unit] * bx, rest * ay + odd[unit] * by
        if not within(to_x, to_y, pieces[unit] * reach):
            continue
        known = hidden_by[unit]
        if known >= 0 and blocked(x, y, to_x, to_y, pieces[unit], edges, 4 * known) == BOTH:
            continue
        known = first_hider(x, y, to_x, to_y, pieces[unit], edges, near, away)
        if known == -1:
            seen[k] = 1
        elif known >= 0:
            hidden_by[unit] = known


def first_hider(x: int, y: int, to_x: int, to_y: int, pieces: int, edges: Any, near: Any, away: Any) -> int:
    """The nearest edge that hides the end of a line from x, y to `to` / `pieces`.

    -1 if the end is seen, and -2 if one edge blocks the line rotated to the left, and another to the right.
    """
    length = (float(to_x) * float(to_x) + float(to_y) * float(to_y)) ** 0.5 / float(pieces)
    sides = 0
    for place in range(len(near)):
        if away[place] > length + 2.0:
            break
        found = blocked(x, y, to_x, to_y, pieces, edges, 4 * near[place])
        if found == BOTH:
            return int(near[place])
        sides |= found
        if sides == BOTH:
            return -2
    return -1


def blocked(x: int, y: int, to_x: int, to_y: int, pieces: int, edges: Any, at: int) -> int:
    """The rotated lines from x, y to `to` / `pieces` that the edge at `at` blocks: 0 if neither."""
    from_x, from_y = float(edges[at] - x), float(edges[at + 1] - y)
    end_x, end_y = float(edges[at + 2] - x), float(edges[at + 3] - y)
    plus, minus = float(to_x) * from_y, float(to_y) * from_x
    start, start_doubt = plus - minus, DOUBT * (abs(plus) + abs(minus))
    plus, minus = float(to_x) * end_y, float(to_y) * end_x
    end, end_doubt = plus - minus, DOUBT * (abs(plus) + abs(minus))
    if (start > start_doubt and end > end_doubt) or (start < -start_doubt and end < -end_doubt):
        return 0
    plus, minus = from_x * end_y, from_y * end_x
    near, near_doubt = plus - minus, DOUBT * (abs(plus) + abs(minus))
    beyond = start - end + float(pieces) * near
    doubt = start_doubt + end_doubt + float(pieces) * near_doubt
    if abs(near) > near_doubt and abs(beyond) > doubt:
        if (near > 0.0) == (beyond > 0.0):
            return 0
        if abs(start) > start_doubt and abs(end) > end_doubt:
            return BOTH
    return blocked_exactly(
        to_x, to_y, pieces, edges[at] - x, edges[at + 1] - y, edges[at + 2] - x, edges[at + 3] - y
    )


def blocked_exactly(
    to_x: int, to_y: int, pieces: int, from_x: int, from_y: int, end_x: int, end_y: int
) -> int:
    """The same in whole numbers alone; the edge's ends are seen from the position."""
    from_high, from_low = side(to_x, to_y, from_x, from_y)
    end_high, end_low = side(to_x, to_y, end_x, end_y)
    near = from_x * end_y - from_y * end_x
    high = from_high - end_high + pieces * (near >> SPLIT)
    low = from_low - end_low + pieces * (near & LOW)
    if sign(near, 0) * sign(high + (low >> SPLIT), low & LOW) >= 0:
        return 0
    start, end, found = sign(from_high, from_low), sign(end_high, end_low), 0
    if (start > 0) != (end > 0):
        found |= LEFT
    if (start >= 0) != (end >= 0):
        found |= RIGHT
    return found


def side(to_x: int, to_y: int, x: int, y: int) -> tuple[int, int]:
    """Cross product of a line with a point, as high and low part: above 0 if it is left of the line."""
    high = (to_x >> SPLIT) * y - (to_y >> SPLIT) * x
    low = (to_x & LOW) * y - (to_y & LOW) * x
    return high + (low >> SPLIT), low & LOW


def sign(high: int, low: int) -> int:
    """1, 0 or -1; `low` is not negative."""
    if high != 0:
        return 1 if high > 0 else -1
    return 1 if low > 0 else 0


def within(x: int, y: int, limit: int) -> bool:
    """True if x, y is at most `limit` long."""
    x_high, x_low, y_high, y_low = x >> SPLIT, x & LOW, y >> SPLIT, y & LOW
    high, low = limit >> SPLIT, limit & LOW
    least = x_low * x_low + y_low * y_low - low * low
    middle = 2 * (x_high * x_low + y_high * y_low - high * low) + (least >> SPLIT)
    most = x_high * x_high + y_high * y_high - high * high + (middle >> SPLIT)
    return most < 0 or (most == 0 and (middle & LOW) == 0 and (least & LOW) == 0)
