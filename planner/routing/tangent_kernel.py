"""Straight pieces of shortest paths: triangular expansion from nodes past the corners at which paths bend.

The functions are plain functions over lists or arrays of whole numbers, compiled with the types of
`tangent_kernel_compiled.pxd`. The expansion is that of `stopgo.planner.visibility.sight.kernel`, without
range and faces.

Data, for t triangles, in flat arrays
-------------------------------------
- Mesh: triangle i has corners `corner[3 * i + k]`, k = 0, 1, 2, counter-clockwise. `neighbour[3 * i + k]` is
  the triangle across the edge from corner k to corner k + 1, or -1. `vx`, `vy` are the vertices, and after
  them the points that limit views. `node[v]` is the node at vertex v, or -1.
- Sides: from vertex v to the previous corner of its ring (`back_x[v]`, `back_y[v]`), and to the next.
- Nodes: at `at_x`, `at_y`, in the triangles `start[start_first[n]]` to `start[start_first[n + 1] - 1]`.
  Triangle i contains nodes off the vertices: `item[item_first[i]]` to `item[item_first[i + 1] - 1]`.
- Views: the node `viewer[row]` looks from the vertex `start_right[row]` to `start_left[row]`, less than a
  half turn; or all round (-1).
- `stack`: four numbers per triangle to enter: triangle, edge of entry (-1 at the start), and the vertices
  right and left of what is seen (-1 at the start if that is everything).

Coordinates lie within 2**29, so differences within 2**30 and turns within 2**61. What a view is limited by
lies within 2**30 of it.
"""

from __future__ import annotations

from typing import Any

SURELY = 2e11
"""Product of two turns, in grid steps to the fourth: twice `roadmap.TOUCH`."""


def turn(px: int, py: int, qx: int, qy: int, rx: int, ry: int) -> int:
    """Twice the signed area of p, q, r: positive when r is left of p -> q."""
    return (qx - px) * (ry - py) - (qy - py) * (rx - px)


def cuts(along_x: int, along_y: int, back_x: int, back_y: int, on_x: int, on_y: int) -> bool:
    """True if a line surely passes between the sides of a corner, so that a shorter path cuts the corner.

    The line may be wrong by half a step at its begin, which is not on the grid.
    """
    to_back = along_x * back_y - along_y * back_x
    to_on = along_x * on_y - along_y * on_x
    if (to_back > 0) == (to_on > 0):
        return False
    one = float(abs(to_back) - abs(back_x) - abs(back_y))
    other = float(abs(to_on) - abs(on_x) - abs(on_y))
    return one > 0.0 and other > 0.0 and one * other > SURELY


def pieces(
    first_row: int, all_round: int, viewer: Any, at_x: Any, at_y: Any, start_first: Any, start: Any,
    start_right: Any, start_left: Any, vx: Any, vy: Any, corner: Any, neighbour: Any, node: Any, back_x: Any,
    back_y: Any, on_x: Any, on_y: Any, item_first: Any, item: Any, pointer: Any, stack: Any, out: Any,
) -> int:  # fmt: skip
    """Write the nodes to which pieces may lead from each viewpoint; return the first row without room.

    The first `all_round` rows also find the nodes off the vertices. `pointer[row + 1]` becomes the end of
    each row's nodes in `out`; a node may be there several times.
    """
    for row in range(first_row, len(viewer)):
        here = viewer[row]
        x, y = at_x[here], at_y[here]
        count, top = pointer[row], 0
        for s in range(start_first[here], start_first[here + 1]):
            stack[top], stack[top + 1] = start[s], -1
            stack[top + 2], stack[top + 3] = start_right[row], start_left[row]
            top += 4
        while top > 0:
            top -= 4
            triangle, entry = stack[top], stack[top + 1]
            right, left = stack[top + 2], stack[top + 3]
            many = item_first[triangle + 1] - item_first[triangle] if row < all_round else 0
            if count + many + 3 > len(out):
                return row
            for k in range(item_first[triangle], item_first[triangle] + many):
                there = item[k]
                if right < 0 or (
                    turn(x, y, vx[right], vy[right], at_x[there], at_y[there]) >= 0
                    and turn(x, y, at_x[there], at_y[there], vx[left], vy[left]) >= 0
                ):
                    out[count] = there
                    count += 1
            if entry < 0:
                for k in range(3):
                    a = corner[3 * triangle + k]
                    seen = right < 0 or (
                        turn(x, y, vx[right], vy[right], vx[a], vy[a]) >= 0
                        and turn(x, y, vx[a], vy[a], vx[left], vy[left]) >= 0
                    )
                    if (
                        seen
                        and node[a] >= 0
                        and not cuts(vx[a] - x, vy[a] - y, back_x[a], back_y[a], on_x[a], on_y[a])
                    ):
                        out[count] = node[a]
                        count += 1
                for k in range(3):
                    a, b = corner[3 * triangle + k], corner[3 * triangle + (k + 1) % 3]
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
                    top = enter(neighbour[3 * triangle + k], b, new_right, new_left, top, corner, stack)
                continue
            k = entry + 2 if entry == 0 else entry - 1
            a, b = corner[3 * triangle + k], corner[3 * triangle + entry]
            to_right = turn(x, y, vx[right], vy[right], vx[a], vy[a])
            to_left = turn(x, y, vx[a], vy[a], vx[left], vy[left])
            if (
                to_right >= 0
                and to_left >= 0
                and node[a] >= 0
                and not cuts(vx[a] - x, vy[a] - y, back_x[a], back_y[a], on_x[a], on_y[a])
            ):
                out[count] = node[a]
                count += 1
            if to_right <= 0 or to_left > 0:
                new_right = a if to_right > 0 else right
                top = enter(neighbour[3 * triangle + k], b, new_right, left, top, corner, stack)
            if to_left <= 0 or to_right > 0:
                new_left = a if to_left > 0 else left
                k = k + 2 if k == 0 else k - 1
                top = enter(neighbour[3 * triangle + k], a, right, new_left, top, corner, stack)
        pointer[row + 1] = count
    return len(viewer)


def between(px: int, py: int, rx: int, ry: int, qx: int, qy: int, lx: int, ly: int) -> bool:
    """True if the ray from p to q lies strictly between those to r and, less than a half turn on, to l."""
    return turn(px, py, rx, ry, qx, qy) > 0 and turn(px, py, qx, qy, lx, ly) > 0


def enter(beyond: int, first: int, right: int, left: int, top: int, corner: Any, stack: Any) -> int:
    """Put a triangle on the stack, unless there is none; `first` begins its edge of entry; return the top."""
    if beyond < 0:
        return top
    back = 0
    while corner[3 * beyond + back] != first:
        back += 1
    stack[top], stack[top + 1], stack[top + 2], stack[top + 3] = beyond, back, right, left
    return top + 4
