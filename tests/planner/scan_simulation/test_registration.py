"""Registration of two simulated scans: the coarse stage reaches far, and what it finds is doubted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray, frozen
from stopgo.planner.scan_simulation import registration
from stopgo.planner.scan_simulation.registration import STAGES, OrientedCloud, _CloudPair, _shift

FAR = 0.64
"""Metres by which a pose 2° and 5 cm off moves points 17 m away."""


def walls(at: FloatArray) -> OrientedCloud:
    """Two walls of 4 m and 2.5 m height at a right angle, as the scanner at `at` (3,) sees them."""
    along, height = (part.ravel() for part in np.meshgrid(np.arange(0, 4, 0.1), np.arange(-1, 1.5, 0.1)))
    none = np.zeros(len(along))
    points = np.concatenate([np.column_stack([along, none, height]), np.column_stack([none, along, height])])
    normals = np.repeat([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], len(along), axis=0)
    return OrientedCloud(frozen(points - at), frozen(normals))


@pytest.fixture
def two() -> _CloudPair:
    one, other = np.array([3.0, 2.0, 0.0]), np.array([1.0, 3.0, 0.0])
    return _CloudPair(walls(one), walls(other), _shift(other - one))


def aligned(
    two: _CloudPair, monkeypatch: pytest.MonkeyPatch, *, coarse: FloatArray, fine: FloatArray
) -> tuple[FloatArray, int]:
    """The pose that counts, of one found with a coarse stage and one without; and how many were sought."""
    sought: list[int] = []

    def found(self: _CloudPair, there: FloatArray, stages: Sequence[object]) -> FloatArray:
        sought.append(len(stages))
        return coarse if len(stages) > len(STAGES) else fine

    monkeypatch.setattr(registration._CloudPair, "_aligned", found)
    return two.aligned(two.truth, moved_m=FAR), len(sought)


def test_of_two_poses_the_one_that_brings_more_points_together_counts(
    two: _CloudPair, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = _shift(np.array([0.66, 0.3, 0.0])) @ two.truth
    found, _ = aligned(two, monkeypatch, coarse=wrong, fine=two.truth)
    assert two.error(found) == (0.0, 0.0)
    found, _ = aligned(two, monkeypatch, coarse=two.truth, fine=wrong)
    assert two.error(found) == (0.0, 0.0)


def test_a_pose_that_brings_most_points_together_is_not_doubted(
    two: _CloudPair, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert aligned(two, monkeypatch, coarse=two.truth, fine=two.truth)[1] == 1
    far = _shift(np.array([3.0, 3.0, 0.0])) @ two.truth
    assert aligned(two, monkeypatch, coarse=far, fine=two.truth)[1] == 2
