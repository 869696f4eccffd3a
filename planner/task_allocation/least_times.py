"""What no way of sharing stops out goes below: the longest tour's seconds, the number of tours.

Every bound counts ways by `TourTimes.least`, a metric below every way's time, and turns at stops not at
all.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.proof import tour_proof
from stopgo.planner.routing.tour import NANOMETRES, nanometres, shortest_tour
from stopgo.planner.task_allocation.tour_times import TourTimes

NOISE = 1e-6
"""Seconds by which float noise may lift a bound."""


def least_makespan(clock: TourTimes, starts: IntArray) -> float:
    """Seconds that the longest of the tours, one from each of `starts` (numbers, may repeat), takes at least.

    The most of three: the time of all tours together shared out evenly; that of the tour with the most
    stops, which are at least the even number; and that of the farthest stop alone.
    """
    times = clock.least
    tours, stops = len(starts), clock.stops
    together = stops * clock.pause_s + driven_together(times, stops, closed=clock.closed)
    even = seconds_of(clock, times, math.ceil(stops / tours))
    farthest = float(alone(clock, times).max()) + clock.pause_s
    return max(together / tours, even, farthest) - NOISE


def least_tours(clock: TourTimes, limit_s: float) -> int:
    """How many closed tours within the limit all stops take at least.

    By the time of all tours together, and by how many stops the shortest ways leave time for in one.
    """
    times, stops = clock.least, clock.stops
    together = stops * clock.pause_s + driven_together(times, stops, closed=True) - NOISE
    most = next((n for n in range(stops, 1, -1) if seconds_of(clock, times, n) - NOISE <= limit_s), 1)
    return max(1, math.ceil(together / limit_s), math.ceil(stops / most))


def alone(clock: TourTimes, times: FloatArray) -> FloatArray:
    """Seconds to drive to each stop from the nearest start, and back if tours are closed (stops,)."""
    there: FloatArray = times[: clock.stops, clock.stops :].min(axis=1)
    return 2 * there if clock.closed else there


def seconds_of(clock: TourTimes, times: FloatArray, stops: int) -> float:
    """Seconds below which no tour of so many stops is.

    Its first stop is reached from a start, each other one from a stop, by its shortest way at least.
    """
    among = times[: clock.stops, : clock.stops].copy()
    np.fill_diagonal(among, np.inf)
    shortest = np.sort(among.min(axis=1))[: stops - 1].sum() if stops > 1 else 0.0
    out = float(times[: clock.stops, clock.stops :].min())
    return stops * clock.pause_s + float(shortest) + (2 * out if clock.closed else out)


def driven_together(times: FloatArray, stops: int, *, closed: bool) -> float:
    """Seconds below which no tours from the starts over all stops are, taken together.

    With all starts as one point, closed tours make one closed walk, which no shortest tour over the points
    is longer than. Open ones join every stop with a start, as no tree does in less.
    """
    there = times[:stops, stops:].min(axis=1)
    among = np.minimum(times[:stops, :stops], there[:, None] + there[None, :])
    np.fill_diagonal(among, 0.0)
    whole = np.block([[among, there[:, None]], [there[None, :], np.zeros((1, 1))]])
    if not closed:
        # an edge of no length would be none to the sparse solver
        return max(0.0, float(minimum_spanning_tree(whole + 1e-9).sum()) - 1e-9 * (stops + 1))
    order = shortest_tour(whole, seed=1)
    return tour_proof(nanometres(whole), order).bound / NANOMETRES
