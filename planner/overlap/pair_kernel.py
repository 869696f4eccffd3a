"""Pairs of rows that see enough boundary in common, and are held by it in every direction.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
`pair_kernel_compiled.pxd`. The whole numbers are indices of rows, surfaces, faces and stretches, far below
2**62.

Data
----
- `pointer`, `surface`, `begin`, `end`: row r shows the stretches `pointer[r]` to `pointer[r + 1] - 1`, each
  of a surface, from `begin` to `end` metres from the surface's start.
- `shown_first`, `row_on`, `begin_on`, `end_on`: the same stretches by surfaces: those of surface s are
  `shown_first[s]` to `shown_first[s + 1] - 1`, by ascending rows.
- `faces`, `around`, `along`: surface s has the faces `faces[s]` to `faces[s + 1] - 1`. If it is closed, it is
  `around[s]` metres around, else that is 0. Face f begins `along[f]` metres from its surface's start.
- `normal_x`, `normal_y`, `arm`: of each face the normal, and the lever arm of its start about the origin.
- `xy`: position of each row, x and y in turn.
- Scratch: `common` (rows,) and `moments` (6 * rows,), all 0 before and after; `touched` (rows,).
"""

from __future__ import annotations

from typing import Any


def firm_pairs(
    low: int, high: int, edge: float, least_stretch: float, least: float, hold: float, lever: float,
    pointer: Any, surface: Any, begin: Any, end: Any, shown_first: Any, row_on: Any, begin_on: Any,
    end_on: Any, faces: Any, around: Any, along: Any, normal_x: Any, normal_y: Any, arm: Any,
    xy: Any, common: Any, moments: Any, touched: Any, out_row: Any, out_other: Any, out_common: Any,
) -> int:  # fmt: skip
    """Pair the rows from `low` to below `high` with all later rows; return the number of pairs.

    Pairs with at least `least` metres in common and a registration strength above `hold`, from either row,
    are written to the outputs, those of a row in any order.
    """
    found = 0
    for row in range(low, high):
        count = 0
        for own in range(pointer[row], pointer[row + 1]):
            count = add_stretch(
                own, row, count, edge, least_stretch, surface, begin, end, shown_first, row_on, begin_on,
                end_on, faces, around, along, normal_x, normal_y, arm, common, moments, touched,
            )  # fmt: skip
        for k in range(count):
            other = touched[k]
            if (
                common[other] >= least
                and holds(moments, 6 * other, xy[2 * row], xy[2 * row + 1], hold, lever)
                and holds(moments, 6 * other, xy[2 * other], xy[2 * other + 1], hold, lever)
            ):
                out_row[found] = row
                out_other[found] = other
                out_common[found] = common[other]
                found += 1
            common[other] = 0.0
            for entry in range(6 * other, 6 * other + 6):
                moments[entry] = 0.0
    return found


def add_stretch(
    own: int, row: int, count: int, edge: float, least_stretch: float, surface: Any, begin: Any, end: Any,
    shown_first: Any, row_on: Any, begin_on: Any, end_on: Any, faces: Any, around: Any, along: Any,
    normal_x: Any, normal_y: Any, arm: Any, common: Any, moments: Any, touched: Any,
) -> int:  # fmt: skip
    """Add what later rows see of a stretch; return the number of rows `touched` so far."""
    of = surface[own]
    first, last = shown_first[of], shown_first[of + 1]
    while first < last:  # the first stretch of a later row, by bisection
        middle = (first + last) >> 1
        if row_on[middle] <= row:
            first = middle + 1
        else:
            last = middle
    lap, low, high = around[of], begin[own], end[own]
    for place in range(first, shown_first[of + 1]):
        ahead = -lap  # on a closed surface also one way around before, and after
        while ahead <= lap:
            a, b = max(low, begin_on[place] + ahead), min(high, end_on[place] + ahead)
            if b - a > least_stretch:
                other = row_on[place]
                if common[other] == 0.0:
                    touched[count] = other
                    count += 1
                common[other] += b - a
                add_common(
                    6 * other, a + edge, b - edge, lap, faces[of], faces[of + 1], along, normal_x,
                    normal_y, arm, moments,
                )  # fmt: skip
            if lap == 0.0:
                break
            ahead += lap
    return count


def add_common(
    at: int, a: float, b: float, lap: float, first: int, last: int, along: Any, normal_x: Any,
    normal_y: Any, arm: Any, moments: Any,
) -> None:  # fmt: skip
    """Add the normal matrix of a stretch, which may go on beyond the start of a closed surface."""
    if lap > 0.0 and b > lap:
        add_faces(at, max(a - lap, 0.0), b - lap, first, last, along, normal_x, normal_y, arm, moments)
        b = lap
    if a < b:
        add_faces(at, a, b, first, last, along, normal_x, normal_y, arm, moments)


def add_faces(
    at: int, a: float, b: float, first: int, last: int, along: Any, normal_x: Any, normal_y: Any, arm: Any,
    moments: Any,
) -> None:  # fmt: skip
    """Add the normal matrix of a stretch of the surface of the faces from `first` to below `last`."""
    high = last
    while high - first > 1:  # the face in which the stretch begins, by bisection
        middle = (first + high) >> 1
        if along[middle] <= a:
            first = middle
        else:
            high = middle
    while first < last - 1 and along[first + 1] < b:
        a, length = a - along[first], along[first + 1] - along[first]
        add_moments(at, a, length, normal_x[first], normal_y[first], arm[first], moments)
        first += 1
        a = along[first]
    a, b = a - along[first], b - along[first]
    add_moments(at, a, b, normal_x[first], normal_y[first], arm[first], moments)


def add_moments(at: int, a: float, b: float, x: float, y: float, arm: float, moments: Any) -> None:
    """Add the normal matrix of a stretch of a face from a to b, about the origin and without the lever."""
    s1, s2, s3 = b - a, (b * b - a * a) / 2, (b * b * b - a * a * a) / 3
    turn = arm * s1 + s2
    moments[at] += x * x * s1
    moments[at + 1] += x * y * s1
    moments[at + 2] += y * y * s1
    moments[at + 3] += x * turn
    moments[at + 4] += y * turn
    moments[at + 5] += arm * arm * s1 + 2 * arm * s2 + s3


def holds(moments: Any, at: int, x: float, y: float, hold: float, lever: float) -> bool:
    """Return True if the least eigenvalue of a normal matrix about the point x, y is above `hold`.

    A rotation counts as the displacement that it makes at the distance `lever`. The matrix less `hold` on its
    diagonal is eliminated by Gauss's method: all eigenvalues are positive if all pivots are (Sylvester).
    """
    xx, xy, yy = moments[at], moments[at + 1], moments[at + 2]
    xt = xx * y - xy * x + moments[at + 3]
    yt = xy * y - yy * x + moments[at + 4]
    tt = y * xt - x * yt + moments[at + 3] * y - moments[at + 4] * x + moments[at + 5]
    xt, yt, tt = xt / lever, yt / lever, tt / (lever * lever) - hold
    xx, yy = xx - hold, yy - hold
    if xx <= 0.0:
        return False
    yy, yt, tt = yy - xy * xy / xx, yt - xy * xt / xx, tt - xt * xt / xx
    return yy > 0.0 and tt - yt * yt / yy > 0.0
