"""Bound of a long tour from near pairs: below every tour, and about as high as that of all pairs."""

from __future__ import annotations

from functools import cache
from importlib import import_module

import numpy as np
import pytest

from stopgo.planner.routing import Ends, tour_bound
from stopgo.planner.routing import _bound_over_nearby as bound_over_nearby
from stopgo.planner.routing.nearby_bound import nearby_bound
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.one_tree_kernel import join_all
from stopgo.planner.routing.paths import shortest_paths
from stopgo.planner.routing.tour import length_of, nanometres, shortest_tour
from tests.faults.sizes import size
from tests.planner.kernels import interpret, machine_code
from tests.planner.routing.test_nearby_paths import network

bounding = import_module(nearby_bound.__module__)
POINTS = 130


@pytest.fixture(autouse=True)
def few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounding, "STEPS", 150)


@cache
def paths_and_lengths(seed: int) -> tuple[NearbyPaths, np.ndarray]:
    xy, edges = network(seed)
    lengths = shortest_paths(xy, edges, POINTS).lengths
    return NearbyPaths(xy, edges, POINTS), (lengths + lengths.T) / 2


@cache
def tour_and_its_bound(seed: int) -> tuple[list[int], float]:
    """A short tour of all points, and the bound of closed tours from all pairs."""
    _, lengths = paths_and_lengths(seed)
    tour = shortest_tour(lengths, seed=1).tolist()
    return tour, tour_bound(lengths, tour, Ends(None, None, True, ""))


@pytest.mark.parametrize("seed", range(size(short=2, full=30)))
@pytest.mark.parametrize(
    "ends",
    [
        Ends(None, None, True, ""),
        Ends(None, None, False, ""),
        Ends(5, None, False, ""),
        Ends(5, 9, False, ""),
    ],
)
def test_no_route_is_shorter_and_the_bound_is_near_that_of_all_pairs(seed: int, ends: Ends) -> None:
    paths, lengths = paths_and_lengths(seed)
    tour, every = tour_and_its_bound(seed)
    longest = float(lengths[tour, np.roll(tour, -1)].sum())
    found = bound_over_nearby(paths, longest, ends)
    assert 0 < found <= longest
    if ends.closed:
        assert found >= 0.97 * every
    elif ends.first is None:
        gaps = lengths[tour, np.roll(tour, -1)]
        assert found <= longest - gaps.max() + 1e-6
        assert found >= 0.95 * (every - gaps.max())


@pytest.mark.parametrize("seed", range(size(short=2, full=10)))
def test_the_bound_is_the_same_compiled_and_interpreted(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    paths, lengths = paths_and_lengths(seed)
    cost = nanometres(lengths)
    best = length_of(cost, shortest_tour(lengths, seed=1))
    fast = nearby_bound(paths, None, best=best)
    interpret(monkeypatch)
    assert nearby_bound(paths, None, best=best) == fast


def test_a_smallest_tree_takes_the_shortest_edges_that_join_parts() -> None:
    """A square of sides 1, 2, 3, 4 and a diagonal 2: the sides 1 and 2, and the other side 3."""
    a, b = np.array([0, 1, 2, 3, 0]), np.array([1, 2, 3, 0, 2])
    order = np.argsort([1, 2, 3, 4, 2], kind="stable")
    for kernel in (join_all, machine_code(join_all)):
        used = np.zeros(4, dtype=np.int64)
        assert kernel(order, a, b, np.arange(4), used) == 3
        assert used[:3].tolist() == [0, 1, 2]
