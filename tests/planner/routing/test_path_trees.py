"""Trees of shortest paths: the same by the kernel and by scipy, also where paths are equally short."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.dijkstra_kernel import grow
from stopgo.planner.routing.path_trees import NONE, path_trees
from stopgo.planner.routing.paths import edge_lengths
from tests.planner.kernels import interpret
from tests.planner.routing.test_nearby_paths import network

SOURCES = np.arange(9)


def lattice() -> tuple[FloatArray, IntArray]:
    """Places of 400 nodes, numbered at random, and their edges: many paths are of one length."""
    place = np.random.default_rng(1).permutation(400)
    cells = place.reshape(20, 20)
    xy = np.empty((400, 2))
    xy[place] = np.stack(np.divmod(np.arange(400), 20), axis=1)
    across, along = (np.stack([some[:-1], some[1:]], axis=-1).reshape(-1, 2) for some in (cells, cells.T))
    return xy, np.concatenate([across, along])


def both_ways(xy: FloatArray, edges: IntArray) -> csr_array:
    graph = edge_lengths(xy, edges)
    return csr_array(graph + graph.T)


@pytest.mark.parametrize("limit", [np.inf, 11.0])
@pytest.mark.parametrize("drawn", [lattice(), network(3)], ids=["lattice", "network"])
def test_trees_are_the_same_by_kernel_and_scipy(
    drawn: tuple[FloatArray, IntArray], limit: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = both_ways(*drawn)
    away, before = path_trees(graph, SOURCES, limit=limit)
    assert away.tolist() == dijkstra(graph, indices=SOURCES, limit=limit).tolist()
    pieces = (graph.indptr.tolist(), graph.indices.tolist(), graph.data.tolist())
    for source in SOURCES.tolist():
        lengths, nodes = [np.inf] * graph.shape[0], [NONE] * graph.shape[0]
        grow(source, limit, *pieces, lengths, nodes, [0] * len(nodes), [0] * len(nodes))
        assert (lengths, nodes) == (away[source].tolist(), before[source].tolist())
    interpret(monkeypatch)
    lengths, nodes = path_trees(graph, SOURCES, limit=limit)
    assert np.array_equal(lengths, away) and np.array_equal(nodes, before)


def test_of_equally_short_paths_the_last_node_but_one_is_the_lowest() -> None:
    graph = both_ways(*lattice())
    away, before = path_trees(graph, SOURCES)
    for lengths, nodes in zip(away, before, strict=True):
        for node in range(graph.shape[0]):
            own = slice(graph.indptr[node], graph.indptr[node + 1])
            others = graph.indices[own]
            last = others[lengths[others] + graph.data[own] == lengths[node]]
            assert nodes[node] == (last.min() if len(last) else NONE)
