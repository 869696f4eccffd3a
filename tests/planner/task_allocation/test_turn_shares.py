"""Shares of turns are never more than the turn, and all of it where every leg leaves by one door."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stopgo.planner.task_allocation.turn_shares import turn_shares
from tests.planner.task_allocation.test_dividing import WORLDS, clock_of, route_of


def turned(come: float, go: float, scan: float | None) -> float:
    """Radians from arriving against the heading `come` to leaving by `go`."""
    if scan is None:
        return abs(math.remainder(come + math.pi - go, math.tau))
    one, other = (abs(math.remainder(angle - scan, math.tau)) for angle in (come + math.pi, go))
    return one + other


@pytest.mark.parametrize("scan", [None, 1.0])
@pytest.mark.parametrize("seed", range(20))
def test_two_legs_never_share_more_than_the_turn_between_them(seed: int, scan: float | None) -> None:
    random = np.random.default_rng(seed)
    away = random.uniform(-math.pi, math.pi, int(random.integers(1, 12)))
    shares = turn_shares(away, turn_rate=0.5, scan=scan)
    for a, one in zip(away, shares, strict=True):
        for b, other in zip(away, shares, strict=True):
            least = min(turned(a, b, scan), turned(b, a, scan)) / 0.5
            assert one + other <= least + 1e-9


def test_legs_out_of_one_door_share_half_a_turn() -> None:
    shares = turn_shares(np.array([0.3, 0.3, 0.3]), turn_rate=1.0)
    assert shares == pytest.approx(np.full(3, math.pi / 2))


def test_legs_along_a_corridor_share_none_and_those_into_a_room_all() -> None:
    shares = turn_shares(np.array([0.0, math.pi, math.pi / 2]), turn_rate=1.0)
    assert shares == pytest.approx([0.0, 0.0, math.pi / 2])


@pytest.mark.parametrize("world", WORLDS)
def test_times_with_shares_are_the_same_in_both_directions_to_the_last_bit(world: str) -> None:
    turned_s = clock_of(route_of(world)).turned_s
    assert (turned_s == turned_s.T).all()
