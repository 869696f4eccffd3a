"""Lengths of paths between all pairs: the same in scipy, as written and compiled, in one process or two."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from stopgo.planner.routing import paths
from stopgo.planner.routing.dijkstra_kernel import find_lengths
from stopgo.planner.routing.paths import edge_lengths, shortest_paths
from tests.planner.kernels import interpret, machine_code
from tests.planner.routing.test_nearby_paths import network

POINTS = 50


@pytest.mark.parametrize("seed", range(3))
def test_all_lengths_are_those_of_scipy(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    xy, edges = network(seed)
    graph = edge_lengths(xy, edges)
    both = (graph + graph.T).tocsr()
    pieces = (both.indptr.astype(np.int64), both.indices.astype(np.int64), both.data)
    asked = dijkstra(graph, directed=False, indices=range(POINTS))[:, :POINTS]
    for kernel in (find_lengths, machine_code(find_lengths)):
        for source in range(0, POINTS, 7):
            away, *heap = np.full(len(xy), np.inf), np.zeros(len(xy), np.int64), np.zeros(len(xy), np.int64)
            kernel(source, POINTS, *pieces, away, *heap)
            assert away[:POINTS].tolist() == asked[source].tolist()
    assert shortest_paths(xy, edges, POINTS).lengths.tolist() == asked.tolist()
    monkeypatch.setattr(paths, "MANY", 0)
    assert shortest_paths(xy, edges, POINTS).lengths.tolist() == asked.tolist()
    interpret(monkeypatch)
    assert shortest_paths(xy, edges, POINTS).lengths.tolist() == asked.tolist()
