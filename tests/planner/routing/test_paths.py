"""Lengths of paths between all pairs: the same in scipy, as written and compiled, in one process or two."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

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


def test_a_path_is_the_same_alone_and_of_a_tree() -> None:
    """On a lattice, where many paths are of one length."""
    place = np.random.default_rng(1).permutation(400)
    cells = place.reshape(20, 20)
    xy = np.empty((400, 2))
    xy[place] = np.stack(np.divmod(np.arange(400), 20), axis=1)
    across, along = (np.stack([some[:-1], some[1:]], axis=-1).reshape(-1, 2) for some in (cells, cells.T))
    edges = np.concatenate([across, along])
    of_tree = shortest_paths(xy, edges, 9, trees=True)
    for start, end in permutations(range(9), 2):
        alone = shortest_paths(xy, edges, 9)
        assert alone.path(start, end).tolist() == of_tree.path(start, end).tolist()


def test_a_path_of_a_graph_whose_lengths_are_too_short_is_not_found() -> None:
    """A third-party graph may have other lengths than its pieces: even the straight line is longer."""
    found = shortest_paths(*network(1), 9)
    wrong = replace(found, lengths=found.lengths / 1000)
    with pytest.raises(ValueError, match="no path from point 0 to point 3"):
        wrong.path(0, 3)


@pytest.mark.parametrize("seed", range(2))
def test_a_path_by_itself_is_that_of_a_search_of_the_whole_graph(seed: int) -> None:
    found = shortest_paths(*network(seed), POINTS)
    whole = shortest_paths(*network(seed), POINTS, trees=True)
    for a, b in np.random.default_rng(seed).integers(0, POINTS, (60, 2)).tolist():
        assert found.path(a, b).tolist() == whole.path(a, b).tolist()


def test_a_path_of_a_graph_whose_lengths_are_rounded_is_found() -> None:
    """Those of a third-party graph may be a little shorter than the straight lines between its nodes."""
    found = shortest_paths(*network(1), 9)
    low = found.graph.copy()
    low.data = np.nextafter(low.data.astype(np.float32), np.float32(0)).astype(float)
    rounded = replace(found, graph=low, lengths=dijkstra(low, directed=False, indices=range(9))[:, :9])
    for a in range(9):
        for b in range(9):
            assert rounded.path(a, b).tolist() == found.path(a, b).tolist()
