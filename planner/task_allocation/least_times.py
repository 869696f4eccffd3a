"""Lower bounds on every division of the stops: on the longest tour's seconds, and on the number of tours.

Most bounds count paths by `TourTimes.least`, a lower bound on every path's time, without turns at stops. The
time of tours together counts these turns too (`TourTimes.turned_s`).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.assemble import ROUNDING_M, ROUNDING_RAD
from stopgo.planner.routing.proof import BRANCH_UP_TO, tour_proof
from stopgo.planner.routing.tour import NANOMETRES, nanometres, shortest_tour
from stopgo.planner.routing.tour_bound import NEVER, growing, highest
from stopgo.planner.task_allocation.tour_times import DETOURS_UP_TO, TourTimes

NOISE = 1e-6
"""Seconds by which floating-point noise may raise a bound."""
MOST_STEPS, WORK = 3_000, 8_000_000_000
"""One-trees of a bound over many points, and edges examined in them; counts, so that speed is no matter."""


def least_makespan(clock: TourTimes, starts: IntArray) -> float:
    """Lower bound in seconds on the longest of the tours, one from each of `starts` (numbers, may repeat).

    It is the largest of three: the mean time of all tours; the time of the tour with the most stops, which
    are at least the mean number; and the time of the farthest stop alone.
    """
    times = clock.least
    tours, stops = len(starts), clock.stops
    together = stops * clock.pause_s + driven_and_turned(clock, tours)
    if stops <= DETOURS_UP_TO:
        together = max(together, stops * clock.pause_s + driven_together(times, stops, closed=clock.closed))
    even = float(seconds_by_count(clock, times)[math.ceil(stops / tours) - 1])
    farthest = float(alone(clock, times).max()) + clock.pause_s
    return max(together / tours, even, farthest) - NOISE


def least_tours(clock: TourTimes, limit_s: float) -> int:
    """Lower bound on the number of closed tours within the limit.

    It follows from the time of all tours together, and from the most stops that fit in one tour by the
    shortest paths. The time of so many tours together, turns included, then rules out further numbers.
    """
    times, stops = clock.least, clock.stops
    together = stops * clock.pause_s + driven_together(times, stops, closed=True) - NOISE
    most = max(1, int(np.count_nonzero(seconds_by_count(clock, times) - NOISE <= limit_s)))
    count = max(1, math.ceil(together / limit_s), math.ceil(stops / most))
    while count < stops and stops * clock.pause_s + driven_and_turned(clock, count) > count * limit_s:
        count += 1
    return count


def alone(clock: TourTimes, times: FloatArray) -> FloatArray:
    """Seconds to drive to each stop from the nearest start, and back if tours are closed (stops,)."""
    there: FloatArray = times[: clock.stops, clock.stops :].min(axis=1)
    return 2 * there if clock.closed else there


def seconds_by_count(clock: TourTimes, times: FloatArray) -> FloatArray:
    """Lower bounds in seconds on a tour of one stop, of two and so on, ascending (stops,).

    Its first stop is reached from a start, each other one from a stop, by at least its shortest path.
    """
    among = times[: clock.stops, : clock.stops].copy()
    np.fill_diagonal(among, np.inf)
    shortest = np.concatenate([[0.0], np.cumsum(np.sort(among.min(axis=1))[:-1])])
    out = float(times[: clock.stops, clock.stops :].min())
    paused = np.arange(1, clock.stops + 1) * clock.pause_s
    return np.asarray(paused + shortest + (2 * out if clock.closed else out), dtype=np.float64)


def driven_together(times: FloatArray, stops: int, *, closed: bool) -> float:
    """Lower bound in seconds on the total driving time of tours from the starts over all stops.

    With all starts as one point, closed tours make one closed walk, at least as long as a shortest tour
    over the points. Open tours connect every stop with a start, at least as long as a spanning tree.
    """
    there = times[:stops, stops:].min(axis=1)
    among = np.minimum(times[:stops, :stops], there[:, None] + there[None, :])
    np.fill_diagonal(among, 0.0)
    whole = np.block([[among, there[:, None]], [there[None, :], np.zeros((1, 1))]])
    if not closed:
        # the sparse solver would ignore an edge of length 0
        return max(0.0, float(minimum_spanning_tree(whole + 1e-9).sum()) - 1e-9 * (stops + 1))
    return least_tour(whole)


def least_tour(times: FloatArray) -> float:
    """Lower bound in seconds on a closed tour over all points of a matrix (n, n), which is gone then."""
    if len(times) <= BRANCH_UP_TO:
        return tour_proof(nanometres(times), shortest_tour(times, seed=1)).bound / NANOMETRES
    cost = nanometres(times, in_place=True)
    steps = min(MOST_STEPS, WORK // len(cost) ** 2)
    return highest(growing(cost), len(cost), best=NEVER, steps=steps)[0] / NANOMETRES


def driven_and_turned(clock: TourTimes, tours: int) -> float:
    """Lower bound in seconds on driving and turning of so many tours together.

    One closed tour over the stops and over points between tours takes as long. It is bounded by the legs'
    times with their shares of turns.
    """
    whole = _closed_together(clock, tours) if clock.closed else _open_together(clock, tours)
    lowest = min(0.0, float(whole.min()))  # below 0 where a leg's share is
    whole -= lowest
    np.fill_diagonal(whole, 0.0)
    legs = clock.stops + (tours if clock.closed else 0)
    least = least_tour(whole)
    rounding = ROUNDING_M / clock.robot.speed + 2 * ROUNDING_RAD / clock.robot.turn_rate
    return least + len(whole) * lowest - legs * rounding


def _closed_together(clock: TourTimes, tours: int) -> FloatArray:
    """Seconds between stops and as many copies of the nearest start as tours, no two next to each other."""
    stops, turned = clock.stops, clock.turned_s
    among = turned[:stops, :stops]
    there = np.repeat(turned[:stops, stops:].min(axis=1)[:, None], tours, axis=1)
    apart = np.full((tours, tours), 2.0 * float(max(among.max(), there.max())))
    return np.block([[among, there], [there.T, apart]])


def _open_together(clock: TourTimes, tours: int) -> FloatArray:
    """Seconds between stops, copies of the nearest start, and as many ends of tours.

    Each end is next to a stop and to the start of the next tour. The last stop has no turn, so that its
    one leg's share is taken off.
    """
    stops, turned = clock.stops, clock.turned_s
    among = turned[:stops, :stops]
    there = np.repeat(turned[:stops, stops:].min(axis=1)[:, None], tours, axis=1)
    last = np.repeat(-clock.largest_share_s[:, None], tours, axis=1)
    apart = np.full((tours, tours), 2.0 * float(max(among.max(), there.max())))
    following = apart * (1 - np.eye(tours))
    return np.block([[among, there, last], [there.T, apart, following], [last.T, following, apart]])
