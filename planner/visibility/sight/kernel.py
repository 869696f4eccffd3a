"""Triangular expansion: from a viewpoint through the mesh, edge by edge, to everything it sees.

The functions are plain functions over lists or arrays. So the same source runs interpreted and compiled.
`look` stays one loop with many arguments, because it is a compiled kernel over flat arrays of whole numbers.

Data, for t triangles, in flat arrays
-------------------------------------
- Mesh: triangle i has corners `corner[3 * i + k]`, k = 0, 1, 2, counter-clockwise. Edge k runs from corner k
  to corner k + 1. `neighbour[3 * i + k]` is the triangle across edge k, or -1 at the boundary; there
  `face[3 * i + k]` is the target segment on that edge, or -1. `vx`, `vy` are the vertices, and after them the
  points that limit the views of viewpoints.
- Targets: segment s runs from (`ax[s]`, `ay[s]`) to (`bx[s]`, `by[s]`) and has `units[s]` equal units.
  Segments off the mesh's edges lie in buckets: triangle i has entries `bucket_pointer[i]` to
  `bucket_pointer[i + 1]`.
- Viewpoints: `start_*` hold the triangles that contain each viewpoint; a vertex has several.
- Output: runs (segment, first unit, last unit). A unit is seen if its midpoint is seen.

The stack
---------
Each entry has four numbers: a triangle, the edge by which the view entered it (-1 at the start), and the
vertices that limit the wedge of view on the right and on the left (-1: all round). Entering an edge narrows
the wedge to the rays through that edge. A wedge that becomes empty, or surely out of range, is dropped. So
every ray is followed to a boundary edge or to the end of the range.

Invariants
----------
- All coordinates are whole grid steps, and every decision is exact. Floating point only guesses
  (`first_not_negative`, `last_not_negative`, `clip_reach`), or skips edges surely out of range
  (`edge_too_far`).
- After the start a wedge is less than a half turn, its limits are vertices, and they belong to it.
- A ray through a vertex: a point is seen if a ray rotated to one side by an arbitrarily small angle sees it.
  A gap of no width is not looked through, and a face is not seen edge-on.

No number exceeds 64 bits, where machine code and Python would differ. The arguments lie within these bounds,
which `stopgo.planner.visibility.sight.sight` ensures:

- coordinates within ±2**29, so differences within 2**30 and turns within 2**61; what a viewpoint looks
  between lies within 2**30 of it;
- at most 2**26 units on a segment, so `pieces`, two per unit, within 2**27;
- a range of at most 2**31, which is beyond any two points.

Greater products are stored in parts, each multiplied by itself.

From all positions of a cell
----------------------------
`look_from_cell` finds all units that any position in a rectangle may see. A line of sight from a position c
that passes a corner R on its right meets points p with turn(c, R, p) >= 0. So the cell may see p only if the
largest of these turns over the cell is not negative. That maximum is at a corner of the cell. Each limit is
tested by itself: a unit found may be visible from no position, but no visible unit is left out. As a cell
becomes small, the surplus vanishes.

`kernel_compiled.pxd` gives the types of what is compiled.
"""

from __future__ import annotations

from typing import Any

MOST_UNITS = 2**26
"""Units on one segment."""
FARTHEST = 2**31
"""Grid steps of the longest range."""

NO_END = -2
"""Result for a cell whose expansion does not end, because it lies in a wall."""
MOST_STEPS = 64
"""Triangles entered, per triangle of the mesh, after which a cell is given up."""

HALF = 31
HALF_MASK = (1 << HALF) - 1
THIRD = 29
THIRD_MASK = (1 << THIRD) - 1


def turn(px: int, py: int, qx: int, qy: int, rx: int, ry: int) -> int:
    """Twice the signed area of p, q, r: positive when r is left of p -> q; within 2 · 2**30 · 2**30."""
    return (qx - px) * (ry - py) - (qy - py) * (rx - px)


