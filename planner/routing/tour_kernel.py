"""The tour search's moves: 2-opt and Or-opt over neighbour lists, every move made of reversals.

Plain functions over lists or arrays of whole numbers, so that the same source runs interpreted and
compiled with the same result. `cost` is the symmetric matrix, `near` the lists of each point's nearest
points, both flat; `order` is the tour, `place` where each point stands in it. No number exceeds 64
bits: the longest edge times the number of points is below 2**62 (`stopgo.planner.routing.tour.nanometres`
refuses more), and neither a tour nor what a trial gains or loses is more than that.

Sources: Bentley, "Fast algorithms for geometric traveling salesman problems", ORSA J. Computing 1992
(neighbour lists, don't-look bits, here as a queue of the points to look at); Johnson and McGeoch, "The
traveling salesman problem: a case study in local optimization", 1997 (iterated search by local double
bridges); Kirkpatrick, Gelatt, Vecchi, Science 1983 (losses allowed, less and less).
"""

from __future__ import annotations

from typing import Any

LONGEST_SEGMENT = 3
"""Points moved together by Or-opt."""
MOVE_REVERSALS = 3
"""Reversals that one move may need."""


def iterated_search(
    cost: Any,
    near: Any,
    order: Any,
    place: Any,
    trials: Any,
    best: Any,
    queue: Any,
    waiting: Any,
    journal: Any,
    state: Any,
) -> int:
    """Improve `order` in place, then after a local double bridge per row of `trials`; the gain of `best`.

    A trial touches the tour near its cut only, and is taken back by its journal if it loses more than it
    may, so that it costs hardly more on a long tour than on a short one.

    Parameters
    ----------
    trials
        Rows of place, points in the first stretch, points in the second, and what may be lost.
    best
        Receives the shortest tour met.
    queue, waiting, journal
        Scratch: a number per point, zero per point, two numbers per reversal that can be taken back.
    state
        Scratch of three zeros: head and length of the queue, reversals in the journal.
    """
    total = 0
    for point in range(len(order)):
        look_at(point, queue, waiting, state)
    while state[1] > 0:
        state[2] = 0
        total += improve(cost, near, order, place, queue, waiting, journal, state)
    most = total
    keep(order, best)
    for k in range(len(trials)):
        state[2] = 0
        gain = double_bridge(cost, order, place, trials[k], queue, waiting, journal, state)
        gain += improve(cost, near, order, place, queue, waiting, journal, state)
        if gain < -trials[k][3]:
            take_back(order, place, journal, state)
            continue
        total += gain
        if total > most:
            most = total
            keep(order, best)
    return most


def keep(order: Any, best: Any) -> None:
    """Copy a tour."""
    for k in range(len(order)):
        best[k] = order[k]


def look_at(point: int, queue: Any, waiting: Any, state: Any) -> None:
    """Put a point into the queue unless it waits there."""
    if waiting[point] == 0:
        waiting[point] = 1
        queue[(state[0] + state[1]) % len(queue)] = point
        state[1] += 1


def improve(
    cost: Any, near: Any, order: Any, place: Any, queue: Any, waiting: Any, journal: Any, state: Any
) -> int:
    """Make moves at the points of the queue until there is none, or the journal is full; the gain."""
    total = 0
    most = len(journal) // 2 - MOVE_REVERSALS
    while state[1] > 0 and state[2] <= most:
        point = queue[state[0]]
        state[0] = (state[0] + 1) % len(queue)
        state[1] -= 1
        waiting[point] = 0
        gain = two_opt(point, cost, near, order, place, queue, waiting, journal, state)
        if gain == 0:
            gain = or_opt(point, cost, near, order, place, queue, waiting, journal, state)
        if gain > 0:
            look_at(point, queue, waiting, state)
        total += gain
    return total


def two_opt(
    a: int, cost: Any, near: Any, order: Any, place: Any, queue: Any, waiting: Any, journal: Any, state: Any
) -> int:
    """Exchange an edge at `a` for one to a nearer point, if the tour gets shorter; the gain, else 0."""
    n = len(order)
    reach = len(near) // n
    for step in (1, -1):
        b = order[(place[a] + step) % n]
        ab = cost[a * n + b]
        for k in range(a * reach, a * reach + reach):
            c = near[k]
            ac = cost[a * n + c]
            if ac >= ab:
                break
            d = order[(place[c] + step) % n]
            gain = ab + cost[c * n + d] - ac - cost[b * n + d]
            if gain > 0:
                first, last = (b, c) if step > 0 else (c, b)
                reverse(place[first], place[last], order, place, journal, state)
                for point in (a, b, c, d):
                    look_at(point, queue, waiting, state)
                return gain
    return 0


