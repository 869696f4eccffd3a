"""Triangular expansion: from a point through the mesh, edge by edge, to everything it sees.

Plain functions over lists or arrays, so that the same source runs interpreted and compiled. All
coordinates are whole grid steps; every decision is exact.

The rule for rays through a vertex: a point is seen if it can be seen by a ray turned to one side by
an arbitrarily small angle. A gap of no width is not looked through, a face is not seen edge-on, and a
wedge's limits, which are always vertices, belong to it.
"""

from __future__ import annotations

from typing import Any

EXACT_BELOW = 2.0**60
"""Values whose floating point estimate is below this fit 64-bit integers, so wrapped sums are exact."""


def turn(px: int, py: int, qx: int, qy: int, rx: int, ry: int) -> int:
    """Twice the signed area of p, q, r: positive when r is left of p -> q."""
    return (qx - px) * (ry - py) - (qy - py) * (rx - px)


def side_sign(at_a: int, at_b: int, odd: int, pieces: int) -> int:
    """Sign of the linear function that is `at_a` at a and `at_b` at b, at the fraction odd / pieces."""
    slope = at_b - at_a
    estimate = float(pieces) * float(at_a) + float(odd) * float(slope)
    if estimate > EXACT_BELOW:
        return 1
    if estimate < -EXACT_BELOW:
        return -1
    value = pieces * at_a + odd * slope
    return 1 if value > 0 else (-1 if value < 0 else 0)


def within_reach(ux: int, uy: int, wx: int, wy: int, odd: int, pieces: int, reach: int) -> bool:
    """Whether u + (odd / pieces) w is at most `reach` long."""
    x = pieces * ux + odd * wx
    y = pieces * uy + odd * wy
    far = pieces * reach
    estimate = float(x) * float(x) + float(y) * float(y) - float(far) * float(far)
    if estimate > EXACT_BELOW:
        return False
    if estimate < -EXACT_BELOW:
        return True
    return x * x + y * y - far * far <= 0


def first_not_negative(at_a: int, at_b: int, units: int, low: int) -> int:
    """First unit >= low whose midpoint has a value >= 0 of a rising linear function; `units` if none."""
    pieces = 2 * units
    guess = (-float(pieces) * float(at_a) / float(at_b - at_a) - 1.0) / 2.0
    unit = low if guess < low else (units if guess > units else int(guess))
    while unit > low and side_sign(at_a, at_b, 2 * unit - 1, pieces) >= 0:
        unit -= 1
    while unit < units and side_sign(at_a, at_b, 2 * unit + 1, pieces) < 0:
        unit += 1
    return unit


def last_not_negative(at_a: int, at_b: int, units: int, high: int) -> int:
    """Last unit <= high whose midpoint has a value >= 0 of a falling linear function; -1 if none."""
    pieces = 2 * units
    guess = (-float(pieces) * float(at_a) / float(at_b - at_a) - 1.0) / 2.0
    unit = high if guess > high else (-1 if guess < -1 else int(guess))
    while unit < high and side_sign(at_a, at_b, 2 * unit + 3, pieces) >= 0:
        unit += 1
    while unit >= 0 and side_sign(at_a, at_b, 2 * unit + 1, pieces) < 0:
        unit -= 1
    return unit


def clip_side(at_a: int, at_b: int, units: int, low: int, high: int) -> tuple[int, int]:
    """Units low..high whose midpoints have a value >= 0 of a linear function given at both ends."""
    if at_a == at_b:
        return (low, high) if at_a >= 0 else (0, -1)
    if at_b > at_a:
        return first_not_negative(at_a, at_b, units, low), high
    return low, last_not_negative(at_a, at_b, units, high)


