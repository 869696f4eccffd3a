"""A schedule's numbers, each checkable on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule, straight_time, turn_time
from stopgo.mission.document.straight_times import straight_times
from tests.mission.worlds import mission_of, square_tour, stop


def test_a_long_straight_is_a_trapezoid() -> None:
    # 0.5 m while speeding up (1 s), 3 m at 1 m/s (3 s), 0.5 m while braking (1 s).
    assert straight_time(4.0, speed=1.0, acceleration=1.0) == 5.0


def test_a_short_straight_is_a_triangle() -> None:
    assert straight_time(0.25, speed=1.0, acceleration=1.0) == 1.0


def test_trapezoid_and_triangle_meet_where_speed_is_just_reached() -> None:
    short = straight_time(0.5 - 1e-12, speed=0.5, acceleration=0.5)
    assert short == pytest.approx(straight_time(0.5, speed=0.5, acceleration=0.5))


def test_many_straights_take_what_each_takes() -> None:
    lengths = np.concatenate([[0.0, 0.25, 0.5], np.random.default_rng(1).uniform(0, 3, 200)])
    each = [straight_time(length, speed=0.5, acceleration=0.5) for length in lengths.tolist()]
    assert straight_times(lengths, speed=0.5, acceleration=0.5).tolist() == each


def test_a_turn_goes_the_short_way_round() -> None:
    assert turn_time(math.radians(350), turn_rate=math.radians(10)) == pytest.approx(1.0)
    assert turn_time(math.pi, turn_rate=math.pi) == 1.0


def test_a_square_tour_adds_up() -> None:
    plan = schedule(square_tour())
    assert plan.drive_s == pytest.approx((4 + 1) + (3 + 1) + (5 + 1))
    # Facing +x already; left by 90°; then from +y round to the start, 180° - atan(4/3) = 126.87°.
    assert plan.turn_s == pytest.approx(1 + math.degrees(math.pi - math.atan2(4, 3)) / 90)
    assert plan.settle_s == 4.0
    assert plan.scan_s == 120.0
    assert plan.arrival_s == pytest.approx((5.0, 5 + 62 + 1 + 4))


def test_the_first_turn_is_from_the_heading_at_the_start() -> None:
    behind = mission_of(stop("S1", (0.0, 0.0), (-4.0, 0.0), heading=math.pi))
    assert schedule(behind).turn_s == pytest.approx(2.0)


def test_a_stop_whose_heading_is_not_the_driven_one_costs_a_turn() -> None:
    assert schedule(mission_of(stop("S1", (0.0, 0.0), (4.0, 0.0), heading=-math.pi / 2))).turn_s == 1.0


def test_a_corner_stops_the_robot() -> None:
    straight = mission_of(stop("S1", (0.0, 0.0), (4.0, 0.0)))
    bent = mission_of(stop("S1", (0.0, 0.0), (2.0, 0.0), (2.0, 2.0), heading=math.pi / 2))
    assert schedule(bent).drive_s == schedule(straight).drive_s + 1.0
    assert schedule(bent).turn_s == 1.0


@pytest.mark.parametrize("approach", [((0.0, 0.0),), ((0.0, 0.0), (0.0, 0.0))])
def test_a_stop_at_the_start_takes_no_driving(approach: tuple[tuple[float, float], ...]) -> None:
    plan = schedule(mission_of(stop("S1", *approach)))
    assert (plan.drive_s, plan.turn_s, plan.arrival_s) == (0.0, 0.0, (0.0,))


def test_no_stops_take_no_time() -> None:
    empty: Mission = mission_of()
    assert schedule(empty).total_s == 0.0
