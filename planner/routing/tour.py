"""Shortest tour through points: 2-opt and Or-opt with iterated local search, reproducible by seed.

An open path is the tour with one more point, at no distance from where the path may end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mission.geometry import FloatArray, IntArray
from planner.compiling import compiled

ROUNDS = 60
"""Perturbations per point that are tried; a count, so that plans do not depend on speed."""
LONGEST_SEGMENT = 3
"""Points moved together by Or-opt."""
COMPILE_ABOVE = 30
"""Points above which loading the compiled kernel pays for itself."""


def shortest_tour(lengths: FloatArray, *, seed: int) -> IntArray:
    """Order of the points of a symmetric matrix of finite lengths (n, n), beginning at point 0.

    The direction is the one in which the second point is lower than the last.
    """
    n = len(lengths)
    if n <= 3:
        return np.arange(n)
    random = np.random.Generator(np.random.PCG64(seed))
    cuts = np.sort(random.integers(1, n, size=(ROUNDS * n, 3)), axis=1)
    order = _nearest_neighbours(lengths)
    if n > COMPILE_ABOVE:
        search = compiled(iterated_search, local_search, two_opt_pass, or_opt_pass, path_length)
        found = np.asarray(search(np.ascontiguousarray(lengths), order, cuts, LONGEST_SEGMENT))
    else:
        found = np.asarray(iterated_search(lengths.tolist(), order.tolist(), cuts.tolist(), LONGEST_SEGMENT))
    return canonical(found)


def canonical(order: IntArray) -> IntArray:
    """The same tour from point 0 in the direction whose second point is the lower."""
    at = int(np.flatnonzero(order == 0)[0])
    turned = np.roll(order, -at)
    return turned if turned[1] <= turned[-1] else np.append(turned[:1], turned[:0:-1])


def _nearest_neighbours(lengths: FloatArray) -> IntArray:
    left = list(range(1, len(lengths)))
    order = [0]
    while left:
        nearest = int(np.argmin(lengths[order[-1], left]))
        order.append(left.pop(nearest))
    return np.array(order, dtype=np.int64)


def iterated_search(lengths: Any, order: Any, cuts: Any, longest: int) -> Any:
    """Local search, then again from a tour with three stretches swapped, kept where it is shorter."""
    n = len(order)
    best = local_search(lengths, order, longest)
    best_length = path_length(lengths, best)
    for k in range(len(cuts)):
        i, j, m = cuts[k][0], cuts[k][1], cuts[k][2]
        if j in (i, m):
            continue
        trial = order.copy()
        at = 0
        for begin, end in ((0, i), (j, m), (i, j), (m, n)):
            for p in range(begin, end):
                trial[at] = best[p]
                at += 1
        trial = local_search(lengths, trial, longest)
        length = path_length(lengths, trial)
        if length < best_length - 1e-9:
            best, best_length = trial, length
    return best


def path_length(lengths: Any, order: Any) -> float:
    """Length of the closed tour."""
    total = 0.0
    for k in range(len(order)):
        total += lengths[order[k - 1]][order[k]]
    return total


def local_search(lengths: Any, order: Any, longest: int) -> Any:
    """Apply 2-opt and Or-opt moves until none shortens the tour."""
    order = order.copy()
    better = True
    while better:
        better = two_opt_pass(lengths, order)
        if or_opt_pass(lengths, order, longest):
            better = True
    return order


def two_opt_pass(lengths: Any, order: Any) -> bool:
    """Reverse stretches of the tour wherever that shortens it."""
    n = len(order)
    better = False
    for i in range(n - 1):
        for j in range(i + 1, n):
            a, b = order[i - 1], order[i]
            c, d = order[j], order[(j + 1) % n]
            if a == c or b == d:
                continue
            gain = lengths[a][b] + lengths[c][d] - lengths[a][c] - lengths[b][d]
            if gain > 1e-9:
                low, high = i, j
                while low < high:
                    order[low], order[high] = order[high], order[low]
                    low += 1
                    high -= 1
                better = True
    return better


def or_opt_pass(lengths: Any, order: Any, longest: int) -> bool:
    """Move stretches of up to `longest` points elsewhere, either way round, wherever that is shorter."""
    n = len(order)
    better = False
    for size in range(1, min(longest, n - 3) + 1):
        for i in range(n - size + 1):
            before, first = order[i - 1], order[i]
            last, after = order[i + size - 1], order[(i + size) % n]
            saved = lengths[before][first] + lengths[last][after] - lengths[before][after]
            best_gain, best_at, turned = 1e-9, -1, False
            for j in range(n):
                if i - 1 <= j < i + size or (i == 0 and j == n - 1):
                    continue
                c, d = order[j], order[(j + 1) % n]
                forth = saved - (lengths[c][first] + lengths[last][d] - lengths[c][d])
                back = saved - (lengths[c][last] + lengths[first][d] - lengths[c][d])
                if forth > best_gain:
                    best_gain, best_at, turned = forth, j, False
                if back > best_gain:
                    best_gain, best_at, turned = back, j, True
            if best_at < 0:
                continue
            better = True
            moved = order[i : i + size].copy()
            if turned:
                moved = moved[::-1].copy()
            if best_at < i:
                for p in range(i - 1, best_at, -1):
                    order[p + size] = order[p]
                for p in range(size):
                    order[best_at + 1 + p] = moved[p]
            else:
                for p in range(i + size, best_at + 1):
                    order[p - size] = order[p]
                for p in range(size):
                    order[best_at + 1 - size + p] = moved[p]
    return better
