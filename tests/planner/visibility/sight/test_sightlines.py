"""Sight lines tested against every edge, checked in fractions on walls too long for 64-bit products."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from stopgo.planner.visibility.sight.line_kernel import within
from stopgo.planner.visibility.sight.sightlines import LineByLine, Midpoints
from tests.planner.kernels import interpret, machine_code
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


def sees(place: np.ndarray, midpoints: Midpoints, edges: np.ndarray, *, reach: int | None) -> np.ndarray:
    """True for each midpoint (n,) that a place sees past the edges."""
    found = np.zeros(len(midpoints.odd), dtype=bool)
    found[LineByLine(midpoints, edges, reach=reach).seen_from(place)] = True
    return found


@pytest.fixture(params=["compiled", "interpreted"])
def speed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Speed of the kernel."""
    if request.param == "interpreted":
        interpret(monkeypatch)
    return str(request.param)


@pytest.mark.usefixtures("speed")
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
def test_what_hid_midpoints_from_earlier_positions_changes_nothing(extent: int, speed: str) -> None:
    hidden, seeds = 0, 5 if speed == "interpreted" else 15
    for seed in range(seeds):
        place, midpoints, edges = lines_of(seed, extent)
        lines = LineByLine(midpoints, edges, reach=extent)
        places = [place, -place, place // 2, place]
        for other in places:
            found = np.zeros(len(midpoints.odd), dtype=bool)
            found[lines.seen_from(other)] = True
            assert np.array_equal(found, sees(other, midpoints, edges, reach=extent)), seed
        hidden += int((np.array(lines._hidden_by) >= 0).sum())
    assert hidden > seeds


@pytest.mark.usefixtures("speed")
def test_only_midpoints_among_the_chosen_are_found() -> None:
    place, midpoints, edges = lines_of(1, 10)
    lines = LineByLine(midpoints, edges[:0], reach=None)
    among = np.arange(len(midpoints.odd)) % 2 == 0
    assert np.array_equal(
        lines.seen_from(place, among), np.intersect1d(lines.seen_from(place), among.nonzero())
    )
    assert not len(lines.seen_from(place, np.zeros(len(among), dtype=bool)))


@pytest.mark.usefixtures("speed")
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


def test_the_greatest_numbers_are_compared_as_in_python() -> None:
    """Lines of 2**55 and a range of 2**31 steps times 2**25 pieces are the longest that can come."""
    fast = machine_code(within)
    for x, y in itertools.product((-(2**55), 1 - 2**27, -1, 0, 1, 2**27, 2**55 - 1), repeat=2):
        about = math.isqrt(x * x + y * y)
        for limit in (0, 1, about - 1, about, about + 1, 2**56):
            truth = x * x + y * y <= limit * limit if limit >= 0 else False
            assert limit < 0 or bool(fast(x, y, limit)) == bool(within(x, y, limit)) == truth
