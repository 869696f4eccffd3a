"""Tours and their proofs against every permutation, against each other, and with fixed ends."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.planner.routing import Ends, far_edge, tour_matrix
from stopgo.planner.routing.cuts import violated_cuts
from stopgo.planner.routing.one_tree_kernel import grow
from stopgo.planner.routing.proof import tour_proof
from stopgo.planner.routing.subsets import best_of_all
from stopgo.planner.routing.tour import canonical, length_of, nanometres, search, shortest_tour, trials
from stopgo.planner.routing.tour_bound import one_tree, one_tree_bound, useful_edges
from tests.faults.sizes import size
from tests.planner.kernels import machine_code


def scattered(n: int, seed: int) -> np.ndarray:
    """Straight lengths between n points in a square of 100 m."""
    xy = np.random.default_rng(seed).uniform(0, 100, (n, 2))
    return np.hypot(*np.moveaxis(xy[:, None] - xy[None], -1, 0))


def any_lengths(n: int, seed: int) -> np.ndarray:
    """Symmetric lengths that keep no triangle inequality, with many of the same length."""
    upper = np.triu(np.random.default_rng(seed).integers(1, 12, (n, n)), 1).astype(float)
    return upper + upper.T


def shortest_of_all(cost: np.ndarray) -> int:
    orders = np.array([(0, *rest) for rest in permutations(range(1, len(cost)))])
    return int(cost[orders, np.roll(orders, -1, axis=1)].sum(axis=1).min())


# ---- the search ----


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 10, 14, 40])
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_a_tour_visits_every_point_once_from_the_first_in_one_direction(n: int, lengths) -> None:
    order = shortest_tour(lengths(n, n), seed=1)
    assert sorted(order.tolist()) == list(range(n))
    assert order[0] == 0
    assert n < 3 or order[1] < order[-1]


def test_nanometres_may_take_the_memory_of_the_lengths() -> None:
    lengths = scattered(300, 4)
    expected = nanometres(lengths)
    found = nanometres(lengths, in_place=True)
    assert np.array_equal(found, expected)
    assert np.shares_memory(found, lengths)


@pytest.mark.parametrize("n", [4, 5, 6, 7, 8])
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_comparing_subsets_finds_the_shortest_of_all_tours(n: int, lengths) -> None:
    for seed in range(4):
        cost = nanometres(lengths(n, seed))
        assert length_of(cost, best_of_all(cost)) == shortest_of_all(cost)


@pytest.mark.parametrize("n", [5, 12, 40])
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_one_trees_are_the_same_in_numpy_as_written_and_compiled(n: int, lengths) -> None:
    for seed in range(5):
        cost = nanometres(lengths(n, seed))
        weight = np.random.default_rng(seed).integers(-(10**10), 10**10, n)
        tree, found = one_tree(cost, weight), []
        for kernel in (grow, machine_code(grow)):
            scratch = np.zeros((4, n), dtype=np.int64)
            found.append((int(kernel(cost.ravel(), weight, *scratch)), scratch[3].tolist()))
        assert found == [(tree.value, tree.degree.tolist())] * 2


def test_a_long_tours_bound_is_near_the_tour() -> None:
    """By the ascent of Held and Karp; the tour searched is itself some tenths of a percent too long."""
    cost = nanometres(scattered(150, 1))
    best = length_of(cost, search(cost, trials(cost, 15_000, seed=1)))
    assert best * 0.98 < one_tree_bound(cost, best=best).value <= best


@pytest.mark.parametrize("n", [125, 200])
def test_the_bound_of_rooms_along_dead_ends_is_near_their_shortest_tour(n: int) -> None:
    """Which is known: into every room and to the end of every corridor, and back."""
    random = np.random.default_rng(1)
    corridor, along, deep = random.integers(0, 6, n) * 20.0, random.uniform(1, 60, n), random.uniform(1, 4, n)
    around = np.abs(corridor[:, None] - corridor) + along[:, None] + along
    beside = np.where(corridor[:, None] == corridor, np.abs(along[:, None] - along), around)
    lengths = (beside + deep[:, None] + deep) * ~np.eye(n, dtype=bool)
    ends = sum(along[corridor == x].max() for x in set(corridor.tolist()))
    best = int(nanometres(np.array([[2 * (deep.sum() + np.ptp(corridor) + ends)]]))[0, 0])
    assert best * 0.99 < one_tree_bound(nanometres(lengths), best=best).value <= best


@pytest.mark.parametrize("n", [10, 17, 30, 45])
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_compiled_and_interpreted_search_find_the_same_tour(n: int, lengths) -> None:
    cost = nanometres(lengths(n, n))
    perturbations = trials(cost, 15 * n, seed=3)
    interpreted = search(cost, perturbations, interpreted=True)
    assert np.array_equal(interpreted, search(cost, perturbations, interpreted=False))


def test_the_same_seed_finds_the_same_tour() -> None:
    lengths = scattered(60, 5)
    assert np.array_equal(shortest_tour(lengths, seed=4), shortest_tour(lengths, seed=4))


def test_a_circle_is_driven_round() -> None:
    turn = 2 * np.pi * np.arange(40) / 40
    xy = 10 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    mixed = np.random.default_rng(1).permutation(40)
    lengths = np.hypot(*np.moveaxis(xy[mixed][:, None] - xy[mixed][None], -1, 0))
    order = mixed[shortest_tour(lengths, seed=1)]
    assert set(np.abs(np.diff(order)).tolist()) <= {1, 39}


def test_points_at_the_same_place_are_visited_after_each_other() -> None:
    lengths = np.zeros((12, 12))
    lengths[:6, 6:] = lengths[6:, :6] = 5.0
    assert length_of(nanometres(lengths), shortest_tour(lengths, seed=1)) == 10_000_000_000


@pytest.mark.parametrize("seed", range(size(short=1, full=2)))
def test_two_hundred_points_are_within_one_percent_of_the_shortest_known(seed: int) -> None:
    lengths = scattered(200, seed)
    cost = nanometres(lengths)
    known = min(
        length_of(cost, search(cost, trials(cost, 40_000, seed=s), interpreted=False)) for s in (8, 9)
    )
    assert length_of(cost, shortest_tour(lengths, seed=1)) <= 1.01 * known


def test_lengths_that_overflow_are_refused() -> None:
    with pytest.raises(InputError, match=r"a path of 1e\+10 m between 2 stops"):
        nanometres(np.array([[0.0, 1e10], [1e10, 0.0]]))


# ---- bounds and proofs ----


def test_a_one_tree_of_a_square_and_its_middle() -> None:
    # Tree of the square's corners: three sides of 2 m; the middle, the last point, is sqrt(2) from each.
    xy = np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 1)], dtype=float)
    cost = nanometres(np.hypot(*np.moveaxis(xy[:, None] - xy[None], -1, 0)))
    tree = one_tree(cost, np.zeros(5, dtype=np.int64))
    assert tree.value == 6_000_000_000 + 2 * int(np.sqrt(2) * 1e9)
    assert tree.degree.sum() == 10


@pytest.mark.parametrize("n", [4, 5, 6, 7, 8])
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_no_tour_is_shorter_than_the_one_tree_bound(n: int, lengths) -> None:
    for seed in range(6):
        cost = nanometres(lengths(n, seed))
        shortest = shortest_of_all(cost)
        tree = one_tree_bound(cost, best=shortest)
        assert tree.value <= shortest
        best = best_of_all(cost)
        assert useful_edges(tree, best=shortest)[best, np.roll(best, -1)].all()


@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_branching_proves_what_comparing_all_tours_finds(lengths, monkeypatch: pytest.MonkeyPatch) -> None:
    for n in (6, 8, 10):
        for seed in range(6):
            cost = nanometres(lengths(n, seed))
            shortest = length_of(cost, best_of_all(cost))
            poor = np.random.default_rng(seed).permutation(n)
            with monkeypatch.context() as patched:
                patched.setattr("stopgo.planner.routing.proof.COMPARE_ALL_UP_TO", 3)
                proof = tour_proof(cost, poor)
            assert proof.closed
            assert proof.bound <= shortest <= proof.length <= shortest + 1_000


@pytest.mark.parametrize("n", [13, 20, 35, 50])
@pytest.mark.parametrize("seed", range(4))
def test_tours_up_to_fifty_points_are_proved_optimal(n: int, seed: int) -> None:
    lengths = scattered(n, seed)
    cost = nanometres(lengths)
    order = shortest_tour(lengths, seed=1)
    proof = tour_proof(cost, order)
    assert proof.closed
    assert length_of(cost, order) == proof.length  # the search alone has found it


def test_a_poor_tour_is_replaced_unless_it_is_to_be_kept() -> None:
    cost = nanometres(scattered(25, 2))
    poor = np.arange(25)
    proof = tour_proof(cost, poor)
    kept = tour_proof(cost, poor, improve=False)
    assert proof.closed
    assert length_of(cost, proof.order) == proof.length < length_of(cost, poor)
    assert np.array_equal(proof.order, canonical(proof.order))
    assert np.array_equal(kept.order, poor)
    assert kept.length == length_of(cost, poor)
    assert kept.bound == proof.bound
    assert not kept.closed


def test_the_bound_holds_when_the_search_for_a_proof_is_cut_short(monkeypatch: pytest.MonkeyPatch) -> None:
    cost = nanometres(any_lengths(30, 1))
    full = tour_proof(cost, np.arange(30))
    for limit in (0, 1, 2, 3, 5, 8):
        monkeypatch.setattr("stopgo.planner.routing.proof.SOLVE_LIMIT", limit)
        assert tour_proof(cost, np.arange(30)).bound <= full.length


def test_every_tour_keeps_every_cut() -> None:
    random = np.random.default_rng(7)
    edges = np.stack(np.triu_indices(7, 1), axis=1)
    number = {tuple(edge): k for k, edge in enumerate(edges.tolist())}
    tours = []
    for rest in permutations(range(1, 7)):
        used = np.zeros(len(edges), dtype=np.int64)
        for a, b in pairwise((0, *rest, 0)):
            used[number[min(a, b), max(a, b)]] = 1
        tours.append(used)
    for _ in range(30):
        share = np.clip(random.choice([0.0, 0.25, 0.5, 1.0], len(edges)), 0, 1)
        for cut in violated_cuts(7, edges, share):
            assert all(cut.times @ used >= cut.least for used in tours)
            assert cut.times @ share < cut.least


# ---- fixed ends ----

ENDS = {
    "closed": Ends(None, None, closed=True, reason=""),
    "open": Ends(None, None, closed=False, reason=""),
    "first": Ends(2, None, closed=False, reason=""),
    "last": Ends(None, 3, closed=False, reason=""),
    "both": Ends(1, 4, closed=False, reason=""),
}


@pytest.mark.parametrize("kind", ENDS)
@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_a_shortest_tour_of_the_matrix_is_a_shortest_path(kind: str, lengths) -> None:
    ends = ENDS[kind]
    for seed in range(5):
        given = lengths(6, seed)
        cost = nanometres(tour_matrix(given, ends))
        found = length_of(cost, best_of_all(cost)) / 1e9 - far_edge(given, ends)
        assert found == pytest.approx(shortest_path(given, ends), abs=1e-7)


def shortest_path(lengths: np.ndarray, ends: Ends) -> float:
    best = np.inf
    for path in permutations(range(len(lengths))):
        if ends.first not in (None, path[0]) or ends.last not in (None, path[-1]):
            continue
        closing = lengths[path[-1], path[0]] if ends.closed else 0.0
        best = min(best, closing + sum(lengths[a, b] for a, b in pairwise(path)))
    return float(best)
