"""Registration of two simulated scans: the heading is found among those within its error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.proof.plan_proof import Simulation, within_tolerance
from stopgo.planner.scan_simulation.near_kernel import mark_near
from stopgo.planner.scan_simulation.registration import OrientedCloud, _CloudPair, _shift, _turned, surface_of
from tests.planner.kernels import interpret, machine_code

SIMULATION = Simulation(range_m=20.0, ceiling_m=2.5)


def walls(at: FloatArray) -> OrientedCloud:
    """Two walls of 4 m and 2.5 m height at a right angle, as the scanner at `at` (3,) sees them."""
    along, height = (part.ravel() for part in np.meshgrid(np.arange(0, 4, 0.1), np.arange(-1, 1.5, 0.1)))
    none = np.zeros(len(along))
    points = np.concatenate([np.column_stack([along, none, height]), np.column_stack([none, along, height])])
    normals = np.repeat([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], len(along), axis=0)
    return OrientedCloud(frozen(points - at), frozen(normals))


def columns(at: FloatArray) -> OrientedCloud:
    """What a scanner at `at` (3,) sees of a row of square columns of 0.4 m, 0.9 m apart and 18 m away."""
    along, height = (
        part.ravel() for part in np.meshgrid(np.arange(-0.2, 0.2, 0.05), np.arange(-1, 1.5, 0.05))
    )
    found = []
    for y in np.arange(-3, 3.5, 0.9):
        for facing in (np.array([-1.0, 0.0]), np.array([0.0, 1.0]), np.array([0.0, -1.0])):
            aside = np.array([-facing[1], facing[0]])
            xy = np.array([18.0, y]) + 0.2 * facing + along[:, None] * aside
            if ((at[:2] - xy[0]) @ facing) > 0:
                found.append((np.column_stack([xy, height]), np.tile([*facing, 0.0], (len(along), 1))))
    points, normals = (np.concatenate(part) for part in zip(*found, strict=True))
    return OrientedCloud(frozen(points - at), frozen(normals))


@pytest.fixture
def two() -> _CloudPair:
    one, other = np.array([3.0, 2.0, 0.0]), np.array([1.0, 3.0, 0.0])
    return _CloudPair(walls(one), walls(other), _shift(other - one))


@pytest.mark.parametrize("degrees", [-2.0, -0.7, 0.0, 1.3, 2.0])
def test_the_heading_within_its_error_that_brings_most_points_together_begins(
    two: _CloudPair, degrees: float
) -> None:
    """The farthest points lie 3 m away: headings 1° apart move them by less than 0.1 m."""
    start = _shift(np.array([0.03, -0.04, 0.0])) @ two.truth @ _turned(math.radians(degrees))
    _, off_deg = two.error(two._headed(start, SIMULATION))
    assert off_deg <= min(abs(degrees), 1.0) + 1e-9


@pytest.mark.parametrize("shift", [(0.05, 0.0), (-0.03, 0.04)])
@pytest.mark.parametrize("degrees", [-2.0, 2.0])
def test_no_column_is_taken_for_the_next_one_of_a_row(shift: tuple[float, float], degrees: float) -> None:
    """2° move a column 18 m away by more than its own width: the nearest surface is that of another side."""
    one, other = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.5, 0.0])
    two = _CloudPair(columns(one), columns(other), _shift(other - one))
    start = _shift(np.array([*shift, 0.0])) @ two.truth @ _turned(math.radians(degrees))
    assert within_tolerance(*two.error(two.aligned(start, SIMULATION)))


def scattered(seed: int) -> OrientedCloud:
    """Points and directions at random."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(1500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return OrientedCloud(frozen(random.uniform(-2, 2, (1500, 3))), frozen(normals))


@pytest.mark.parametrize("within", [0.2, 0.35])
def test_points_near_one_another_are_the_same_by_every_way_to_look_them_up(
    within: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other, there = scattered(1), scattered(2), _shift(np.array([1.0, 0.5, 0.0])) @ _turned(0.3)
    ways = [one.buckets.near(way, other._both(there), within) for way in (mark_near, machine_code(mark_near))]
    interpret(monkeypatch)
    ways.append(one.near_each_other(other, there, within))
    for masks in zip(*ways, strict=True):
        assert 0 < masks[0].sum() < len(masks[0])
        np.testing.assert_array_equal(masks[0], masks[1])
        np.testing.assert_array_equal(masks[0], masks[2])


def test_level_surfaces_are_thinned_where_a_pose_is_known() -> None:
    across = np.stack(np.meshgrid(np.arange(-3, 3, 0.02), np.arange(-3, 3, 0.02)), axis=-1).reshape(-1, 2)
    ground = np.column_stack([across, np.full(len(across), -1.3)])
    wall = np.column_stack([np.full(len(across), 3.0), across[:, 0], across[:, 1] / 3])
    cloud = np.concatenate([ground, wall])
    thinned, whole = (surface_of(cloud, replace(SIMULATION, poses=poses)) for poses in (True, False))
    assert thinned.upright.sum() == whole.upright.sum() > 0
    assert 0 < (~thinned.upright).sum() <= (~whole.upright).sum() / 9
