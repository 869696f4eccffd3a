"""Paths to near points only, compared with the paths between all pairs: lengths, bounds, and routes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay

from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import polyline_length
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.planner import routing
from stopgo.planner.routing import nearby_paths, roadmap, route
from stopgo.planner.routing import paths as paths_module
from stopgo.planner.routing.dijkstra_kernel import reach
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.paths import Paths, shortest_paths
from stopgo.planner.routing.tour import nearest
from stopgo.planner.space.navigable import navigable
from tests.faults.sizes import some
from tests.planner.kernels import interpret, machine_code
from tests.planner.routing.test_routing import selection_at
from tests.planner.worlds import box, hall, wall

WORST = 1.02
"""Times as long as the tour over the lengths of all pairs, at most."""


def network(seed: int, *, nodes: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Random nodes in a square of 100 m, joined like a map of many detours."""
    random = np.random.default_rng(seed)
    xy = random.uniform(0, 100, (nodes, 2))
    pairs = np.concatenate([list(pairwise([*corners, corners[0]])) for corners in Delaunay(xy).simplices])
    tree = np.stack([np.arange(1, nodes), nearest_before(xy)], axis=1)
    return xy, np.concatenate([pairs[random.random(len(pairs)) < 0.3], tree])


def nearest_before(xy: np.ndarray) -> np.ndarray:
    """The nearest of the nodes before each, from the second on: a tree over all of them."""
    return np.array([np.argmin(np.hypot(*(xy[:k] - xy[k]).T)) for k in range(1, len(xy))])


def both(seed: int, points: int = 60) -> tuple[NearbyPaths, Paths]:
    xy, edges = network(seed)
    return NearbyPaths(xy, edges, points, nearest=7, landmarks=4), shortest_paths(xy, edges, points)


@pytest.mark.parametrize("seed", some(range(12), every=4))
def test_bounds_enclose_the_lengths_of_all_pairs(seed: int) -> None:
    near, paths = both(seed)
    least, most = near.at_least(), near.at_most()
    assert (least <= paths.lengths + 1e-9).all()
    assert (paths.lengths <= most + 1e-9).all()
    assert np.array_equal(least, least.T) and np.array_equal(most, most.T)
    exact = least == most
    assert (exact.sum(axis=1) > 7).all()
    assert not exact.all()
    assert np.allclose(least[exact], paths.lengths[exact], rtol=0.0, atol=1e-9)
    assert np.median((most / np.maximum(least, 1e-9))[~exact]) < 2.5


