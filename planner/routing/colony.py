"""The paper's router: an ant colony over the matrix of path lengths between stops (paper, 3.5).

The ant system of Dorigo, Maniezzo and Colorni, "Ant system: optimization by a colony of cooperating
agents", IEEE Trans. SMC-B 1996, with the parameters found best there. The paper names the method and
gives no parameters.
"""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.tour import canonical

ALPHA = 1
"""Power of the trail in an ant's choice."""
BETA = 5
"""Power of the inverse length in an ant's choice."""
EVAPORATION = 0.5
"""1 - rho: fraction of the trail that is lost per cycle."""
CYCLES = 100
"""Tours of every ant; a count, so that the route does not depend on speed."""
MOST_ANTS = 50
"""One ant per point, but no more than this (ours)."""
NEAREST = 0.01
"""Shorter edges count as this fraction of the mean one, since lengths are inverted (ours)."""


def ant_colony(lengths: FloatArray, *, seed: int) -> IntArray:
    """Order of the points of a symmetric matrix of finite lengths (n, n), from point 0 on.

    The direction is the one in which the second point is lower than the last.
    """
    n = len(lengths)
    if n <= 3:
        return np.arange(n)
    random = np.random.Generator(np.random.PCG64(seed))
    nearness = _power(1.0 / np.maximum(lengths, NEAREST * max(float(lengths.mean()), 1e-9)), BETA)
    trail = np.ones((n, n))
    best, shortest = np.arange(n), np.inf
    for _ in range(CYCLES):
        tours = _walks(_power(trail, ALPHA) * nearness, random)
        driven = lengths[tours, np.roll(tours, -1, axis=1)].sum(axis=1)
        trail = (1 - EVAPORATION) * trail + _laid(tours, driven)
        first = int(np.argmin(driven))
        if driven[first] < shortest:
            best, shortest = tours[first], float(driven[first])
    return canonical(best)


def _power(values: FloatArray, times: int) -> FloatArray:
    """Values to a whole power by multiplication, which is the same on every machine."""
    result = np.ones_like(values)
    for _ in range(times):
        result = result * values
    return result


def _walks(attraction: FloatArray, random: np.random.Generator) -> IntArray:
    """A tour of each ant (ants, n): the next point is drawn in proportion to its attraction."""
    n = len(attraction)
    ants = np.arange(min(n, MOST_ANTS))
    at = random.permutation(n)[: len(ants)]
    left = np.ones((len(ants), n), dtype=bool)
    tours = np.empty((len(ants), n), dtype=np.int64)
    for step in range(n):
        tours[:, step] = at
        left[ants, at] = False
        if step + 1 < n:
            fraction = np.cumsum(np.where(left, attraction[at], 0.0), axis=1)
            drawn = random.random(len(ants)) * fraction[:, -1]
            at = _first_above(fraction, drawn, left)
    return tours


def _first_above(fraction: FloatArray, drawn: FloatArray, left: IntArray) -> IntArray:
    """The point of each draw; the first point left if all fractions are too small to distinguish."""
    found = np.argmax(fraction > drawn[:, None], axis=1)
    seen = ~left[np.arange(len(found)), found]
    found[seen] = np.argmax(left[seen], axis=1)
    return found


def _laid(tours: IntArray, driven: FloatArray) -> FloatArray:
    """Trail laid by every ant: more on shorter tours, in units of the mean tour (their Q)."""
    n = tours.shape[1]
    laid = np.zeros((n, n))
    amount = np.repeat((driven.mean() / np.maximum(driven, 1e-9)) / len(tours), n)
    following = np.roll(tours, -1, axis=1)
    np.add.at(laid, (tours.ravel(), following.ravel()), amount)
    return laid + laid.T
