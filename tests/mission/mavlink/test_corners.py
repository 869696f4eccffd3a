"""Which points of a leg become waypoints."""

from __future__ import annotations

from itertools import pairwise

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mission.mavlink.corners import corners

PLACE = st.tuples(st.floats(-20, 20), st.floats(-20, 20))


def test_points_on_a_straight_line_are_left_out():
    assert corners([(0, 0), (1, 0), (2, 0.019), (3, 0)], within=0.02) == ((0, 0), (3, 0))


def test_a_right_angle_stays():
    assert corners([(0, 0), (2, 0), (2, 2)], within=0.02) == ((0, 0), (2, 0), (2, 2))


def test_a_flat_bend_beyond_the_limit_stays():
    assert corners([(0, 0), (2, 0.021), (4, 0)], within=0.02) == ((0, 0), (2, 0.021), (4, 0))


def test_a_way_there_and_back_is_not_shortened():
    assert corners([(0, 0), (5, 0), (1, 0)], within=0.02) == ((0, 0), (5, 0), (1, 0))


@pytest.mark.parametrize("leg", [[], [(1.0, 2.0)], [(1.0, 2.0), (1.0, 2.0)]])
def test_a_leg_of_one_place_has_only_that(leg):
    assert corners(leg, within=0.02) == tuple(leg)


@given(leg=st.lists(PLACE, min_size=2, max_size=8), within=st.floats(0, 2))
def test_the_ends_stay_and_no_line_runs_farther_from_the_leg_than_allowed(leg, within):
    kept = corners(leg, within=within)
    assert (kept[0], kept[-1]) == (leg[0], leg[-1])
    whole = shapely.LineString(leg)
    for (x0, y0), (x1, y1) in pairwise(kept):
        line = [(x0 + (x1 - x0) * part / 50, y0 + (y1 - y0) * part / 50) for part in range(51)]
        assert all(shapely.Point(point).distance(whole) <= within + 1e-9 for point in line)
