"""Long tours are searched by the changes with the least driving time, and are as short as by all of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, cast

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray
from stopgo.planner.task_allocation.exchange import LONG, _reordered, shorter, shorter_longest
from stopgo.planner.task_allocation.tour_times import Tour, TourTimes


class StraightDrives:
    """A clock for which a metre takes a second and turning none; the only start is the point (0, 0)."""

    pause_s = 60.0

    def __init__(self, stops: int, seed: int) -> None:
        xy = np.concatenate([np.random.default_rng(seed).uniform(0, 60, (stops, 2)), [(0.0, 0.0)]])
        self.stops, self.timed = stops, 0
        self.likely = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
        self._rows = self.likely.tolist()

    def seconds(self, tour: Tour, start: int = 0) -> float:
        self.timed += 1
        line = (self.stops, *tour, self.stops)
        return len(tour) * self.pause_s + sum(self._rows[a][b] for a, b in pairwise(line))

    def seconds_of(self, tours: Sequence[Tour], start: int = 0) -> FloatArray:
        return np.array([self.seconds(tour, start) for tour in tours])


def clock_of(stops: int, seed: int) -> tuple[StraightDrives, TourTimes]:
    made = StraightDrives(stops, seed)
    return made, cast(TourTimes, cast(Any, made))


@pytest.mark.parametrize("seed", range(3))
def test_no_change_shortens_a_long_tour_further(seed: int) -> None:
    stops = LONG + 15
    own, clock = clock_of(stops, seed)
    found = shorter(clock, tuple(range(stops)), 0)
    assert sorted(found) == list(range(stops))
    assert own.timed < 20_000  # every change of every round: over 200 000
    best = own.seconds(found)
    assert all(own.seconds(other) > best - 1e-6 for other in _reordered(found))


def test_long_tours_that_differ_are_evened_out() -> None:
    stops = 3 * LONG
    own, clock = clock_of(stops, 7)
    uneven: tuple[Tour, ...] = (tuple(range(2 * LONG)), tuple(range(2 * LONG, stops)))
    found = shorter_longest(clock, uneven, [0, 0])
    assert sorted(stop for tour in found for stop in tour) == list(range(stops))
    times = [own.seconds(tour) for tour in found]
    assert max(times) - min(times) < own.pause_s
    assert max(times) < own.seconds(shorter(clock, uneven[0], 0)) - 5 * own.pause_s
    assert own.timed < 150_000
