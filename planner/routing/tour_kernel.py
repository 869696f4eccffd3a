"""The tour search's moves: 2-opt and Or-opt over neighbour lists, every move made of reversals.

The functions are plain functions over lists or arrays of whole numbers. So the same source runs interpreted
and compiled, with the same result. `iterated_search` is compiled as one loop and therefore stays whole.

Data, for n points
------------------
- `cost`: the symmetric matrix of lengths, flat: from point a to point b at `a * n + b`.
- `near`: the nearest points of each point, flat: `reach = len(near) // n` of point a from `a * reach` on,
  the nearest first.
- `order`: the tour, a point at each index. `position`: the inverse, the index of each point in `order`.
- `best`: a copy of the shortest tour so far.
- `trials`: four numbers per double bridge, flat: index in the tour, points in the first stretch, points in
  the second, allowed loss.
- `queue`: a ring buffer of the points to examine. `waiting`: 1 for each point in the queue, else 0.
- `journal`: for each reversal of the current trial, its two indices at `2 * k` and `2 * k + 1`.
- `state`: the three counters of queue and journal (`QUEUE_HEAD`, `QUEUE_LENGTH`, `REVERSALS`).

Invariants
----------
- `position[order[i]] == i` for every i. Only `swap_ends` writes to either.
- Every change of the tour is a `reverse`, which notes it in the journal. A reversal undoes itself, so `undo`
  repeats the journal backwards and restores the tour of the trial's start.
- A point is in the queue at most once, so the queue never exceeds n points.
- `improve` stops while the journal still has room for one more move (`MOVE_REVERSALS`); the points left in
  the queue wait for the next call.
- `improve` makes a move only if it gains; only `double_bridge` may lose. All return exact gains, so that the
  length of the tour is never summed again.
- No number exceeds 64 bits: the longest edge times the number of points is below 2**62
  (`stopgo.planner.routing.tour.nanometres` refuses more). No tour, gain or loss is more than that.

Sources: Bentley, "Fast algorithms for geometric traveling salesman problems", ORSA J. Computing 1992
(neighbour lists, don't-look bits, here as a queue of the points to look at); Johnson and McGeoch, "The
traveling salesman problem: a case study in local optimization", 1997 (iterated search by local double
bridges); Kirkpatrick, Gelatt, Vecchi, Science 1983 (losses allowed, less and less).
"""

from __future__ import annotations

from typing import Any

QUEUE_HEAD, QUEUE_LENGTH, REVERSALS = 0, 1, 2
"""Indices in `state`: first entry of the queue, its length, and the reversals in the journal."""
LONGEST_SEGMENT = 3
"""Points moved together by Or-opt."""
MOVE_REVERSALS = 3
"""Reversals that one move may need."""