def clip_reach(
    ux: int, uy: int, wx: int, wy: int, units: int, reach: int, low: int, high: int
) -> tuple[int, int]:
    """Units low..high whose midpoints are within reach; u is the way to a, w from a to b."""
    if high < low:
        return low, high
    ww = float(wx) * float(wx) + float(wy) * float(wy)
    pieces = 2 * units
    nearest = low
    if ww > 0.0:
        foot = (-(float(ux) * float(wx) + float(uy) * float(wy)) / ww * pieces - 1.0) / 2.0
        nearest = low if foot < low else (high if foot > high else int(foot + 0.5))
        nearest = min(max(nearest, low), high)
    if not within_reach(ux, uy, wx, wy, 2 * nearest + 1, pieces, reach):
        better = nearest
        for other in (nearest - 1, nearest + 1):
            if low <= other <= high and within_reach(ux, uy, wx, wy, 2 * other + 1, pieces, reach):
                better = other
        if better == nearest:
            return 0, -1
        nearest = better
    below, above = low - 1, nearest
    while above - below > 1:
        middle = (above + below) // 2
        if within_reach(ux, uy, wx, wy, 2 * middle + 1, pieces, reach):
            above = middle
        else:
            below = middle
    first = above
    below, above = nearest, high + 1
    while above - below > 1:
        middle = (above + below) // 2
        if within_reach(ux, uy, wx, wy, 2 * middle + 1, pieces, reach):
            below = middle
        else:
            above = middle
    return first, below


def edge_too_far(
    qx: int, qy: int, ax: int, ay: int, bx: int, by: int, rx: int, ry: int, lx: int, ly: int, reach: int
) -> bool:
    """Whether the part of edge a-b between the rays through r and l is surely beyond reach."""
    ra, rb = float(turn(qx, qy, rx, ry, ax, ay)), float(turn(qx, qy, rx, ry, bx, by))
    la, lb = float(turn(qx, qy, lx, ly, ax, ay)), float(turn(qx, qy, lx, ly, bx, by))
    from_t = ra / (ra - rb) if ra < 0.0 < rb else 0.0
    to_t = la / (la - lb) if la < 0.0 < lb else 1.0
    wx, wy = float(bx - ax), float(by - ay)
    foot = (float(qx - ax) * wx + float(qy - ay) * wy) / (wx * wx + wy * wy)
    t = min(max(foot, from_t), to_t)
    dx, dy = float(ax - qx) + t * wx, float(ay - qy) + t * wy
    limit = float(reach) * 1.000001 + 4.0
    return dx * dx + dy * dy > limit * limit