@pytest.mark.parametrize("seed", some(range(12), every=4))
def test_lengths_and_paths_asked_for_are_the_shortest(seed: int) -> None:
    near, paths = both(seed)
    pairs = np.random.default_rng(seed).integers(0, 60, (20, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    near.learn(pairs)
    for a, b in pairs.tolist():
        assert near.at_least()[a, b] == near.at_most()[a, b] == pytest.approx(paths.lengths[a, b], abs=1e-9)
        assert polyline_length(near.path(a, b)) == pytest.approx(paths.lengths[a, b], abs=1e-6)
        assert shapely.equals_exact(*map(shapely.LineString, (near.path(a, b), paths.path(a, b))), 1e-6)


def test_upper_bounds_come_in_any_order_of_the_points() -> None:
    near, _ = both(3)
    near.learn(np.array([(5, 40), (40, 6)]))
    order, matrix = np.random.default_rng(3).permutation(60), np.zeros((61, 61))
    found = near.at_most(order, out=matrix[:60, :60])
    assert np.array_equal(found, near.at_most()[np.ix_(order, order)])
    assert np.array_equal(found, matrix[:60, :60])


def test_the_nearest_points_are_found_by_both_forms_of_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    assert machine_code(reach) is not reach
    fast, paths = both(1)
    interpret(monkeypatch)
    slow, _ = both(1)
    assert np.array_equal(fast.at_least(), slow.at_least())
    assert np.array_equal(fast.at_most(), slow.at_most())
    found, away = slow._search.nearest(3, 7)
    assert found.tolist() == np.argsort(paths.lengths[3], kind="stable")[1:8].tolist()
    assert np.array_equal(away, np.sort(paths.lengths[3])[1:8])


def test_two_processes_find_the_nearest_points_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    xy = np.random.default_rng(3).uniform(0, 10, (40, 2))
    edges = np.stack(np.triu_indices(40, 1), axis=1)
    alone = NearbyPaths(xy, edges, 30, nearest=8, landmarks=4)
    monkeypatch.setattr(nearby_paths, "MANY", 0)
    both = NearbyPaths(xy, edges, 30, nearest=8, landmarks=4)
    for one, other in zip(alone.near_pairs(8), both.near_pairs(8), strict=True):
        assert np.array_equal(one, other)


def test_points_apart_are_not_connected() -> None:
    xy = np.array([(0.0, 0.0), (1.0, 0.0), (5.0, 0.0), (6.0, 0.0)])
    near = NearbyPaths(xy, np.array([(0, 1), (2, 3)]), 4)
    assert not near.connected
    assert NearbyPaths(xy, np.array([(0, 1), (1, 2), (2, 3)]), 4).connected
    with pytest.raises(ValueError, match="no path from point 0 to point 3"):
        near.path(0, 3)


def few_pairs(space: NavigableSpace, points: np.ndarray) -> NearbyPaths:
    """Only the paths to twelve points from each, and from six landmarks."""
    return NearbyPaths(*roadmap.graph_of(space, points), len(points), nearest=12, landmarks=6)


@pytest.mark.parametrize("tour", ["open", "closed"])
@pytest.mark.parametrize("seed", some(range(6), every=6))
def test_a_route_over_near_pairs_is_about_as_short(
    seed: int, tour: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many stops between walls: the lengths of most pairs are bounds only."""
    random = np.random.default_rng(seed)
    walls = [wall(f"w{k}", box(x, 0.9 * (k % 2), x + 0.2, 8 + k % 2)) for k, x in enumerate((4, 9, 14, 19))]
    space = navigable(hall(24, 10, *walls), Settings(tour=tour))
    xy = random.uniform((0.6, 1.0), (23.4, 7.5), (90, 2))
    blocked = np.min([np.abs(xy[:, 0] - x - 0.1) for x in (4, 9, 14, 19)], axis=0) < 0.6
    selection = selection_at(space, xy[~blocked])
    dense = route(selection)
    monkeypatch.setattr(routing, "ALL_PAIRS_UP_TO", 10)
    monkeypatch.setattr(routing, "nearby_paths_between", few_pairs)
    sparse = route(selection)
    assert sorted(sparse.order.tolist()) == sorted(dense.order.tolist())
    assert sparse.length <= WORST * dense.length
    assert sparse.bound <= min(dense.length, sparse.length) + 1e-6
    assert sparse.bound >= 0.9 * dense.length
    assert sparse.start_reason == dense.start_reason


def test_an_end_that_no_path_reaches_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    space = navigable(hall(8, 4), Settings())
    selection = selection_at(space, np.array([(1.0, 1.0), (6.0, 3.0), (30.0, 30.0)]))
    monkeypatch.setattr(routing, "ALL_PAIRS_UP_TO", 1)
    with pytest.raises(NegativeResult, match="not connected"):
        route(selection)


@pytest.mark.parametrize("many", [1, 4, 39])
def test_the_nearest_are_those_of_a_stable_order(many: int) -> None:
    cost = np.random.default_rng(2).integers(1, 9, (40, 40))
    cost = np.triu(cost, 1) + np.triu(cost, 1).T
    away = cost + np.diag(np.full(40, 99))
    near, apart = nearest(cost, many)
    assert np.array_equal(near, np.argsort(away, axis=1, kind="stable")[:, :many])
    assert np.array_equal(apart, np.take_along_axis(away, near, axis=1))


def test_trees_that_are_kept_are_those_found_again(monkeypatch: pytest.MonkeyPatch) -> None:
    xy, edges = network(2)
    few, again = np.array([3, 0, 11]), shortest_paths(xy, edges, 12)
    for room in (10**6, 0):
        monkeypatch.setattr(paths_module, "MOST_KEPT", room)
        kept = shortest_paths(xy, edges, 12, trees=True)
        assert kept.lengths.tolist() == again.lengths.tolist()
        assert kept.before(few).tolist() == again.before(few).tolist()
        assert all(kept.path(a, 5).tolist() == again.path(a, 5).tolist() for a in few.tolist())


def test_paths_to_a_point_that_are_kept_are_as_short() -> None:
    near, paths = both(5)
    near.keep_paths_to(59)
    for a in range(59):
        line = near.path(a, 59)
        assert polyline_length(line) == pytest.approx(paths.lengths[a, 59])
        assert line[[0, -1]].tolist() == paths.xy[[a, 59]].tolist()


def test_paths_beyond_the_limit_are_not_found() -> None:
    xy, edges = network(4)
    every, near = (shortest_paths(xy, edges, 30, limit=limit) for limit in (np.inf, 40.0))
    found = every.lengths <= 40.0
    assert 30 < found.sum() < 900
    assert np.array_equal(np.isfinite(near.lengths), found)
    assert near.lengths[found].tolist() == every.lengths[found].tolist()
    assert (near.before(np.arange(3))[:, :30][~found[:3]] < 0).all()
