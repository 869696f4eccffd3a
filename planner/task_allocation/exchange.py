"""Local search over tours: moves a stop, exchanges two, or reverses a stretch, by the schedule's times.

Of long tours only those changes are timed that are the best by driving time alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.task_allocation.tour_times import Tour, TourTimes

ROUNDS = 200
"""Most improvements; a count, so that plans do not depend on speed."""
GAIN = 1e-6
"""Seconds below which a change is no improvement."""
LONG = 30
"""Stops of a tour above which not all changes are timed."""
LIKELY = 60
"""Changes of a long tour that are timed, the best by driving time."""
MANY = 2000
"""Exchanges of stops of a tour with all others above which not all are timed."""

Tours = tuple[Tour, ...]
NewTours = dict[int, Tour]
"""New tours, by their number."""


def shorter_longest(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> Tours:
    """Tours, none without a stop, with a shorter longest tour, then with a shorter total; else the same."""
    tours = tuple(shorter(clock, tour, start) for tour, start in zip(tours, starts, strict=True))
    times = _times(clock, tours, starts)
    for _ in range(ROUNDS):
        changes = list(_exchanged(clock, tours, times, starts))
        worths = _worths(clock, changes, times, starts)
        best, worth = None, (max(times), sum(times))
        for change, its in zip(changes, worths, strict=True):
            if its[0] < worth[0] - GAIN or (its[0] < worth[0] + GAIN and its[1] < worth[1] - GAIN):
                best, worth = change, its
        if best is None:
            return tours
        tours = _with(tours, {k: shorter(clock, tour, starts[k]) for k, tour in best.items()})
        times = _times(clock, tours, starts)
    return tours


def filled(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> Tours:
    """The same stops, with at least one in every tour; each move leaves the longest tour shortest."""
    while any(not tour for tour in tours):
        empty = next(k for k, tour in enumerate(tours) if not tour)
        moved = [
            _with(tours, {k: _without(tour, stop), empty: (stop,)})
            for k, tour in enumerate(tours) if len(tour) > 1 for stop in tour
        ]  # fmt: skip
        tours = min(moved, key=lambda other: _worth(clock, other, starts))
    return tours


def shorter(clock: TourTimes, tour: Tour, start: int) -> Tour:
    """The same stops in an order that no reversal, and no move of up to three stops, makes shorter."""
    best = clock.seconds(tour, start)
    for _ in range(ROUNDS):
        orders = list(_orders_to_try(clock, tour, start))
        seconds = clock.seconds_of(orders, start) if orders else np.array([best])
        least = int(np.argmin(seconds))
        if seconds[least] > best - GAIN:
            return tour
        tour, best = orders[least], float(seconds[least])
    return tour


def _worth(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> tuple[float, float]:
    """Seconds of the longest tour, and of all tours."""
    times = _times(clock, tours, starts)
    return max(times), sum(times)


def _times(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> list[float]:
    """Seconds of each tour."""
    return [clock.seconds(tour, start) for tour, start in zip(tours, starts, strict=True)]


def _worths(
    clock: TourTimes, changes: Sequence[NewTours], times: Sequence[float], starts: Sequence[int]
) -> list[tuple[float, float]]:
    """Seconds of the longest tour, and of all tours, after each change of tours that take `times`."""
    alike: dict[tuple[int, int], dict[Tour, float]] = {}
    for change in changes:
        for k, tour in change.items():
            alike.setdefault((starts[k], len(tour)), {})[tour] = 0.0
    for (start, _), known in alike.items():
        known.update(zip(known, clock.seconds_of(list(known), start).tolist(), strict=True))
    found = []
    for change in changes:
        after = list(times)
        for k, tour in change.items():
            after[k] = alike[starts[k], len(tour)][tour]
        found.append((max(after), sum(after)))
    return found


def _exchanged(
    clock: TourTimes, tours: Tours, times: Sequence[float], starts: Sequence[int]
) -> Iterator[NewTours]:
    """Changes that move a stop of the longest tour to another, or exchange it for one of another."""
    longest = times.index(max(times))
    if len(tours[longest]) > LONG or len(tours[longest]) * clock.stops > MANY:
        yield from _likely_exchanges(clock, tours, times, starts)
        return
    own = tours[longest]
    rests = [_without(own, stop) for stop in own]
    for k, tour in enumerate(tours):
        if k == longest:
            continue
        entered = _places(clock, tour, own, starts[k])
        back = [_places(clock, rest, tour, starts[longest]) for rest in rests]
        left = [_without(tour, other) for other in tour]
        there = [_places(clock, rest, own, starts[k]) for rest in left]
        for i, stop in enumerate(own):
            if rests[i]:
                yield {longest: rests[i], k: _inserted(tour, stop, entered[i])}
            for j, other in enumerate(tour):
                yield {
                    longest: _inserted(rests[i], other, back[i][j]),
                    k: _inserted(left[j], stop, there[j][i]),
                }


def _places(clock: TourTimes, tour: Tour, stops: Sequence[int], start: int) -> list[int]:
    """Index in a tour at which each stop adds the least driving time."""
    line = np.array([clock.stops + start, *tour, clock.stops + start])
    return [int(k) for k in np.argmin(_added_at(clock, np.array(stops), line), axis=1)]


def _inserted(tour: Tour, stop: int, at: int) -> Tour:
    return (*tour[:at], stop, *tour[at:])


def _likely_exchanges(
    clock: TourTimes, tours: Tours, times: Sequence[float], starts: Sequence[int]
) -> Iterator[NewTours]:
    """Moves and exchanges of a stop of a long longest tour, the best by estimated driving time."""
    longest = times.index(max(times))
    own, leaving = np.array(tours[longest]), _left_out(clock, tours[longest], starts[longest])
    found: list[FloatArray] = []
    for k, tour in enumerate(tours):
        if k == longest:
            continue
        entering = _added(clock, own, tour, starts[k])
        apart = (times[longest] - leaving - clock.pause_s, times[k] + entering + clock.pause_s)
        found.append(_rated(*apart, own, k, -1))
        others = np.array(tour, dtype=np.int64)
        back = times[longest] - leaving[:, None] + _added(clock, others, tours[longest], starts[longest])
        there = times[k] + entering[:, None] - _left_out(clock, tour, starts[k])
        found.append(_rated(back, there, own[:, None], k, others))
    for stop, k, other in _likeliest(np.concatenate([np.empty((0, 5)), *found])):
        rest = _without(tours[longest], stop)
        left = tours[k] if other < 0 else _without(tours[k], other)
        there = _inserted(left, stop, *_places(clock, left, [stop], starts[k]))
        if other >= 0:
            rest = _inserted(rest, other, *_places(clock, rest, [other], starts[longest]))
        yield {longest: rest, k: there}


def _rated(one: FloatArray, other: FloatArray, stop: IntArray, tour: int, back: IntArray | int) -> FloatArray:
    """Exchanges (n, 5): the longer time of two tours, both times, the stop, the other tour and its stop."""
    columns = np.broadcast_arrays(np.maximum(one, other), one + other, stop, tour, back)
    return np.column_stack([column.ravel() for column in columns])


def _likeliest(rated: FloatArray) -> list[list[int]]:
    """Stop, other tour and its stop of the best exchanges."""
    if len(rated) > LIKELY:
        rated = rated[rated[:, 0] <= np.partition(rated[:, 0], LIKELY - 1)[LIKELY - 1]]
    found: list[list[int]] = rated[np.lexsort(rated.T[::-1])][:LIKELY, 2:].astype(np.int64).tolist()
    return found


def _left_out(clock: TourTimes, tour: Tour, start: int) -> FloatArray:
    """Driving time that a tour saves without each of its stops, about (stops,)."""
    line = np.array([clock.stops + start, *tour, clock.stops + start])
    a, at, b = line[:-2], line[1:-1], line[2:]
    likely = clock.likely
    return np.asarray(likely[a, at] + likely[at, b] - likely[a, b])


def _added(clock: TourTimes, stops: IntArray, tour: Tour, start: int) -> FloatArray:
    """Driving time that each stop adds to a tour where it adds least, about (stops,)."""
    line = np.array([clock.stops + start, *tour, clock.stops + start])
    return np.asarray(_added_at(clock, stops, line).min(axis=1))


def _added_at(clock: TourTimes, stops: IntArray, line: IntArray) -> FloatArray:
    """Driving time that each stop adds in each leg of a line (stops, legs), about."""
    likely, a, b = clock.likely, line[:-1], line[1:]
    return np.asarray(likely[stops[:, None], a] + likely[stops[:, None], b] - likely[a, b])


def _orders_to_try(clock: TourTimes, tour: Tour, start: int) -> Iterator[Tour]:
    """All changes of a tour's order; of a long one the best by driving time."""
    if len(tour) <= LONG:
        yield from _reordered(tour)
        return
    line = np.array([clock.stops + start, *tour, clock.stops + start])
    n, away = len(tour), clock.likely[np.ix_(line, line)]
    step = np.diagonal(away, 1)
    # the stretch from stop a to before stop b is reversed
    turned = away[:-1, :-1] + away[1:, 1:] - step[:, None] - step
    turned[np.tri(n + 1, k=1, dtype=bool)] = np.inf
    found = [(gain, begin, end, -1) for gain, begin, end in _best(turned)]
    for size in (1, 2, 3):
        closed = np.diagonal(away, size + 1) - step[: n - size + 1] - step[size:]
        moved = closed[:, None] + away[1 : n - size + 2, :-1] + away[size : n + 1, 1:] - step
        first, at = np.arange(n - size + 1)[:, None], np.arange(n + 1)
        moved[(at >= first) & (at <= first + size)] = np.inf
        found += [(gain, begin, place, size) for gain, begin, place in _best(moved)]
    for _, begin, place, size in sorted(found)[:LIKELY]:
        if size < 0:
            yield (*tour[:begin], *tour[begin:place][::-1], *tour[place:])
            continue
        stretch, rest = tour[begin : begin + size], (*tour[:begin], *tour[begin + size :])
        at = place - size if place > begin else place
        yield (*rest[:at], *stretch, *rest[at:])


def _best(change: FloatArray) -> Iterator[tuple[float, int, int]]:
    """The changes with the least driving time, LIKELY of them, with their two places."""
    flat = change.ravel()
    likely = np.flatnonzero(flat <= np.partition(flat, LIKELY - 1)[LIKELY - 1])
    best = likely[np.argsort(flat[likely], kind="stable")][:LIKELY]
    for gain, first, second in zip(flat[best], *np.unravel_index(best, change.shape), strict=True):
        yield float(gain), int(first), int(second)


def _reordered(tour: Tour) -> Iterator[Tour]:
    for a in range(len(tour)):
        for b in range(a + 2, len(tour) + 1):
            yield (*tour[:a], *tour[a:b][::-1], *tour[b:])
        for size in (1, 2, 3):
            stretch, rest = tour[a : a + size], (*tour[:a], *tour[a + size :])
            for at in range(len(rest) + 1):
                if at != a and len(stretch) == size:
                    yield (*rest[:at], *stretch, *rest[at:])


def _without(tour: Tour, stop: int) -> Tour:
    return tuple(item for item in tour if item != stop)


def _with(tours: Tours, changed: dict[int, Tour]) -> Tours:
    return tuple(changed.get(k, tour) for k, tour in enumerate(tours))
