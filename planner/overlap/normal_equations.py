"""Normal equations of a network of scans -> their solution, and the inverse at each scan.

One scan after another is eliminated, the next always one that is coupled with the fewest others (minimum
degree). In the reverse order the inverse follows, at the scans and where two were coupled (Takahashi, Fagan
and Chen 1973). So work and memory grow with the couplings, not with the square of the scans.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray


class NormalEquations:
    """A symmetric, positive definite matrix of blocks (3, 3), a row of them for each scan.

    Parameters
    ----------
    own
        Blocks of the scans themselves (n, 3, 3).
    ends, coupling
        Two scans of each coupling (m, 2), and its symmetric block (3, 3). Those of equal scans are added up.
    """

    def __init__(self, own: FloatArray, ends: IntArray, coupling: FloatArray) -> None:
        self._count = len(own)
        self._order, later = _elimination(self._count, ends.tolist())
        rank = np.empty(self._count, dtype=np.int64)
        rank[self._order] = np.arange(self._count)
        self._later = [np.sort(rank[scans]) for scans in later]
        self._begin = np.cumsum([0, *map(len, self._later)])
        first = np.repeat(np.arange(self._count), np.diff(self._begin))
        self._keys = first * self._count + np.concatenate([np.empty(0, np.int64), *self._later])
        pairs = np.sort(rank[ends.reshape(-1, 2)], axis=1)
        self._blocks = np.zeros((len(self._keys), 3, 3))
        np.add.at(self._blocks, self._places(pairs[:, 0], pairs[:, 1]), coupling.reshape(-1, 3, 3))
        self._inverse = np.empty_like(own)
        self._eliminate(own[self._order])

    def _places(self, first: IntArray, second: IntArray) -> IntArray:
        """The blocks of two scans each, by their places in the order; the first is eliminated first."""
        return np.searchsorted(self._keys, first * self._count + second)

    def _fill(self, place: int) -> tuple[slice, IntArray, tuple[IntArray, IntArray], IntArray]:
        """Blocks of one scan, the scans that it is coupled with, pairs of these, and the blocks of pairs."""
        later = self._later[place]
        two = np.triu_indices(len(later), 1)
        own = slice(self._begin[place], self._begin[place + 1])
        return own, later, two, self._places(later[two[0]], later[two[1]])

    def _eliminate(self, own: FloatArray) -> None:
        """Replace the blocks of each scan by those that express it by the scans after it."""
        for place in range(self._count):
            blocks, later, two, between = self._fill(place)
            self._inverse[place] = np.linalg.inv(own[place])
            coupled = self._blocks[blocks]
            by_later = self._inverse[place] @ coupled
            change = np.einsum("iab,jac->ijbc", coupled, by_later)
            own[later] -= change[np.arange(len(later)), np.arange(len(later))]
            self._blocks[between] -= change[two]
            self._blocks[blocks] = by_later

    def solved(self, right: FloatArray) -> FloatArray:
        """Solve for right sides (n, 3, k)."""
        found = right[self._order]
        for place, later in enumerate(self._later):
            by_later = self._blocks[self._begin[place] : self._begin[place + 1]]
            found[later] -= by_later.transpose(0, 2, 1) @ found[place]
        found = self._inverse @ found
        for place in reversed(range(self._count)):
            by_later = self._blocks[self._begin[place] : self._begin[place + 1]]
            found[place] -= (by_later @ found[self._later[place]]).sum(axis=0)
        return self._in_order_of_scans(found)

    def inverse_at_scans(self) -> FloatArray:
        """Return the diagonal blocks of the inverse (n, 3, 3)."""
        own, coupled = np.empty_like(self._inverse), np.empty_like(self._blocks)
        for place in reversed(range(self._count)):
            blocks, later, two, between = self._fill(place)
            size, by_later = len(later), self._blocks[blocks]
            inverse = np.empty((size, size, 3, 3))
            inverse[np.arange(size), np.arange(size)] = own[later]
            inverse[two] = coupled[between]
            inverse[two[1], two[0]] = coupled[between].transpose(0, 2, 1)
            coupled[blocks] = -np.einsum("iab,ijbc->jac", by_later, inverse)
            own[place] = self._inverse[place] - np.einsum("jab,jcb->ac", coupled[blocks], by_later)
        return self._in_order_of_scans(own)

    def _in_order_of_scans(self, values: FloatArray) -> FloatArray:
        found = np.empty_like(values)
        found[self._order] = values
        return found


def _elimination(count: int, ends: Sequence[tuple[int, int]]) -> tuple[IntArray, list[list[int]]]:
    """An order of all scans, and for each in this order the later ones that it is coupled with by then."""
    near: list[set[int]] = [set() for _ in range(count)]
    for a, b in ends:
        near[a].add(b)
        near[b].add(a)
    waiting = [(len(near[k]), k) for k in range(count)]
    heapq.heapify(waiting)
    order, later, done = [], [], [False] * count
    while waiting:
        degree, k = heapq.heappop(waiting)
        if done[k] or degree != len(near[k]):
            continue
        done[k] = True
        order.append(k)
        later.append(sorted(near[k]))
        for other in near[k]:
            near[other] |= near[k]
            near[other] -= {other, k}
            heapq.heappush(waiting, (len(near[other]), other))
    return np.array(order, dtype=np.int64), later
