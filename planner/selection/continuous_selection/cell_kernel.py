"""Triangular expansion from a rectangle: all units that any position in a cell may see.

It works like `stopgo.planner.visibility.sight.kernel`, which has the bounds of the numbers, but from all
positions of a cell at once. A line of sight from a position c that passes a corner R on its right meets
points p with turn(c, R, p) >= 0. So the cell may see p only if the largest of these turns over the cell is
not negative. That maximum is at a corner of the cell.
Each limit is tested by itself: a unit found may be visible from no position, but no visible unit is left
out. As a cell becomes small, the surplus vanishes.
"""

from __future__ import annotations

from typing import Any

from stopgo.planner.visibility.sight import kernel

turn, clip_side, clip_reach = kernel.turn, kernel.clip_side, kernel.clip_reach

NO_END = -2
"""Result for a cell whose expansion does not end, because it lies in a wall."""
MOST_STEPS = 64
"""Triangles entered, per triangle of the mesh, after which a cell is given up."""


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
    corner, rounded up. The other arguments are those of `stopgo.planner.visibility.sight.kernel.look`.
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


def look_from_all_cells(first_row: int, pointer: Any, cells: Any, wide: Any, *scene_and_output: Any) -> int:
    """Process every cell from `first_row` on; return the first row without room or without an end.

    `pointer[row + 1]` becomes the end of the output of each row. A row without an end is returned as
    -1 - row.
    """
    row = first_row
    while row < len(wide):
        end = look_from_cell(row, pointer[row], cells, wide, *scene_and_output)
        if end == NO_END:
            return -1 - row
        if end < 0:
            return row
        pointer[row + 1] = end
        row += 1
    return row
