"""Sight lines tested against every edge, checked in fractions on walls too long for 64-bit products."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.visibility.sight.sightlines import Midpoints, sees, sees_past
from tests.planner.oracle import seen_in_fractions


def lines_of(seed: int, extent: int) -> tuple[np.ndarray, Midpoints, np.ndarray]:
    """A place, midpoints and edges at random within ±extent; much of it in line with something else."""
    random = np.random.default_rng(seed)
    corners = random.integers(-extent, extent, (10, 2), endpoint=True)
    corners[5:] = corners[4] + np.arange(1, 6)[:, None] * (corners[0] - corners[4]) // 6
    place = random.integers(-extent, extent, 2, endpoint=True)
    edges = corners[random.integers(0, 10, (8, 2))]
    a, b = corners[random.integers(0, 10, (2, 6))]
    units = np.array([1, 2, 3, 20_000, 999, 1_000_000])
    some = np.sort(random.integers(0, units.sum(), 40))
    face = random.integers(0, 2, 6).astype(bool)
    return place, Midpoints.of(a, b, units, face).among(some), edges


@pytest.mark.parametrize("extent", [3, 10, 10**8, 2**29])
def test_lines_are_reported_as_in_fractions(extent: int) -> None:
    for seed in range(6):
        place, midpoints, edges = lines_of(seed, extent)
        for reach in (None, extent // 2 + 1):
            found = sees(place, midpoints, edges, reach=reach)
            columns = (midpoints.a, midpoints.b, midpoints.odd, midpoints.pieces, midpoints.face, found)
            for a, b, odd, pieces, face, seen in zip(*columns, strict=True):
                told = seen_in_fractions(place, a, b, odd, pieces, edges, is_face=face, reach=reach)
                assert bool(seen) == told, (seed, a, b, odd, pieces)


@pytest.mark.parametrize("extent", [10, 2**29])
def test_edges_that_are_tested_first_change_nothing(extent: int) -> None:
    for seed in range(30):
        place, midpoints, edges = lines_of(seed, extent)
        first = np.random.default_rng(seed).integers(-1, len(edges), len(midpoints.odd))
        seen, hidden_by = sees_past(place, midpoints, edges, first, reach=extent)
        assert np.array_equal(seen, sees(place, midpoints, edges, reach=extent))
        assert not np.any(seen & (hidden_by >= 0))
        for k in np.flatnonzero(hidden_by >= 0).tolist():
            one = midpoints.among(np.array([k]))
            assert not sees(place, one, edges[hidden_by[k], None], reach=None).any()


def test_the_range_ends_exactly_at_a_midpoint() -> None:
    # From (0, 0) to (300, 400) m: 500 m.
    one = Midpoints.of(
        np.array([[30_000_000, 30_000_000]]),
        np.array([[30_000_000, 50_000_000]]),
        np.array([1]),
        np.array([False]),
    )
    nothing = np.empty((0, 2, 2), dtype=np.int64)
    assert sees(np.zeros(2, np.int64), one, nothing, reach=50_000_000).all()
    assert not sees(np.zeros(2, np.int64), one, nothing, reach=49_999_999).any()