def or_opt(
    a: int, cost: Any, near: Any, order: Any, place: Any, queue: Any, waiting: Any, journal: Any, state: Any
) -> int:
    """Move a stretch a..z next to a point near `a`, either way round, if shorter; the gain, else 0."""
    n = len(order)
    for step in (1, -1):
        before = order[(place[a] - step) % n]
        z = a
        for size in range(1, LONGEST_SEGMENT + 1):
            after = order[(place[z] + step) % n]
            saved = cost[before * n + a] + cost[z * n + after] - cost[before * n + after]
            c, d, gain = best_gap(a, z, size, step, saved, cost, near, order, place)
            if gain > 0:
                move(a, z, c, d, step, order, place, journal, state)
                for point in (before, after, a, z, c, d):
                    look_at(point, queue, waiting, state)
                return gain
            z = after
    return 0


def best_gap(
    a: int, z: int, size: int, step: int, saved: int, cost: Any, near: Any, order: Any, place: Any
) -> tuple[int, int, int]:
    """The first edge c-d with c near `a` between which a..z gains, and the gain; gain 0 if none."""
    n = len(order)
    reach = len(near) // n
    for k in range(a * reach, a * reach + reach):
        c = near[k]
        spare = saved - cost[a * n + c]
        if spare <= 0:
            break
        if ((place[c] - place[a]) * step) % n < size:
            continue
        for side in (1, -1):
            d = order[(place[c] + side) % n]
            gain = spare + cost[c * n + d] - cost[z * n + d]
            if gain > 0 and ((place[d] - place[a]) * step) % n >= size:
                return c, d, gain
    return a, a, 0


def move(a: int, z: int, c: int, d: int, step: int, order: Any, place: Any, journal: Any, state: Any) -> None:
    """Put the stretch a..z, which runs along `step`, between the neighbours c and d, `a` next to c."""
    n = len(order)
    first, last = (a, z) if step > 0 else (z, a)
    left, right = (c, d) if order[(place[c] + 1) % n] == d else (d, c)
    if (place[left] - place[last]) % n <= (place[first] - place[right]) % n:
        begin, end = order[(place[last] + 1) % n], left
        reverse(place[first], place[end], order, place, journal, state)
    else:
        begin, end = right, order[(place[first] - 1) % n]
        reverse(place[begin], place[last], order, place, journal, state)
    turn_between(begin, end, order, place, journal, state)
    if c not in (order[(place[a] + 1) % n], order[(place[a] - 1) % n]):
        turn_between(a, z, order, place, journal, state)


def double_bridge(
    cost: Any, order: Any, place: Any, cut: Any, queue: Any, waiting: Any, journal: Any, state: Any
) -> int:
    """Exchange the two stretches after a place of the tour; the gain, which is mostly negative."""
    n = len(order)
    p, a = order[cut[0] - 1], order[cut[0]]
    b, c = order[(cut[0] + cut[1] - 1) % n], order[(cut[0] + cut[1]) % n]
    d, q = order[(cut[0] + cut[1] + cut[2] - 1) % n], order[(cut[0] + cut[1] + cut[2]) % n]
    reverse(place[a], place[d], order, place, journal, state)
    turn_between(c, d, order, place, journal, state)
    turn_between(a, b, order, place, journal, state)
    for point in (p, a, b, c, d, q):
        look_at(point, queue, waiting, state)
    removed = cost[p * n + a] + cost[b * n + c] + cost[d * n + q]
    return int(removed - cost[p * n + c] - cost[d * n + a] - cost[b * n + q])


def turn_between(p: int, q: int, order: Any, place: Any, journal: Any, state: Any) -> None:
    """Reverse the shorter of the two stretches of the tour that end at p and q."""
    n = len(order)
    if (place[q] - place[p]) % n <= (place[p] - place[q]) % n:
        reverse(place[p], place[q], order, place, journal, state)
    else:
        reverse(place[q], place[p], order, place, journal, state)


def reverse(i: int, j: int, order: Any, place: Any, journal: Any, state: Any) -> None:
    """Reverse the tour from place i on to place j, and note it in the journal."""
    journal[2 * state[2]], journal[2 * state[2] + 1] = i, j
    state[2] += 1
    swap_ends(i, j, order, place)


def take_back(order: Any, place: Any, journal: Any, state: Any) -> None:
    """Undo what the journal holds, the last first: a reversal undoes itself."""
    while state[2] > 0:
        state[2] -= 1
        swap_ends(journal[2 * state[2]], journal[2 * state[2] + 1], order, place)


def swap_ends(i: int, j: int, order: Any, place: Any) -> None:
    """Reverse places i to j, or the rest of the tour instead where that is shorter: it is the same tour."""
    n = len(order)
    count = (j - i) % n + 1
    if 2 * count > n:
        i, j = (j + 1) % n, (i - 1) % n
        count = n - count
    for _ in range(count // 2):
        p, q = order[i], order[j]
        order[i], order[j] = q, p
        place[q], place[p] = i, j
        i = i + 1 if i + 1 < n else 0
        j = j - 1 if j > 0 else n - 1


HELPERS = (
    keep,
    swap_ends,
    take_back,
    reverse,
    turn_between,
    double_bridge,
    move,
    best_gap,
    or_opt,
    two_opt,
    look_at,
    improve,
)
"""Everything `iterated_search` calls, innermost first."""
