"""Shortest tour through points: 2-opt and Or-opt with iterated local search, reproducible by seed.

Lengths are counted in whole nanometres: sums and gains are exact, so the same seed finds the same tour
on every machine, interpreted or compiled.
"""

from __future__ import annotations

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.routing.subsets import best_of_all
from stopgo.planner.routing.tour_kernel import iterated_search

NANOMETRES = 1e9
"""Per metre."""
LARGEST = 4e18
"""Largest total of a tour's edges in nanometres, so that sums stay within 64 bits."""
COMPARE_ALL_UP_TO = 9
"""Points up to which comparing all tours is quicker than a search."""
ROUNDS = 100
"""Perturbations per point that are tried; a count, so that plans do not depend on speed."""
MOST_TRIALS = 100_000
"""Perturbations of a long tour.

Of 4 649 stops in rooms along corridors ten per point find the tour of a hundred. Of as many points scattered
in an open square twenty per point find one 0.24 % longer.
"""
SHORT = 30
"""Points of a short tour, which is mostly found in the first search."""
ROUNDS_OF_SHORT = 20
"""Perturbations per point of a short tour."""
NEAREST = 10
"""Nearest points to which new edges are tried from each point."""
LONGEST_STRETCH = 50
"""Points in each of the two stretches that a perturbation exchanges, at most."""
BLOCK = 256
"""Points whose lengths are converted, and whose neighbours are sorted, at a time."""
JOURNAL = 1000
"""Most reversals in a trial, so that it can be undone."""


def shortest_tour(lengths: FloatArray, *, seed: int) -> IntArray:
    """Order of the points of a symmetric matrix of finite lengths (n, n) in metres, from point 0 on.

    The direction is the one in which the second point is lower than the last.
    """
    return shortest_over(nanometres(lengths), seed=seed)


def shortest_over(cost: IntArray, *, seed: int) -> IntArray:
    """`shortest_tour` over lengths in whole nanometres."""
    n = len(cost)
    if n <= COMPARE_ALL_UP_TO:
        return canonical(best_of_all(cost))
    rounds = ROUNDS_OF_SHORT if n <= SHORT else ROUNDS
    return canonical(search(cost, trials(cost, min(rounds * n, MOST_TRIALS), seed=seed)))


def nanometres(lengths: FloatArray, *, in_place: bool = False) -> IntArray:
    """Lengths in whole nanometres, rounded down, so that no sum of them is above the true one.

    Those `in_place` take the memory of the lengths, which are gone then.
    """
    if float(np.max(lengths, initial=0.0)) * NANOMETRES * len(lengths) > LARGEST:
        longest, most = float(lengths.max()), LARGEST / NANOMETRES / len(lengths)
        raise InputError(f"route: a path of {longest:g} m between {len(lengths)} stops; at most {most:g} m")
    whole = lengths.view(np.int64) if in_place else np.empty(lengths.shape, dtype=np.int64)
    for k in range(0, len(lengths), BLOCK):  # of thousands of points a copy is a large part of the memory
        whole[k : k + BLOCK] = np.floor(lengths[k : k + BLOCK] * NANOMETRES)
    return whole


def length_of(cost: IntArray, order: IntArray) -> int:
    """Length of the closed tour, in the matrix's unit."""
    return int(cost[order, np.roll(order, -1)].sum())


def canonical(order: IntArray) -> IntArray:
    """The same tour from point 0 in the direction whose second point is the lower."""
    at = int(np.flatnonzero(order == 0)[0])
    turned = np.roll(order, -at)
    forth = len(turned) < 3 or turned[1] < turned[-1]
    return turned if forth else np.append(turned[:1], turned[:0:-1])


def trials(cost: IntArray, count: int, *, seed: int) -> IntArray:
    """Perturbations (count, 4): an index, points in the two stretches after it, and the allowed loss.

    Losses are drawn up to twice the mean distance to the nearest point at first, down to 0 at the end.
    """
    n = len(cost)
    random = np.random.Generator(np.random.PCG64(seed))
    sizes = random.integers(1, min(LONGEST_STRETCH, n // 3), size=(count, 2), endpoint=True)
    indices = random.integers(0, n, size=count)
    step = int(nearest(cost, 1)[1].sum()) // n
    loss = random.integers(0, 2 * step + 1, size=count) // count * np.arange(count, 0, -1)
    return np.column_stack([indices, sizes, loss])


def nearest(cost: IntArray, many: int) -> tuple[IntArray, IntArray]:
    """The nearest other points of each point (n, many), and their distances."""
    n, beyond = len(cost), int(cost.max()) + 1
    near = np.empty((n, many), dtype=np.int64)
    for k in range(0, n, BLOCK):
        away = cost[k : k + BLOCK].copy()
        away[np.arange(len(away)), np.arange(k, k + len(away))] = beyond
        most = np.partition(away, many - 1, axis=1)[:, many - 1 : many]
        point, other = np.nonzero(away <= most)
        order = np.lexsort((other, away[point, other], point))
        first = np.searchsorted(point, np.arange(len(away)))
        near[k : k + BLOCK] = other[order][first[:, None] + np.arange(many)]
    return near, np.take_along_axis(cost, near, axis=1)


def search(cost: IntArray, perturbations: IntArray, *, interpreted: bool = False) -> IntArray:
    """The shortest tour of a local search with `perturbations`, from the nearest neighbours' tour on."""
    n = len(cost)
    order = _nearest_neighbours(cost)
    near, _ = nearest(cost, min(NEAREST, n - 1))
    scratch = [np.zeros(size, dtype=np.int64) for size in (n, n, n, 2 * JOURNAL, 3)]
    given = (cost.ravel(), near.ravel(), order, np.argsort(order), perturbations.ravel(), *scratch)
    arrays = [np.ascontiguousarray(array) for array in given]
    kernel = None if interpreted else compiled(iterated_search, large=n > SHORT)
    if kernel is None:
        lists = [array.tolist() for array in arrays]
        iterated_search(*lists)
        return np.array(lists[BEST], dtype=np.int64)
    kernel(*arrays)
    return arrays[BEST]


BEST = 5
"""Index of the best tour among the kernel's arguments."""


def _nearest_neighbours(cost: IntArray) -> IntArray:
    """The tour that always continues to the nearest unvisited point."""
    order, visited = [0], np.zeros(len(cost), dtype=bool)
    for _ in range(len(cost) - 1):
        visited[order[-1]] = True
        order.append(int(np.argmin(np.where(visited, np.iinfo(np.int64).max, cost[order[-1]]))))
    return np.array(order, dtype=np.int64)