def between(px: int, py: int, rx: int, ry: int, qx: int, qy: int, lx: int, ly: int) -> bool:
    """True if the ray from p to q lies strictly between those to r and, less than a half turn on, to l."""
    return turn(px, py, rx, ry, qx, qy) > 0 and turn(px, py, qx, qy, lx, ly) > 0


def not_negative(at_a: Any, at_b: Any, odd: Any, pieces: Any) -> Any:
    """True if the linear function that is `at_a` at a and `at_b` at b is >= 0 at the fraction odd / pieces.

    For numbers as for arrays. Both are turns, each of a high part within 2**30 and a low part below 2**31:
    times `pieces`, within 2**57 and 2**58.
    """
    rest = pieces - odd
    low = rest * (at_a & HALF_MASK) + odd * (at_b & HALF_MASK)
    return rest * (at_a >> HALF) + odd * (at_b >> HALF) + (low >> HALF) >= 0


def within_reach(ax: int, ay: int, bx: int, by: int, odd: int, pieces: int, reach: int) -> bool:
    """True if the point at the fraction odd / pieces of the line from a to b is at most `reach` from 0, 0.

    Times `pieces`, it is within 2**57 and the range within 2**58: squared as high part, within 2**29, and
    low part, below 2**29, every sum of products is within 2**61.
    """
    x, y = (pieces - odd) * ax + odd * bx, (pieces - odd) * ay + odd * by
    far = pieces * reach
    x_high, y_high, far_high = x >> THIRD, y >> THIRD, far >> THIRD
    x_low, y_low, far_low = x & THIRD_MASK, y & THIRD_MASK, far & THIRD_MASK
    low = x_low * x_low + y_low * y_low - far_low * far_low
    middle = 2 * (x_high * x_low + y_high * y_low - far_high * far_low) + (low >> THIRD)
    high = x_high * x_high + y_high * y_high - far_high * far_high + (middle >> THIRD)
    return high < 0 or (high == 0 and middle & THIRD_MASK == 0 and low & THIRD_MASK == 0)


def first_not_negative(at_a: int, at_b: int, units: int, low: int) -> int:
    """First unit >= low whose midpoint has a value >= 0 of a rising linear function; `units` if none."""
    pieces = 2 * units
    guess = (-float(pieces) * float(at_a) / float(at_b - at_a) - 1.0) / 2.0
    unit = low if guess < low else (units if guess > units else int(guess))
    while unit > low and not_negative(at_a, at_b, 2 * unit - 1, pieces):
        unit -= 1
    while unit < units and not not_negative(at_a, at_b, 2 * unit + 1, pieces):
        unit += 1
    return unit


def last_not_negative(at_a: int, at_b: int, units: int, high: int) -> int:
    """Last unit <= high whose midpoint has a value >= 0 of a falling linear function; -1 if none."""
    pieces = 2 * units
    guess = (-float(pieces) * float(at_a) / float(at_b - at_a) - 1.0) / 2.0
    unit = high if guess > high else (-1 if guess < -1 else int(guess))
    while unit < high and not_negative(at_a, at_b, 2 * unit + 3, pieces):
        unit += 1
    while unit >= 0 and not not_negative(at_a, at_b, 2 * unit + 1, pieces):
        unit -= 1
    return unit


def clip_side(at_a: int, at_b: int, units: int, low: int, high: int) -> tuple[int, int]:
    """Units low..high whose midpoints have a value >= 0 of a linear function given at both ends."""
    if at_a == at_b:
        if at_a < 0:
            return 0, -1
        return low, high
    if at_b > at_a:
        return first_not_negative(at_a, at_b, units, low), high
    return low, last_not_negative(at_a, at_b, units, high)


