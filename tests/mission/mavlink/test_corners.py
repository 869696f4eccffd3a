"""Points of a leg that become waypoints."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from stopgo.mission.mavlink.corners import corners

METRES = st.integers(-20_000_000, 20_000_000).map(lambda micrometres: micrometres / 1e6)
PLACE = st.tuples(METRES, METRES)


def test_points_on_a_straight_line_are_left_out():
    assert corners([(0, 0), (1, 0), (2, 0.015), (3, 0)], within=0.02) == ((0, 0), (3, 0))


def test_a_right_angle_stays():
    assert corners([(0, 0), (2, 0), (2, 2)], within=0.02) == ((0, 0), (2, 0), (2, 2))


def test_a_flat_bend_beyond_the_limit_stays():
    assert corners([(0, 0), (2, 0.021), (4, 0)], within=0.02) == ((0, 0), (2, 0.021), (4, 0))


def test_of_equally_few_corners_those_nearest_to_the_leg_stay():
    leg = [(0, 0), (2, 0), (2.1, 0.1), (2.2, 2)]
    assert corners(leg, within=0.2) == ((0, 0), (2, 0), (2.2, 2))


def test_a_path_there_and_back_is_not_shortened():
    assert corners([(0, 0), (5, 0), (1, 0)], within=0.02) == ((0, 0), (5, 0), (1, 0))


@pytest.mark.parametrize("leg", [[], [(1.0, 2.0)], [(1.0, 2.0), (1.0, 2.0)]])
def test_a_leg_of_one_place_has_only_that(leg):
    assert corners(leg, within=0.02) == tuple(leg)


def arc(radius: float, step_deg: float) -> list[tuple[float, float]]:
    """A quarter turn as a planner draws it: corners outside a circle, straight pieces before and after."""
    outside = radius / math.cos(math.radians(step_deg / 2))
    turns = [math.radians(step_deg * (part + 0.5)) for part in range(round(90 / step_deg))]
    bend = [(outside * math.sin(turn), radius - outside * math.cos(turn)) for turn in turns]
    return [(-3.0, 0.0), *bend, (radius, 3.0)]


@pytest.mark.parametrize(("within", "count"), [(0.001, 4), (0.01, 3), (0.02, 2), (0.05, 2), (0.08, 1)])
def test_an_arc_takes_fewer_corners_the_farther_it_may_be_left(within, count):
    """Round 0.35 m in pieces of 22.5°: two corners 1.4 cm outside, with lines 1.4 cm inside, do for 2 cm."""
    left = arc(0.35, 22.5)
    right = [(x, -y) for x, y in left]
    assert [len(corners(leg, within=within)) for leg in (left, right)] == [2 + count, 2 + count]


def test_a_long_fine_curve_is_thinned():
    turns = [math.tau * part / 2000 for part in range(2001)]
    circle = [(10 * math.cos(turn), 10 * math.sin(turn)) for turn in turns]
    # A line that leaves a circle of 10 m by 2 cm to either side spans 2 acos(9.98 / 10.02), 10.2°: 36 in all.
    assert 36 <= len(corners(circle, within=0.02)) <= 40


@given(leg=st.lists(PLACE, min_size=2, max_size=8), within=st.floats(0, 2))
def test_the_ends_stay_and_no_line_runs_farther_from_the_leg_than_allowed(leg, within):
    kept = corners(leg, within=within)
    assert (kept[0], kept[-1]) == (leg[0], leg[-1])
    assert len(kept) <= len(leg)
    assume(len(set(leg)) > 1)
    whole, driven = shapely.LineString(leg), shapely.LineString(kept)
    assert all(shapely.Point(point).distance(driven) <= within + 1e-9 for point in leg)
    for (x0, y0), (x1, y1) in pairwise(kept):
        line = [(x0 + (x1 - x0) * part / 50, y0 + (y1 - y0) * part / 50) for part in range(51)]
        assert all(shapely.Point(point).distance(whole) <= within + 1e-9 for point in line)
