"""Separate components -> the fewest rows that connect two or more of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import IntArray


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
    inside = links[region][:, region]
    start = np.searchsorted(region, members)
    steps, before, source = dijkstra(
        inside, directed=False, indices=start, unweighted=True, min_only=True, return_predecessors=True
    )
    of = np.full(len(region), -1, dtype=np.int64)
    of[start] = component
    a, b = inside.tocoo().coords
    across = of[source[a]] != of[source[b]]
    a, b = a[across], b[across]
    k = int(np.argmin(steps[a] + steps[b]))
    path = [row for end in (a[k], b[k]) for row in _traced(int(end), before)]
    return np.setdiff1d(region[path], members)


def _traced(row: int, before: IntArray) -> list[int]:
    """A row and its predecessors, back to a component."""
    path = [row]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return path
