"""Pieces that lie apart -> the rows that join two or more of them, by as few rows as possible."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import IntArray


def steps_between(links: csr_array, ground: IntArray, pieces: list[IntArray], gain: IntArray) -> IntArray:
    """The row of a ground that joins most of its pieces; where none joins two, the shortest way between two.

    Of rows that join as many, the one that adds most to what is seen; `gain` (rows,) says how much.
    """
    members = np.concatenate(pieces)
    piece = np.repeat(np.arange(len(pieces)), [len(one) for one in pieces])
    shape = (links.shape[0], len(pieces))
    belongs = csr_array((np.ones(len(members), np.int64), (members, piece)), shape=shape)
    joins = np.diff((links @ belongs).tocsr().indptr)[ground]
    most = int(joins.max())
    if most < 2:
        return _shortest_way(links, ground, members, piece)
    alike = ground[joins == most]
    return alike[[int(np.argmax(gain[alike]))]]


def _shortest_way(links: csr_array, ground: IntArray, members: IntArray, piece: IntArray) -> IntArray:
    """The fewest rows of a ground that lead from one piece to another."""
    inside = links[ground][:, ground]
    start = np.searchsorted(ground, members)
    steps, before, source = dijkstra(
        inside, directed=False, indices=start, unweighted=True, min_only=True, return_predecessors=True
    )
    of = np.full(len(ground), -1, dtype=np.int64)
    of[start] = piece
    a, b = inside.tocoo().coords
    across = of[source[a]] != of[source[b]]
    a, b = a[across], b[across]
    k = int(np.argmin(steps[a] + steps[b]))
    way = [row for end in (a[k], b[k]) for row in _back(int(end), before)]
    return np.setdiff1d(ground[way], members)


def _back(row: int, before: IntArray) -> list[int]:
    """A row and those before it, back to its piece."""
    way = [row]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way
