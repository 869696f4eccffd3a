"""Visibility along walls of up to a kilometre: machine code, Python and exact sight lines agree."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.planner.geometry.shapes import GRID, to_grid
from stopgo.planner.visibility.sight.kernel import FARTHEST, MOST_UNITS, not_negative, within_reach
from stopgo.planner.visibility.sight.sight import scene_of, sight
from tests.faults.sizes import size, some
from tests.planner.kernels import machine_code
from tests.planner.long_walls import RANGES, told
from tests.planner.visibility.sight.test_sight import World

COORDINATE = 2**29


@pytest.mark.parametrize("reach", some(RANGES, every=2))
def test_long_walls_are_seen_as_far_as_the_range_and_no_farther(
    reach: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [
        told(seed, reach=reach, places=15, monkeypatch=monkeypatch) for seed in range(size(short=2, full=4))
    ]
    pairs, *wrong = np.sum(found, axis=0)
    assert pairs > size(short=2500, full=5000)
    assert wrong == [0, 0]


@pytest.mark.parametrize("speed", ["compiled", "interpreted"])
def test_a_unit_a_millimetre_beyond_the_range_is_not_seen(speed: str) -> None:
    tell = machine_code(within_reach) if speed == "compiled" else within_reach
    ends = (20_856_540, 388_530, 20_856_540 - 20_978_260, 388_530 + 7500)
    assert not tell(*ends, 8211, 8392, 500_000)
    assert tell(*ends, 8391, 8392, 500_000)


def test_the_greatest_numbers_are_reported_as_in_python() -> None:
    """At the bounds of what is let in: one more bit, and products would not fit."""
    pieces, turn = 2 * MOST_UNITS, 2 * (2 * COORDINATE) ** 2
    fast = machine_code(not_negative), machine_code(within_reach)
    for odd in (1, pieces // 2 - 1, pieces - 1):
        for at_a, at_b in itertools.product((-turn, -turn + 1, -1, 0, turn - 1, turn), repeat=2):
            truth = (pieces - odd) * at_a + odd * at_b >= 0
            assert fast[0](at_a, at_b, odd, pieces) == not_negative(at_a, at_b, odd, pieces) == truth
        for ends in itertools.product((-2 * COORDINATE, 1, 2 * COORDINATE), repeat=4):
            x, y = ((pieces - odd) * ends[k] + odd * ends[k + 2] for k in range(2))
            for reach in (0, 2 * COORDINATE, FARTHEST - 1, FARTHEST):
                truth = x * x + y * y <= (pieces * reach) ** 2
                assert fast[1](*ends, odd, pieces, reach) == within_reach(*ends, odd, pieces, reach) == truth


def test_what_would_not_be_exact_is_refused() -> None:
    with pytest.raises(InputError, match="lies 5369 m from"):
        to_grid(np.array([[5369.0, 0.0]]))
    with pytest.raises(InputError, match="lies nan m from"):
        to_grid(np.array([[np.nan, 0.0]]))
    assert to_grid(np.array([COORDINATE * GRID])) == COORDINATE
    world = World([], np.array([[(0.0, 0.0), (1.0, 0.0)]]), np.empty((0, 2)))
    with pytest.raises(InputError, match="units on one face"):
        scene_of(world.scene().mesh, world.a, world.b, np.array([MOST_UNITS + 1]), world.is_face)


def test_a_range_beyond_everything_is_no_range() -> None:
    world = World([], np.array([[(0.0, 0.0), (1.0, 0.0)]]), np.array([[5.0, 5.0]]))
    far, none = (sight(world.scene(), world.viewpoints, reach=reach) for reach in (1e6, None))
    assert far.high.tolist() == none.high.tolist() == [3]
