"""Local search over tours: moves a stop, exchanges two, or reverses a stretch, by the schedule's times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from stopgo.planner.task_allocation.tour_times import Tour, TourTimes

ROUNDS = 200
"""Most improvements; a count, so that plans do not depend on speed."""
GAIN = 1e-6
"""Seconds below which a change is no improvement."""

Tours = tuple[Tour, ...]


def shorter_longest(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> Tours:
    """Tours, none without a stop, with a shorter longest tour, then with a shorter total; else the same."""
    tours = tuple(shorter(clock, tour, start) for tour, start in zip(tours, starts, strict=True))
    worth = _worth(clock, tours, starts)
    for _ in range(ROUNDS):
        found = None
        for other in _exchanged(clock, tours, starts):
            its = _worth(clock, other, starts)
            if its[0] < worth[0] - GAIN or (its[0] < worth[0] + GAIN and its[1] < worth[1] - GAIN):
                found, worth = other, its
        if found is None:
            return tours
        tours = tuple(shorter(clock, tour, start) for tour, start in zip(found, starts, strict=True))
        worth = _worth(clock, tours, starts)
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
        order, seconds = min(
            ((other, clock.seconds(other, start)) for other in _reordered(tour)),
            key=lambda found: found[1], default=(tour, best),
        )  # fmt: skip
        if seconds > best - GAIN:
            return tour
        tour, best = order, seconds
    return tour


def _worth(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> tuple[float, float]:
    """Seconds of the longest tour, and of all tours."""
    times = [clock.seconds(tour, start) for tour, start in zip(tours, starts, strict=True)]
    return max(times), sum(times)


def _exchanged(clock: TourTimes, tours: Tours, starts: Sequence[int]) -> Iterator[Tours]:
    """Tours with a stop of the longest tour moved to another, or exchanged for one of another."""
    times = [clock.seconds(tour, start) for tour, start in zip(tours, starts, strict=True)]
    longest = times.index(max(times))
    for stop in tours[longest]:
        rest = _without(tours[longest], stop)
        for k, tour in enumerate(tours):
            if k == longest:
                continue
            if rest:
                yield _with(tours, {longest: rest, k: _inserted(clock, tour, stop, starts[k])})
            for other in tour:
                back = _inserted(clock, rest, other, starts[longest])
                there = _inserted(clock, _without(tour, other), stop, starts[k])
                yield _with(tours, {longest: back, k: there})


def _inserted(clock: TourTimes, tour: Tour, stop: int, start: int) -> Tour:
    """The tour with one more stop, where the driving time grows least."""
    least, depot = clock.least, clock.stops + start
    line = (depot, *tour, depot)
    added = [(least[a, stop] + least[stop, b] - least[a, b], k) for k, (a, b) in enumerate(pairwise(line))]
    at = min(added)[1]
    return (*tour[:at], stop, *tour[at:])


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
