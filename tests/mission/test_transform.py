"""The one transform: points, inverse and composition agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stopgo.mission.frames.transform import SAME, Transform

QUARTER = Transform(x=10.0, y=20.0, heading=math.pi / 2)
OTHER = Transform(x=-3.0, y=1.5, heading=-2.5)


def test_an_array_is_transformed_like_its_points() -> None:
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    assert QUARTER.points(points) == pytest.approx(np.array([QUARTER.point((x, y)) for x, y in points]))


def test_the_inverse_and_back_undo_a_transform() -> None:
    there = QUARTER.point((1.0, 2.0))
    assert there == pytest.approx((8.0, 21.0))
    assert QUARTER.inverse.point(there) == pytest.approx((1.0, 2.0)) == QUARTER.back(there)
    both = QUARTER.after(QUARTER.inverse)
    assert (both.x, both.y, both.heading) == pytest.approx((SAME.x, SAME.y, SAME.heading))


def test_a_composition_does_one_after_the_other() -> None:
    both = QUARTER.after(OTHER)
    assert both.point((4.0, 5.0)) == pytest.approx(QUARTER.point(OTHER.point((4.0, 5.0))))
    assert both.heading == pytest.approx(math.pi / 2 - 2.5)


def test_a_transform_brings_a_point_onto_another() -> None:
    assert Transform.bringing((1.0, 2.0), (7.0, 8.0), 0.3).point((1.0, 2.0)) == pytest.approx((7.0, 8.0))
