"""Inequalities that every tour meets and a solution of the relaxation violates.

A tour leaves any set of points at least twice (Dantzig, Fulkerson, Johnson 1954), and an even number of
times (Edmonds' blossom inequalities, with the sets proposed by Padberg and Rinaldi, 1990).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.routing.relaxation import Cut

LITTLE = 1e-6
"""Fractions and violations below this are the solver's noise."""


def violated_cuts(points: int, edges: IntArray, fraction: FloatArray) -> list[Cut]:
    """Cuts violated by the fractions (m,) of the edges (m, 2); none if this cheap search finds none."""
    labels = _components(points, edges[fraction > LITTLE])
    if labels.max() > 0:
        sets = [labels == k for k in range(int(labels.max()) + 1)]
        return [_leave_twice(edges, inside) for inside in sets]
    return _small_cuts(points, edges, fraction) or _odd_cuts(points, edges, fraction)


def _components(points: int, edges: IntArray) -> IntArray:
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(points, points))
    return np.asarray(connected_components(graph, directed=False)[1])


def _leaving(edges: IntArray, inside: BoolArray) -> BoolArray:
    """True for edges (m,) with one end in a set of points."""
    return inside[edges[:, 0]] != inside[edges[:, 1]]


def _leave_twice(edges: IntArray, inside: BoolArray) -> Cut:
    return Cut(_leaving(edges, inside).astype(np.int64), 2)


def _small_cuts(points: int, edges: IntArray, fraction: FloatArray) -> list[Cut]:
    """Cuts of sets that fewer than two edges leave (Stoer and Wagner, J. ACM 1997).

    Points joined by a whole edge are merged: some smallest cut does not separate them.
    """
    group = _components(points, edges[fraction > 1 - LITTLE])
    m = int(group.max()) + 1
    weight = np.zeros((m, m))
    np.add.at(weight, (group[edges[:, 0]], group[edges[:, 1]]), fraction)
    weight += weight.T
    np.fill_diagonal(weight, 0.0)
    members = [group == k for k in range(m)]
    left, found = list(range(m)), []
    while len(left) > 1:
        before, last, value = _most_tightly(weight, left)
        if value < 2 - 10 * LITTLE:
            found.append(_leave_twice(edges, members[last]))
        members[before] = members[before] | members[last]
        weight[before] += weight[last]
        weight[:, before] += weight[:, last]
        weight[before, before] = 0.0
        left.remove(last)
    return found


def _most_tightly(weight: FloatArray, left: list[int]) -> tuple[int, int, float]:
    """The last two groups of a maximum adjacency order, and the weight that ties the last one."""
    ties = np.full(len(weight), -np.inf)
    ties[left] = weight[left[0], left]
    last, before, value = left[0], left[0], 0.0
    ties[last] = -np.inf
    for _ in range(len(left) - 1):
        before, last = last, int(np.argmax(ties))
        value = float(ties[last])
        ties += weight[last]
        ties[last] = -np.inf
    return before, last, value


def _odd_cuts(points: int, edges: IntArray, fraction: FloatArray) -> list[Cut]:
    """Blossom cuts of sets that an odd number of edges leaves: components of fractional edges."""
    partly = (fraction > LITTLE) & (fraction < 1 - LITTLE)
    labels = _components(points, edges[partly])
    cuts = []
    for label in range(int(labels.max()) + 1):
        leaving = np.flatnonzero(_leaving(edges, labels == label))
        if not len(leaving):
            continue
        used = fraction[leaving] > 0.5
        if used.sum() % 2 == 0:
            doubtful = int(np.argmin(np.abs(fraction[leaving] - 0.5)))
            used[doubtful] = not used[doubtful]
        if np.where(used, 1 - fraction[leaving], fraction[leaving]).sum() < 1 - 10 * LITTLE:
            times = np.zeros(len(edges), dtype=np.int64)
            times[leaving] = np.where(used, -1, 1)
            cuts.append(Cut(times, 1 - int(used.sum())))
    return cuts