def clip_reach(
    ax: int, ay: int, bx: int, by: int, units: int, reach: int, low: int, high: int
) -> tuple[int, int]:
    """Units low..high whose midpoints are within reach of 0, 0."""
    if high < low:
        return low, high
    wx, wy = float(bx - ax), float(by - ay)
    ww = wx * wx + wy * wy
    pieces = 2 * units
    nearest = low
    if ww > 0.0:
        foot = (-(float(ax) * wx + float(ay) * wy) / ww * pieces - 1.0) / 2.0
        nearest = low if foot < low else (high if foot > high else int(foot + 0.5))
        nearest = min(max(nearest, low), high)
    if not within_reach(ax, ay, bx, by, 2 * nearest + 1, pieces, reach):
        better = nearest
        for other in range(nearest - 1, nearest + 2, 2):
            if low <= other <= high and within_reach(ax, ay, bx, by, 2 * other + 1, pieces, reach):
                better = other
        if better == nearest:
            return 0, -1
        nearest = better
    below, above = low - 1, nearest
    while above - below > 1:
        middle = (above + below) // 2
        if within_reach(ax, ay, bx, by, 2 * middle + 1, pieces, reach):
            above = middle
        else:
            below = middle
    first = above
    below, above = nearest, high + 1
    while above - below > 1:
        middle = (above + below) // 2
        if within_reach(ax, ay, bx, by, 2 * middle + 1, pieces, reach):
            below = middle
        else:
            above = middle
    return first, below


