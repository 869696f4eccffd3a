"""Normal equations of networks against the dense inverse of the same matrix."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.overlap.network_error import network_errors, scan_covariances
from stopgo.planner.overlap.normal_equations import NormalEquations


def network(count: int, links: int, seed: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """Blocks of random pairs, some of them twice; with few pairs some scans hang on none."""
    random = np.random.default_rng(seed)
    ends = random.integers(0, count, (links, 2))
    ends = ends[ends[:, 0] != ends[:, 1]]
    normals = random.normal(size=(len(ends), 5, 3))
    information = normals.transpose(0, 2, 1) @ normals
    own = np.tile(0.1 * np.eye(3), (count, 1, 1))
    for side in ends.T:
        np.add.at(own, side, information)
    return own, ends, -information


def dense(own: FloatArray, ends: IntArray, coupling: FloatArray) -> FloatArray:
    """The same matrix (3n, 3n), written out."""
    count = len(own)
    matrix = np.zeros((count, 3, count, 3))
    for k in range(count):
        matrix[k, :, k] = own[k]
    for (a, b), block in zip(ends, coupling, strict=True):
        matrix[a, :, b] += block
        matrix[b, :, a] += block.T
    return matrix.reshape(3 * count, 3 * count)


SIZES = [(1, 0), (2, 0), (2, 1), (5, 20), (12, 8), (40, 90), (60, 400)]


@pytest.mark.parametrize(("count", "links"), SIZES)
def test_the_inverse_at_each_scan_is_that_of_the_whole_matrix(count: int, links: int) -> None:
    own, ends, coupling = network(count, links, seed=links)
    whole = np.linalg.inv(dense(own, ends, coupling)).reshape(count, 3, count, 3)
    found = NormalEquations(own, ends, coupling).inverse_at_scans()
    assert np.allclose(found, [whole[k, :, k] for k in range(count)], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("count", "links"), SIZES)
def test_a_solution_is_that_of_the_whole_matrix(count: int, links: int) -> None:
    own, ends, coupling = network(count, links, seed=links)
    right = np.random.default_rng(count).normal(size=(count, 3, 2))
    found = NormalEquations(own, ends, coupling).solved(right)
    assert np.allclose(dense(own, ends, coupling) @ found.reshape(3 * count, 2), right.reshape(3 * count, 2))


def test_no_scans_have_no_inverse() -> None:
    equations = NormalEquations(np.empty((0, 3, 3)), np.empty((0, 2), dtype=np.int64), np.empty((0, 3, 3)))
    assert equations.inverse_at_scans().shape == (0, 3, 3)
    assert equations.solved(np.empty((0, 3, 1))).shape == (0, 3, 1)


def test_the_frame_of_another_scan_gives_what_its_own_equations_give() -> None:
    """A ladder of 30 scans: errors in the chosen frame, and with that scan as the anchor from the start."""
    xy = np.array([(3.0 * (k // 2), 4.0 * (k % 2)) for k in range(30)])
    ends = [(k, k + step) for k in range(30) for step in (1, 2) if k + step < 30]
    random = np.random.default_rng(5)
    normals = random.normal(size=(len(ends), 6, 3)) * 300
    information = list(normals.transpose(0, 2, 1) @ normals)
    covariances, frame = network_errors(xy, ends, information)
    assert frame is not None
    assert np.allclose(covariances, scan_covariances(xy, ends, information, [frame]), rtol=1e-7, atol=1e-16)


def test_a_network_of_many_scans_needs_no_matrix_of_all_pairs() -> None:
    """4 000 scans in a chain: the last error is that of all pairs in series."""
    count = 4000
    ends = [(k, k + 1) for k in range(count - 1)]
    certain = 1e6 * np.eye(3)
    covariances = scan_covariances(np.zeros((count, 2)), ends, [certain] * len(ends), [0])
    assert covariances[-1] == pytest.approx((count - 1) * 1e-6 * np.eye(2))
