"""Predicted errors of scans in a network: numbers that can be checked on paper."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages.network import FLOOR_M, NOISE_M, predicted_error_m
from stopgo.planner import plan
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.overlap.network_error import information_of, scan_covariances, worst_errors
from stopgo.planner.overlap.pairs import LEVER_M
from stopgo.planner.overlap.registered import predicted_errors, registered_pairs
from tests.planner.worlds import two_rooms

HERE = np.zeros((4, 2))
ONE = np.diag([1e6, 1e6, 1e6])
"""A pair with 1 mm in x and y, and 1 mrad."""


def errors_of(*given: Any) -> FloatArray:
    """Standard deviation of each scan in its worst direction."""
    return worst_errors(scan_covariances(*given))


def test_a_chain_drifts_by_the_root_of_its_pairs() -> None:
    errors = errors_of(HERE, [(0, 1), (1, 2), (2, 3)], [ONE] * 3, [0])
    assert errors.tolist() == pytest.approx([0.0, 1e-3, math.sqrt(2) * 1e-3, math.sqrt(3) * 1e-3])


def test_a_loop_lowers_the_error() -> None:
    """Round a loop of four, two pairs in series lie next to two more: 1 mm instead of √2 mm."""
    errors = errors_of(HERE, [(0, 1), (1, 2), (2, 3), (3, 0)], [ONE] * 4, [0])
    assert errors[2] == pytest.approx(1e-3)
    assert errors[1] == errors[3] == pytest.approx(math.sqrt(3) / 2 * 1e-3)


def test_a_rotation_moves_what_lies_far_away() -> None:
    """1 mrad at 10 m is 10 mm, besides 1 mm of the position itself."""
    xy = np.array([(0.0, 0.0), (0.0, 0.0), (10.0, 0.0)])
    certain = 1e12 * np.eye(3)
    errors = errors_of(xy, [(0, 1), (1, 2)], [ONE, certain], [0])
    assert errors[2] == pytest.approx(math.hypot(1e-3, 10e-3), rel=1e-3)


def test_two_anchors_hold_a_chain_at_both_ends() -> None:
    errors = errors_of(HERE[:3], [(0, 1), (1, 2)], [ONE] * 2, [0, 2])
    assert errors.tolist() == pytest.approx([0.0, math.sqrt(0.5) * 1e-3, 0.0])


def test_a_scan_that_nothing_joins_has_no_finite_error() -> None:
    assert errors_of(HERE[:3], [(0, 1)], [ONE], [0])[2] == math.inf


@pytest.mark.parametrize("at", [(0.0, 0.0), (30.0, -20.0)])
def test_the_information_of_a_pair_is_that_of_its_walls_wherever_the_origin_is(
    at: tuple[float, float],
) -> None:
    """9 m of wall facing each way: a third of the noise of one metre, and the error of the cloud."""
    point = np.array(at)
    about = np.diag([9.0, 9.0, 9.0 * LEVER_M**2])
    to_point = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]], [0.0, 0.0, 1.0]])
    moments: FloatArray = to_point.T @ about @ to_point
    errors = errors_of(np.array([point, point]), [(0, 1)], [information_of(moments, point, 1.0)], [0])
    assert errors[1] == pytest.approx(math.hypot(NOISE_M / 3, FLOOR_M), rel=1e-6)
    noisy = errors_of(np.array([point, point]), [(0, 1)], [information_of(moments, point, 3.0)], [0])
    assert noisy[1] == pytest.approx(3 * errors[1], rel=1e-6)


def test_a_plan_reports_the_worst_predicted_error() -> None:
    made = plan(two_rooms(0.9), Settings(overlap=0.1)).first
    errors = predicted_errors(made.route).m
    (pair,) = registered_pairs(made.route)
    assert sorted(errors > 0) == [False, True]
    assert errors.max() < 2 * predicted_error_m(pair.hold_m, 1.0)
    line = f"at s0{int(np.argmax(errors)) + 1}: {1000 * errors.max():.1f} mm (standard deviation)"
    assert line in PlanReport(made, {}, {}).as_text()
