"""The ant colony: a tour of every point, the same by seed, and good where tours are short."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.routing import Ends, tour_matrix
from stopgo.planner.routing.colony import ant_colony
from stopgo.planner.routing.subsets import best_of_all
from stopgo.planner.routing.tour import length_of, nanometres
from tests.planner.routing.test_tour import any_lengths, scattered


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 60])
def test_ants_visit_every_point_once(n: int) -> None:
    order = ant_colony(scattered(n, n), seed=1)
    assert sorted(order.tolist()) == list(range(n))
    assert order[0] == 0


@pytest.mark.parametrize("lengths", [scattered, any_lengths])
def test_ants_find_short_tours(lengths) -> None:
    for seed in range(5):
        cost = nanometres(lengths(10, seed))
        found = length_of(cost, ant_colony(lengths(10, seed), seed=seed))
        assert found <= 1.05 * length_of(cost, best_of_all(cost))


def test_the_same_seed_sends_the_same_ants() -> None:
    lengths = scattered(30, 3)
    assert np.array_equal(ant_colony(lengths, seed=2), ant_colony(lengths, seed=2))


def test_points_at_the_same_place_do_not_stop_the_ants() -> None:
    assert sorted(ant_colony(np.zeros((6, 6)), seed=1).tolist()) == list(range(6))


@pytest.mark.parametrize("first, last", [(None, None), (4, None), (None, 2), (4, 2)])
@pytest.mark.parametrize("n", [5, 25])
def test_ants_keep_the_ends_of_a_path(first: int | None, last: int | None, n: int) -> None:
    ends = Ends(first, last, closed=False, reason="")
    order = ant_colony(tour_matrix(scattered(n, 9), ends), seed=1).tolist()
    at = order.index(n)
    beside = {order[at - 1], order[(at + 1) % len(order)]}
    assert beside >= {end for end in (first, last) if end is not None}