def look(
    row: int,
    begin: int,
    qx: Any,
    qy: Any,
    start_pointer: Any,
    start_triangle: Any,
    vx: Any,
    vy: Any,
    corner: Any,
    neighbour: Any,
    face: Any,
    bucket_pointer: Any,
    bucket_segment: Any,
    bucket_low: Any,
    bucket_high: Any,
    ax: Any,
    ay: Any,
    bx: Any,
    by: Any,
    units: Any,
    reach: int,
    stack: Any,
    out_segment: Any,
    out_low: Any,
    out_high: Any,
) -> int:
    """Write the runs of units that viewpoint `row` sees from `begin` on; returns the end of what is written.

    Returns -1 when the room left in the output may not be enough.

    Parameters
    ----------
    qx, qy
        Viewpoints. `start_pointer[row]` to `start_pointer[row + 1]` index the triangles that hold one.
    vx, vy, corner, neighbour, face
        The mesh, three entries per triangle; `face` is the target segment on that edge or -1.
    bucket_pointer, bucket_segment, bucket_low, bucket_high
        Free target segments per triangle, with the units of them that lie in it.
    ax, ay, bx, by, units
        Target segments and the units on each.
    reach
        Range in grid steps, or -1 for none.
    stack
        Scratch for four numbers per triangle.
    out_segment, out_low, out_high
        The runs: segment, first and last unit on it.
    """
    x, y = qx[row], qy[row]
    size = len(out_segment)
    count = begin
    top = 0
    for s in range(start_pointer[row], start_pointer[row + 1]):
        stack[top], stack[top + 1], stack[top + 2], stack[top + 3] = start_triangle[s], -1, -1, -1
        top += 4
    while top > 0:
        top -= 4
        triangle, entry = stack[top], stack[top + 1]
        right, left = stack[top + 2], stack[top + 3]
        for item in range(bucket_pointer[triangle], bucket_pointer[triangle + 1]):
            segment = bucket_segment[item]
            low, high = bucket_low[item], bucket_high[item]
            n = units[segment]
            if entry >= 0:
                at_a = turn(x, y, vx[right], vy[right], ax[segment], ay[segment])
                at_b = turn(x, y, vx[right], vy[right], bx[segment], by[segment])
                low, high = clip_side(at_a, at_b, n, low, high)
                at_a = turn(x, y, ax[segment], ay[segment], vx[left], vy[left])
                at_b = turn(x, y, bx[segment], by[segment], vx[left], vy[left])
                low, high = clip_side(at_a, at_b, n, low, high)
            if reach >= 0:
                ux, uy = ax[segment] - x, ay[segment] - y
                wx, wy = bx[segment] - ax[segment], by[segment] - ay[segment]
                low, high = clip_reach(ux, uy, wx, wy, n, reach, low, high)
            if low <= high:
                if count >= size:
                    return -1
                out_segment[count], out_low[count], out_high[count] = segment, low, high
                count += 1
        for k in range(3):
            if k == entry:
                continue
            a, b = corner[3 * triangle + k], corner[3 * triangle + (k + 1) % 3]
            if entry < 0:
                if turn(x, y, vx[a], vy[a], vx[b], vy[b]) <= 0:
                    continue
                new_right, new_left = a, b
            else:
                new_right, new_left = right, left
                if turn(x, y, vx[right], vy[right], vx[a], vy[a]) > 0:
                    new_right = a
                if turn(x, y, vx[b], vy[b], vx[left], vy[left]) > 0:
                    new_left = b
                if turn(x, y, vx[new_right], vy[new_right], vx[new_left], vy[new_left]) <= 0:
                    continue
            beyond = neighbour[3 * triangle + k]
            if beyond >= 0:
                if reach >= 0 and edge_too_far(
                    x, y, vx[a], vy[a], vx[b], vy[b], vx[new_right], vy[new_right],
                    vx[new_left], vy[new_left], reach,
                ):  # fmt: skip
                    continue
                back = 0
                while corner[3 * beyond + back] != b:
                    back += 1
                stack[top], stack[top + 1] = beyond, back
                stack[top + 2], stack[top + 3] = new_right, new_left
                top += 4
                continue
            segment = face[3 * triangle + k]
            if segment < 0:
                continue
            n = units[segment]
            low, high = 0, n - 1
            if new_right != a:
                at_a = turn(x, y, vx[new_right], vy[new_right], vx[a], vy[a])
                at_b = turn(x, y, vx[new_right], vy[new_right], vx[b], vy[b])
                low, high = clip_side(at_a, at_b, n, low, high)
            if new_left != b:
                at_a = turn(x, y, vx[a], vy[a], vx[new_left], vy[new_left])
                at_b = turn(x, y, vx[b], vy[b], vx[new_left], vy[new_left])
                low, high = clip_side(at_a, at_b, n, low, high)
            if reach >= 0:
                ux, uy = vx[a] - x, vy[a] - y
                low, high = clip_reach(ux, uy, vx[b] - vx[a], vy[b] - vy[a], n, reach, low, high)
            if low <= high:
                if count >= size:
                    return -1
                out_segment[count], out_low[count], out_high[count] = segment, low, high
                count += 1
    return count


def look_all(first_row: int, pointer: Any, qx: Any, *scene_and_output: Any) -> int:
    """Let every viewpoint from `first_row` on look; returns the first row that found no room left.

    `pointer[row + 1]` becomes the end of what is written for each row; the other arguments are `look`'s.
    """
    row = first_row
    while row < len(qx):
        end = look(row, pointer[row], qx, *scene_and_output)
        if end < 0:
            return row
        pointer[row + 1] = end
        row += 1
    return row


HELPERS = (
    turn,
    side_sign,
    within_reach,
    first_not_negative,
    last_not_negative,
    clip_side,
    clip_reach,
    edge_too_far,
    look,
)
"""Everything `look_all` calls, innermost first."""