def edge_too_far(
    qx: int, qy: int, ax: int, ay: int, bx: int, by: int, rx: int, ry: int, lx: int, ly: int, reach: int
) -> bool:
    """True if the part of edge a-b between the rays through r and l is surely beyond reach."""
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
    start_right: Any,
    start_left: Any,
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
    """Write the runs of units that viewpoint `row` sees from index `begin` on; return the end of the output.

    Returns -1 if the output may have too little room. The module explains the arrays and the stack.

    Parameters
    ----------
    qx, qy
        Viewpoints. `start_pointer[row]` to `start_pointer[row + 1]` index the triangles that contain one,
        and the vertices right and left of its view, less than a half turn apart; or -1 for all round.
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
        stack[top], stack[top + 1] = start_triangle[s], -1
        stack[top + 2], stack[top + 3] = start_right[s], start_left[s]
        top += 4
    while top > 0:
        top -= 4
        triangle, entry = stack[top], stack[top + 1]
        right, left = stack[top + 2], stack[top + 3]
        for item in range(bucket_pointer[triangle], bucket_pointer[triangle + 1]):
            segment = bucket_segment[item]
            low, high = bucket_low[item], bucket_high[item]
            n = units[segment]
            if right >= 0:
                at_a = turn(x, y, vx[right], vy[right], ax[segment], ay[segment])
                at_b = turn(x, y, vx[right], vy[right], bx[segment], by[segment])
                low, high = clip_side(at_a, at_b, n, low, high)
                at_a = turn(x, y, ax[segment], ay[segment], vx[left], vy[left])
                at_b = turn(x, y, bx[segment], by[segment], vx[left], vy[left])
                low, high = clip_side(at_a, at_b, n, low, high)
            if reach >= 0:
                low, high = clip_reach(
                    ax[segment] - x, ay[segment] - y, bx[segment] - x, by[segment] - y, n, reach, low, high
                )
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
                if right >= 0:
                    if not between(x, y, vx[right], vy[right], vx[a], vy[a], vx[left], vy[left]):
                        to_right = turn(x, y, vx[a], vy[a], vx[right], vy[right])
                        if to_right < 0 or turn(x, y, vx[right], vy[right], vx[b], vy[b]) <= 0:
                            continue
                        new_right = right
                    if not between(x, y, vx[right], vy[right], vx[b], vy[b], vx[left], vy[left]):
                        new_left = left
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
                low, high = clip_reach(vx[a] - x, vy[a] - y, vx[b] - x, vy[b] - y, n, reach, low, high)
            if low <= high:
                if count >= size:
                    return -1
                out_segment[count], out_low[count], out_high[count] = segment, low, high
                count += 1
    return count


def look_all(
    first_row: int,
    pointer: Any,
    qx: Any,
    qy: Any,
    start_pointer: Any,
    start_triangle: Any,
    start_right: Any,
    start_left: Any,
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
    """Process every viewpoint from `first_row` on; return the first row that found no room left.

    `pointer[row + 1]` becomes the end of the output of each row; the other arguments are those of `look`.
    """
    row = first_row
    while row < len(qx):
        end = look(
            row,
            pointer[row],
            qx,
            qy,
            start_pointer,
            start_triangle,
            start_right,
            start_left,
            vx,
            vy,
            corner,
            neighbour,
            face,
            bucket_pointer,
            bucket_segment,
            bucket_low,
            bucket_high,
            ax,
            ay,
            bx,
            by,
            units,
            reach,
            stack,
            out_segment,
            out_low,
            out_high,
        )
        if end < 0:
            return row
        pointer[row + 1] = end
        row += 1
    return row


def most_turn(x0: int, y0: int, x1: int, y1: int, rx: int, ry: int, px: int, py: int) -> int:
    """The largest turn c, r, p over the positions c of a rectangle, which is at one of its corners."""
    cx = x0 if py > ry else x1
    cy = y1 if px > rx else y0
    return (rx - cx) * (py - cy) - (ry - cy) * (px - cx)


def part_too_far(
    x: int, y: int, ax: int, ay: int, bx: int, by: int, ra: int, rb: int, la: int, lb: int, reach: int
) -> bool:
    """True if the part of edge a-b where two linear functions are not negative is beyond reach of x, y."""
    from_t, to_t = 0.0, 1.0
    if ra < 0 < rb:
        from_t = float(ra) / (float(ra) - float(rb))
    elif rb < 0 < ra:
        to_t = float(ra) / (float(ra) - float(rb))
    if la < 0 < lb:
        from_t = max(from_t, float(la) / (float(la) - float(lb)))
    elif lb < 0 < la:
        to_t = min(to_t, float(la) / (float(la) - float(lb)))
    wx, wy = float(bx - ax), float(by - ay)
    foot = (float(x - ax) * wx + float(y - ay) * wy) / (wx * wx + wy * wy)
    t = min(max(foot, from_t), to_t)
    dx, dy = float(ax - x) + t * wx, float(ay - y) + t * wy
    limit = float(reach) * 1.000001 + 4.0
    return dx * dx + dy * dy > limit * limit


def look_from_cell(
    row: int,
    begin: int,
    cells: Any,
    wide: Any,
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
    """Write the runs of units that cell `row` may see from index `begin` on; return the end of the output.

    Returns -1 if the output may have too little room, and NO_END if the expansion does not end.
    `cells` are the rectangles' x0, y0, x1, y1 one after the other, `wide` the distance from the centre to a
    corner, rounded up. The other arguments are those of `look`.
    """
    x0, y0, x1, y1 = cells[4 * row], cells[4 * row + 1], cells[4 * row + 2], cells[4 * row + 3]
    x, y = (x0 + x1) // 2, (y0 + y1) // 2
    far = reach + wide[row]
    size, room = len(out_segment), len(stack)
    most = MOST_STEPS * (len(corner) // 3) + 1000
    count = begin
    top = 0
    for s in range(start_pointer[row], start_pointer[row + 1]):
        stack[top], stack[top + 1], stack[top + 2], stack[top + 3] = start_triangle[s], -1, -1, -1
        top += 4
    while top > 0:
        most -= 1
        if most < 0 or top + 16 > room:
            return NO_END
        top -= 4
        triangle, entry = stack[top], stack[top + 1]
        right, left = stack[top + 2], stack[top + 3]
        for item in range(bucket_pointer[triangle], bucket_pointer[triangle + 1]):
            segment = bucket_segment[item]
            low, high = bucket_low[item], bucket_high[item]
            n = units[segment]
            if right >= 0:
                at_a = most_turn(x0, y0, x1, y1, vx[right], vy[right], ax[segment], ay[segment])
                at_b = most_turn(x0, y0, x1, y1, vx[right], vy[right], bx[segment], by[segment])
                low, high = clip_side(at_a, at_b, n, low, high)
                at_a = most_turn(x0, y0, x1, y1, ax[segment], ay[segment], vx[left], vy[left])
                at_b = most_turn(x0, y0, x1, y1, bx[segment], by[segment], vx[left], vy[left])
                low, high = clip_side(at_a, at_b, n, low, high)
            low, high = clip_reach(
                ax[segment] - x, ay[segment] - y, bx[segment] - x, by[segment] - y, n, far, low, high
            )
            if low <= high:
                if count >= size:
                    return -1
                out_segment[count], out_low[count], out_high[count] = segment, low, high
                count += 1
        for k in range(3):
            if k == entry:
                continue
            a, b = corner[3 * triangle + k], corner[3 * triangle + (k + 1) % 3]
            if most_turn(x0, y0, x1, y1, vx[a], vy[a], vx[b], vy[b]) <= 0:
                continue
            new_right, new_left = right, left
            ra, rb, la, lb = 1, 1, 1, 1
            if right >= 0:
                ra = most_turn(x0, y0, x1, y1, vx[right], vy[right], vx[a], vy[a])
                rb = most_turn(x0, y0, x1, y1, vx[right], vy[right], vx[b], vy[b])
                la = most_turn(x0, y0, x1, y1, vx[a], vy[a], vx[left], vy[left])
                lb = most_turn(x0, y0, x1, y1, vx[b], vy[b], vx[left], vy[left])
                if (ra <= 0 and rb <= 0 and right != a) or (la <= 0 and lb <= 0 and left != b):
                    continue
                if turn(x, y, vx[right], vy[right], vx[a], vy[a]) > 0:
                    new_right = a
                if turn(x, y, vx[b], vy[b], vx[left], vy[left]) > 0:
                    new_left = b
            else:
                new_right, new_left = a, b
            if most_turn(x0, y0, x1, y1, vx[new_right], vy[new_right], vx[new_left], vy[new_left]) <= 0:
                continue
            beyond = neighbour[3 * triangle + k]
            if beyond >= 0:
                if part_too_far(x, y, vx[a], vy[a], vx[b], vy[b], ra, rb, la, lb, far):
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
            if right >= 0:
                low, high = clip_side(ra, rb, n, low, high)
                low, high = clip_side(la, lb, n, low, high)
            low, high = clip_reach(vx[a] - x, vy[a] - y, vx[b] - x, vy[b] - y, n, far, low, high)
            if low <= high:
                if count >= size:
                    return -1
                out_segment[count], out_low[count], out_high[count] = segment, low, high
                count += 1
    return count


def look_from_all_cells(
    first_row: int,
    pointer: Any,
    cells: Any,
    wide: Any,
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
    """Process every cell from `first_row` on; return the first row without room or without an end.

    `pointer[row + 1]` becomes the end of the output of each row. A row without an end is returned as
    -1 - row.
    """
    row = first_row
    while row < len(wide):
        end = look_from_cell(
            row,
            pointer[row],
            cells,
            wide,
            start_pointer,
            start_triangle,
            vx,
            vy,
            corner,
            neighbour,
            face,
            bucket_pointer,
            bucket_segment,
            bucket_low,
            bucket_high,
            ax,
            ay,
            bx,
            by,
            units,
            reach,
            stack,
            out_segment,
            out_low,
            out_high,
        )
        if end == NO_END:
            return -1 - row
        if end < 0:
            return row
        pointer[row + 1] = end
        row += 1
    return row