def iterated_search(
    cost: Any,
    near: Any,
    order: Any,
    position: Any,
    trials: Any,
    best: Any,
    queue: Any,
    waiting: Any,
    journal: Any,
    state: Any,
) -> int:
    """Improve `order` in place, then after one local double bridge per trial; return the gain of `best`.

    A trial changes the tour only near its cut. Its journal undoes it if it loses more than allowed, so that
    a trial on a long tour takes little more time than on a short one.

    Parameters
    ----------
    trials
        For each: index, points in the first stretch, points in the second, and the allowed loss.
    best
        Receives the shortest tour found.
    queue, waiting, journal
        Scratch: a number per point, zero per point, two numbers per reversal that can be undone.
    state
        Scratch of three zeros, see QUEUE_HEAD, QUEUE_LENGTH and REVERSALS.
    """
    total = 0
    for point in range(len(order)):
        enqueue(point, queue, waiting, state)
    while state[QUEUE_LENGTH] > 0:
        state[REVERSALS] = 0
        total += improve(cost, near, order, position, queue, waiting, journal, state)
    most = total
    copy_tour(order, best)
    for k in range(len(trials) // 4):
        state[REVERSALS] = 0
        gain = double_bridge(4 * k, cost, order, position, trials, queue, waiting, journal, state)
        gain += improve(cost, near, order, position, queue, waiting, journal, state)
        if gain < -trials[4 * k + 3]:
            undo(order, position, journal, state)
            continue
        total += gain
        if total > most:
            most = total
            copy_tour(order, best)
    return most


def on_ring(index: int, n: int) -> int:
    """The index on a ring of n that is one of -n to 2n - 1: a remainder without a division."""
    if index < 0:
        return index + n
    return index if index < n else index - n


def copy_tour(order: Any, best: Any) -> None:
    """Copy a tour."""
    for k in range(len(order)):
        best[k] = order[k]


def enqueue(point: int, queue: Any, waiting: Any, state: Any) -> None:
    """Put a point into the queue, unless it is there already."""
    if waiting[point] == 0:
        waiting[point] = 1
        queue[on_ring(state[QUEUE_HEAD] + state[QUEUE_LENGTH], len(queue))] = point
        state[QUEUE_LENGTH] += 1


def improve(
    cost: Any, near: Any, order: Any, position: Any, queue: Any, waiting: Any, journal: Any, state: Any
) -> int:
    """Make moves at the points of the queue until it is empty or the journal is full; return the gain."""
    total = 0
    most = len(journal) // 2 - MOVE_REVERSALS
    while state[QUEUE_LENGTH] > 0 and state[REVERSALS] <= most:
        point = queue[state[QUEUE_HEAD]]
        state[QUEUE_HEAD] = on_ring(state[QUEUE_HEAD] + 1, len(queue))
        state[QUEUE_LENGTH] -= 1
        waiting[point] = 0
        gain = two_opt(point, cost, near, order, position, queue, waiting, journal, state)
        if gain == 0:
            gain = or_opt(point, cost, near, order, position, queue, waiting, journal, state)
        if gain > 0:
            enqueue(point, queue, waiting, state)
        total += gain
    return total


def two_opt(
    a: int,
    cost: Any,
    near: Any,
    order: Any,
    position: Any,
    queue: Any,
    waiting: Any,
    journal: Any,
    state: Any,
) -> int:
    """Exchange an edge at `a` for one to a nearer point, if that is shorter; return the gain, else 0."""
    n = len(order)
    reach = len(near) // n
    for step in range(1, -2, -2):
        b = order[on_ring(position[a] + step, n)]
        ab = cost[a * n + b]
        for k in range(a * reach, a * reach + reach):
            c = near[k]
            ac = cost[a * n + c]
            if ac >= ab:
                break
            d = order[on_ring(position[c] + step, n)]
            gain = ab + cost[c * n + d] - ac - cost[b * n + d]
            if gain > 0:
                first, last = (b, c) if step > 0 else (c, b)
                reverse(position[first], position[last], order, position, journal, state)
                enqueue(a, queue, waiting, state)
                enqueue(b, queue, waiting, state)
                enqueue(c, queue, waiting, state)
                enqueue(d, queue, waiting, state)
                return gain
    return 0


def or_opt(
    a: int,
    cost: Any,
    near: Any,
    order: Any,
    position: Any,
    queue: Any,
    waiting: Any,
    journal: Any,
    state: Any,
) -> int:
    """Move a stretch a..z next to a point near `a`, either way round, if shorter; return the gain, else 0."""
    n = len(order)
    for step in range(1, -2, -2):
        before = order[on_ring(position[a] - step, n)]
        z = a
        for size in range(1, LONGEST_SEGMENT + 1):
            after = order[on_ring(position[z] + step, n)]
            saved = cost[before * n + a] + cost[z * n + after] - cost[before * n + after]
            c, d, gain = best_gap(a, z, size, step, saved, cost, near, order, position)
            if gain > 0:
                move(a, z, c, d, step, order, position, journal, state)
                enqueue(before, queue, waiting, state)
                enqueue(after, queue, waiting, state)
                enqueue(a, queue, waiting, state)
                enqueue(z, queue, waiting, state)
                enqueue(c, queue, waiting, state)
                enqueue(d, queue, waiting, state)
                return gain
            z = after
    return 0


def best_gap(
    a: int, z: int, size: int, step: int, saved: int, cost: Any, near: Any, order: Any, position: Any
) -> tuple[int, int, int]:
    """The first edge c-d, with c near `a`, where inserting a..z gains, and the gain; gain 0 if none."""
    n = len(order)
    reach = len(near) // n
    for k in range(a * reach, a * reach + reach):
        c = near[k]
        spare = saved - cost[a * n + c]
        if spare <= 0:
            break
        if on_ring((position[c] - position[a]) * step, n) < size:
            continue
        for side in range(1, -2, -2):
            d = order[on_ring(position[c] + side, n)]
            gain = spare + cost[c * n + d] - cost[z * n + d]
            if gain > 0 and on_ring((position[d] - position[a]) * step, n) >= size:
                return c, d, gain
    return a, a, 0


def move(
    a: int, z: int, c: int, d: int, step: int, order: Any, position: Any, journal: Any, state: Any
) -> None:
    """Put the stretch a..z, which runs along `step`, between the neighbours c and d, `a` next to c."""
    n = len(order)
    first, last = (a, z) if step > 0 else (z, a)
    left, right = (c, d) if order[on_ring(position[c] + 1, n)] == d else (d, c)
    if on_ring(position[left] - position[last], n) <= on_ring(position[first] - position[right], n):
        begin, end = order[on_ring(position[last] + 1, n)], left
        reverse(position[first], position[end], order, position, journal, state)
    else:
        begin, end = right, order[on_ring(position[first] - 1, n)]
        reverse(position[begin], position[last], order, position, journal, state)
    turn_between(begin, end, order, position, journal, state)
    if order[on_ring(position[a] + 1, n)] != c and order[on_ring(position[a] - 1, n)] != c:
        turn_between(a, z, order, position, journal, state)


def double_bridge(
    cut: int,
    cost: Any,
    order: Any,
    position: Any,
    trials: Any,
    queue: Any,
    waiting: Any,
    journal: Any,
    state: Any,
) -> int:
    """Exchange the two stretches of the trial at `cut`; return the gain, mostly negative."""
    n = len(order)
    at, mid, far = trials[cut], trials[cut] + trials[cut + 1], trials[cut] + trials[cut + 1] + trials[cut + 2]
    p, a = order[on_ring(at - 1, n)], order[at]
    b, c = order[on_ring(mid - 1, n)], order[on_ring(mid, n)]
    d, q = order[on_ring(far - 1, n)], order[on_ring(far, n)]
    reverse(position[a], position[d], order, position, journal, state)
    turn_between(c, d, order, position, journal, state)
    turn_between(a, b, order, position, journal, state)
    enqueue(p, queue, waiting, state)
    enqueue(a, queue, waiting, state)
    enqueue(b, queue, waiting, state)
    enqueue(c, queue, waiting, state)
    enqueue(d, queue, waiting, state)
    enqueue(q, queue, waiting, state)
    removed = cost[p * n + a] + cost[b * n + c] + cost[d * n + q]
    return removed - cost[p * n + c] - cost[d * n + a] - cost[b * n + q]


def turn_between(p: int, q: int, order: Any, position: Any, journal: Any, state: Any) -> None:
    """Reverse the shorter of the two stretches of the tour that end at p and q."""
    n = len(order)
    if on_ring(position[q] - position[p], n) <= on_ring(position[p] - position[q], n):
        reverse(position[p], position[q], order, position, journal, state)
    else:
        reverse(position[q], position[p], order, position, journal, state)


def reverse(i: int, j: int, order: Any, position: Any, journal: Any, state: Any) -> None:
    """Reverse the tour from index i to index j, and note it in the journal."""
    journal[2 * state[REVERSALS]], journal[2 * state[REVERSALS] + 1] = i, j
    state[REVERSALS] += 1
    swap_ends(i, j, order, position)


def undo(order: Any, position: Any, journal: Any, state: Any) -> None:
    """Undo the reversals in the journal, the last first; a reversal undoes itself."""
    while state[REVERSALS] > 0:
        state[REVERSALS] -= 1
        swap_ends(journal[2 * state[REVERSALS]], journal[2 * state[REVERSALS] + 1], order, position)


def swap_ends(i: int, j: int, order: Any, position: Any) -> None:
    """Reverse indices i to j, or the rest of the tour if that is shorter: the cycle is the same."""
    n = len(order)
    count = on_ring(j - i, n) + 1
    if 2 * count > n:
        i, j = on_ring(j + 1, n), on_ring(i - 1, n)
        count = n - count
    for _ in range(count // 2):
        p, q = order[i], order[j]
        order[i], order[j] = q, p
        position[q], position[p] = i, j
        i = i + 1 if i + 1 < n else 0
        j = j - 1 if j > 0 else n - 1
