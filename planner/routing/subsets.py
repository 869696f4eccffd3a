"""The shortest of all tours, by dynamic programming over subsets: exact, for few points.

Held and Karp, "A dynamic programming approach to sequencing problems", J. SIAM 1962.
"""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray

NOWHERE = 2**62
"""More than any tour is long."""


def best_of_all(cost: IntArray) -> IntArray:
    """Order (n,) of the shortest closed tour over a symmetric matrix of whole numbers, from point 0 on."""
    n = len(cost)
    if n <= 3:
        return np.arange(n)
    reach = _reach(cost[1:, 1:], cost[0, 1:])
    left = len(reach) - 1
    last = int(np.argmin(reach[left] + cost[0, 1:]))
    order = [last + 1]
    while left & (left - 1):
        left ^= 1 << last
        last = int(np.argmin(reach[left] + cost[1:, 1:][last]))
        order.append(last + 1)
    return np.array([0, *order], dtype=np.int64)


def _reach(cost: IntArray, first: IntArray) -> IntArray:
    """Least cost from point 0 through every subset of the other points to each of them as the last."""
    m = len(cost)
    bit = 1 << np.arange(m)
    reach = np.full((1 << m, m), NOWHERE)
    reach[bit, np.arange(m)] = first
    for subset in range(1, 1 << m):
        then = np.flatnonzero(subset & bit == 0)
        reach[subset | bit[then], then] = np.minimum(
            reach[subset | bit[then], then], (reach[subset][:, None] + cost[:, then]).min(axis=0)
        )
    return reach
