"""Trees of shortest paths: the same by the kernel and by scipy, also where paths are equally short."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.routing.dijkstra_kernel import grow
from stopgo.planner.routing.path_trees import NONE, path_trees, trees_to_groups
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


@pytest.mark.parametrize("wanted", [0, 1, 4, 30, 99])
@pytest.mark.parametrize("limit", [np.inf, 11.0])
@pytest.mark.parametrize("drawn", [lattice(), network(3)], ids=["lattice", "network"])
def test_trees_are_the_same_by_kernel_and_scipy(
    drawn: tuple[FloatArray, IntArray], limit: float, wanted: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = both_ways(*drawn)
    group = np.where(np.arange(graph.shape[0]) % 3, NONE, np.arange(graph.shape[0]) % 30)
    away, before, ends = trees_to_groups(graph, SOURCES, group, wanted, limit=limit)
    pieces = (graph.indptr.tolist(), graph.indices.tolist(), graph.data.tolist())
    for source in SOURCES.tolist():
        lengths, nodes = [np.inf] * graph.shape[0], [NONE] * graph.shape[0]
        rest = ([0] * len(nodes), [0] * len(nodes), [NONE] * 30)
        end = grow(source, limit, wanted, group.tolist(), *pieces, lengths, nodes, *rest)
        assert end == ends[source]
        found = [length <= end for length in lengths]
        assert found == np.isfinite(away[source]).tolist()
        assert [node for node, is_found in zip(nodes, found, strict=True) if is_found] == (
            before[source][found].tolist()
        )
    interpret(monkeypatch)
    for one, other in zip(
        trees_to_groups(graph, SOURCES, group, wanted, limit=limit), (away, before, ends), strict=True
    ):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("limit", [np.inf, 11.0])
@pytest.mark.parametrize("drawn", [lattice(), network(3)], ids=["lattice", "network"])
def test_all_paths_up_to_the_last_wanted_group_are_found(
    drawn: tuple[FloatArray, IntArray], limit: float
) -> None:
    graph, wanted = both_ways(*drawn), 4
    whole, _ = path_trees(graph, SOURCES, limit=limit)
    assert whole.tolist() == dijkstra(graph, indices=SOURCES, limit=limit).tolist()
    group = np.where(np.arange(graph.shape[0]) % 3, NONE, np.arange(graph.shape[0]) % 30)
    away, _, ends = trees_to_groups(graph, SOURCES, group, wanted, limit=limit)
    for lengths, found, end in zip(whole, away, ends, strict=True):
        assert np.array_equal(found, np.where(lengths <= end, lengths, np.inf))
        nearest = sorted(lengths[group == one].min() for one in np.unique(group[group >= 0]))
        assert end == min(limit, nearest[wanted - 1])


def test_of_equally_short_paths_the_last_node_but_one_is_the_lowest() -> None:
    graph = both_ways(*lattice())
    away, before = path_trees(graph, SOURCES)
    for lengths, nodes in zip(away, before, strict=True):
        for node in range(graph.shape[0]):
            own = slice(graph.indptr[node], graph.indptr[node + 1])
            others = graph.indices[own]
            last = others[lengths[others] + graph.data[own] == lengths[node]]
            assert nodes[node] == (last.min() if len(last) else NONE)
