"""Pairs of rows that see enough boundary in common, and are held by it in every direction.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
`pair_kernel_compiled.pxd`. The whole numbers are indices of rows, surfaces, faces and stretches, far below
2**62.

Data
----
- `pointer`, `place`, `surface`: row r shows the stretches `pointer[r]` to `pointer[r + 1] - 1`. Each has its
  place among the stretches by surfaces, and its surface.
- `shown_first`, `row_on`, `begin_on`, `end_on`: the stretches by surfaces: those of surface s are
  `shown_first[s]` to `shown_first[s + 1] - 1`, by ascending rows. Each is of a row, and reaches from
  `begin_on` to `end_on` metres from the surface's start.
- `faces`, `around`, `along`: surface s has the faces `faces[s]` to `faces[s + 1] - 1`. If it is closed, it is
  `around[s]` metres around, else that is 0. Face f begins `along[f]` metres from its surface's start.
- `normal_x`, `normal_y`, `arm`: of each face the normal, and the lever arm of its start about the origin.
- `sums`: normal matrices of all that lies before both ends of each place, less the edges (12 * places,).
- `sums_around`: the normal matrix of each closed surface (6 * surfaces,).
- `xy`: position of each row, x and y in turn.
- Scratch: `common` (rows,) and `moments` (6 * rows,), all 0 before and after; `touched` (rows,).
"""

from __future__ import annotations

from typing import Any


def sum_up(
    edge: float, shown_first: Any, begin_on: Any, end_on: Any, faces: Any, around: Any, along: Any,
    normal_x: Any, normal_y: Any, arm: Any, sums_before: Any, sums: Any, sums_around: Any,
) -> None:  # fmt: skip
    """Fill `sums` and `sums_around`, all 0 before.

    `sums_before` receives the normal matrix of what lies before each face on its surface (6 * faces,).
    """
    for of in range(len(around)):
        first, last = faces[of], faces[of + 1] - 1
        for face in range(first, last):
            for entry in range(6):
                sums_before[6 * face + 6 + entry] = sums_before[6 * face + entry]
            add_moments(
                6 * face + 6, 0.0, along[face + 1] - along[face], normal_x[face], normal_y[face], arm[face],
                sums_before,
            )  # fmt: skip
        if around[of] > 0.0:
            add_before(
                6 * of, around[of], first, last, along, normal_x, normal_y, arm, sums_before, sums_around,
            )  # fmt: skip
        for k in range(2 * shown_first[of], 2 * shown_first[of + 1]):
            at = begin_on[k >> 1] + edge if k & 1 == 0 else end_on[k >> 1] - edge
            if around[of] > 0.0 and at > around[of]:
                at -= around[of]
                for entry in range(6):
                    sums[6 * k + entry] = sums_around[6 * of + entry]
            add_before(6 * k, at, first, last, along, normal_x, normal_y, arm, sums_before, sums)


def add_before(
    to: int, at: float, first: int, last: int, along: Any, normal_x: Any, normal_y: Any, arm: Any,
    sums_before: Any, sums: Any,
) -> None:  # fmt: skip
    """Add the normal matrix of what lies before a place on the surface of faces `first` to `last`."""
    while first < last:  # the face of the place, by bisection
        middle = (first + last + 1) >> 1
        if along[middle] <= at:
            first = middle
        else:
            last = middle - 1
    for entry in range(6):
        sums[to + entry] += sums_before[6 * first + entry]
    add_moments(to, 0.0, at - along[first], normal_x[first], normal_y[first], arm[first], sums)


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


def firm_pairs(
    low: int, high: int, least_stretch: float, least: float, hold: float, lever: float, pointer: Any,
    place: Any, surface: Any, shown_first: Any, row_on: Any, begin_on: Any, end_on: Any, around: Any,
    sums: Any, sums_around: Any, xy: Any, common: Any, moments: Any, touched: Any, out_row: Any,
    out_other: Any, out_common: Any,
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
                place[own], shown_first[surface[own] + 1], count, least_stretch, around[surface[own]],
                6 * surface[own], row_on, begin_on, end_on, sums, sums_around, common, moments, touched,
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
    own: int, last: int, count: int, least_stretch: float, lap: float, turn: int, row_on: Any, begin_on: Any,
    end_on: Any, sums: Any, sums_around: Any, common: Any, moments: Any, touched: Any,
) -> int:  # fmt: skip
    """Add what later rows, from the place `own` to below `last`, see of a stretch.

    Return the number of rows `touched` so far.
    """
    low, high = begin_on[own], end_on[own]
    most = 1 if 0.0 < lap < high else 0
    for place in range(own + 1, last):
        other = row_on[place]
        if other == row_on[own]:
            continue
        least = -1 if 0.0 < lap < end_on[place] else 0
        for laps in range(least, most + 1):  # ways around a closed surface by which the other is ahead
            ahead = laps * lap
            a, b = begin_on[place] + ahead, end_on[place] + ahead
            first, end, added = 12 * place, 12 * place + 6, 0
            if low >= a:
                a, first, added = low, 12 * own, laps
            if high <= b:
                b, end, added = high, 12 * own + 6, added - laps
            if b - a > least_stretch:
                if common[other] == 0.0:
                    touched[count] = other
                    count += 1
                common[other] += b - a
                add_common(6 * other, first, end, added, turn, sums, sums_around, moments)
    return count


def add_common(
    at: int, first: int, end: int, added: int, turn: int, sums: Any, sums_around: Any, moments: Any
) -> None:  # fmt: skip
    """Add the normal matrix of what lies between two of the `sums`, and `added` times the way around."""
    for entry in range(6):
        moments[at + entry] += sums[end + entry] - sums[first + entry]
    if added != 0:
        for entry in range(6):
            moments[at + entry] += added * sums_around[turn + entry]


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
