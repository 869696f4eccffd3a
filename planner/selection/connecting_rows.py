"""Separate components -> the fewest rows that connect two or more of them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray

BLOCK = 1_000_000
"""Links looked at together, so that those of an open hall take no more memory."""


def connecting_rows(
    links: csr_array,
    region: IntArray,
    components: list[IntArray],
    near: list[IntArray],
    gain_of: Callable[[IntArray], IntArray],
) -> IntArray:
    """The row of a region that connects most of its components; if none connects two, the shortest path.

    Of rows that connect as many, it is the first with the largest gain in coverage. Rows `near` each of the
    components are linked with it.
    """
    joins = np.bincount(np.concatenate(near), minlength=links.shape[0])[region]
    most = int(joins.max())
    if most < 2:
        return _shortest_path(links, region, components)
    alike = region[joins == most]
    return alike[[int(np.argmax(gain_of(alike)))]]


def _shortest_path(links: csr_array, region: IntArray, components: list[IntArray]) -> IntArray:
    """The fewest rows of a region that lead from one component to another."""
    members = np.concatenate(components)
    component = np.repeat(np.arange(len(components)), [len(one) for one in components])
    inside = links if len(region) == links.shape[0] else links[region][:, region]
    start = np.searchsorted(region, members)
    steps, before, source = dijkstra(  # both directions are there
        inside, directed=True, indices=start, unweighted=True, min_only=True, return_predecessors=True
    )
    of = np.full(len(region), -1, dtype=np.int32)
    of[start] = component
    ends = _nearest_across(inside, steps, of[source])
    path = [row for end in ends for row in _traced(end, before)]
    return np.setdiff1d(region[path], members)


def _nearest_across(inside: csr_array, steps: FloatArray, side: IntArray) -> tuple[int, int]:
    """Ends of the first link between rows of two sides (rows,) with the fewest steps to both ends."""
    pointer, found = inside.indptr, [(np.inf, 0)]
    begins = np.searchsorted(pointer, np.arange(0, pointer[-1], BLOCK))
    for low, high in pairwise(np.unique([*begins, len(side)]).tolist()):
        to, many = inside.indices[pointer[low] : pointer[high]], np.diff(pointer[low : high + 1])
        both = np.repeat(steps[low:high], many) + steps[to]
        both[np.repeat(side[low:high], many) == side[to]] = np.inf
        k = int(np.argmin(both))
        found.append((float(both[k]), int(pointer[low]) + k))
    link = min(found)[1]
    return int(np.searchsorted(pointer, link, side="right")) - 1, int(inside.indices[link])


def _traced(row: int, before: IntArray) -> list[int]:
    """A row and its predecessors, back to a component."""
    path = [row]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path
