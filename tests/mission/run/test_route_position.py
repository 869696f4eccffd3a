"""The way that a mission has laid down, by numbers that can be checked on paper."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.run.route_position import foot


@pytest.mark.parametrize(("here", "metres"), [((2.0, 1.0), 1.0), ((-3.0, 4.0), 5.0), ((7.0, 4.0), 5.0)])
def test_deviation_from_a_straight_is_the_distance_from_it(here: tuple[float, float], metres: float) -> None:
    assert math.dist(here, foot((0.0, 0.0), (4.0, 0.0), here)) == pytest.approx(metres)
