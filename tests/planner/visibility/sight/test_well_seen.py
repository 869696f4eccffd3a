"""Limits on how a target is seen: stretches against single midpoints, and against trigonometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stopgo.mission.document.limits import ViewLimits
from stopgo.planner.geometry.shapes import GRID
from stopgo.planner.visibility.sight.well_seen import SeenSegments, clipped, well_seen
from tests.faults.sizes import size

STEP = math.radians(0.036)


def random_limits(random: np.random.Generator) -> ViewLimits:
    """One, two or three limits, sharp enough to cut walls of some metres."""
    which = int(random.integers(1, 8))
    return ViewLimits(
        max_incidence=math.radians(random.uniform(5, 89)) if which & 1 else None,
        near=float(random.uniform(0.1, 3.0)) if which & 2 else 0.0,
        spacing=float(random.uniform(0.0003, 0.01)) if which & 4 else None,
        step=STEP,
        rise=float(random.choice([0.0, 1.4])),
    )


def random_walls(random: np.random.Generator, count: int) -> SeenSegments:
    """Walls all round, some seen along their own line, some of which begin at the place."""
    a = random.integers(-500_000, 500_000, size=(count, 2))
    b = a + random.integers(-500_000, 500_000, size=(count, 2))
    on_line = random.random(count) < 0.1
    b[on_line] = 3 * a[on_line]
    a[random.random(count) < 0.02] = 0
    length = np.hypot(*(b - a).T) * GRID
    return SeenSegments(a, b, np.maximum(1, np.ceil(length / 0.05)).astype(np.int64))


def one_by_one(
    stretches: SeenSegments, low: np.ndarray, high: np.ndarray, limits: ViewLimits
) -> list[set[int]]:
    found = []
    for k in range(len(low)):
        units = np.arange(low[k], high[k] + 1)
        same = stretches.among(np.full(len(units), k))
        found.append(set(units[well_seen(same, units, limits)].tolist()))
    return found


def pieces(given: tuple[np.ndarray, ...], count: int) -> list[set[int]]:
    found: list[set[int]] = [set() for _ in range(count)]
    before = (-1, -2)
    for run, first, last in zip(*(item.tolist() for item in given), strict=True):
        assert (run, first) > before and first <= last
        before = (run, last)
        found[run] |= set(range(first, last + 1))
    return found


def test_the_stretches_hold_just_the_midpoints_that_are_seen_well() -> None:
    for seed in range(size(short=40, full=1000)):
        random = np.random.default_rng(seed)
        stretches, limits = random_walls(random, 30), random_limits(random)
        ends = np.sort(random.integers(0, stretches.units[:, None], size=(30, 2)), axis=1)
        low, high = ends[:, 0], ends[:, 1]
        assert pieces(clipped(stretches, low, high, limits), 30) == one_by_one(stretches, low, high, limits)


def test_what_is_seen_well_is_what_trigonometry_says() -> None:
    for seed in range(20):
        random = np.random.default_rng(seed)
        stretches, limits = random_walls(random, 400), random_limits(random)
        unit = random.integers(0, stretches.units)
        a, b = stretches.a * GRID, stretches.b * GRID
        at = a + ((unit + 0.5) / stretches.units)[:, None] * (b - a)
        normal = np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]], axis=1)
        distance = np.hypot(*at.T)
        slant = np.hypot(distance, limits.rise)
        cosine = np.abs((at * normal).sum(axis=1)) / np.maximum(slant * np.hypot(*normal.T), 1e-12)
        flat = np.degrees(np.arccos(np.clip(cosine, 0, 1)))
        spacing = slant * STEP / np.maximum(cosine, 1e-12)
        margins = [distance - limits.near]
        if limits.max_incidence is not None:
            margins.append(math.degrees(limits.max_incidence) - flat)
        if limits.spacing is not None:
            margins.append((limits.spacing - spacing) * 1e3)
        margin = np.min(margins, axis=0)
        clear = np.abs(margin) > 1e-3
        assert clear.mean() > 0.9
        assert np.array_equal(well_seen(stretches, unit, limits)[clear], (margin > 0)[clear])


def test_the_ends_of_a_stretch_are_where_the_formulas_put_them() -> None:
    """A wall of 20 m, 2 m away, in units of 1 mm: 60° reaches 2 tan 60° to either side, and so on."""
    wall = SeenSegments(
        np.array([[-1_000_000, 200_000]]), np.array([[1_000_000, 200_000]]), np.array([20_000])
    )
    whole = np.array([0]), np.array([19_999])
    reach = {
        2 * math.tan(math.radians(60)): ViewLimits(max_incidence=math.radians(60)),
        math.sqrt(2 * 0.005 / STEP - 4): ViewLimits(spacing=0.005, step=STEP),
    }
    for metres, limits in reach.items():
        _, first, last = clipped(wall, *whole, limits)
        assert (last - first + 1).tolist() == pytest.approx([2 * metres * 1000], abs=2)
    _, first, last = clipped(wall, *whole, ViewLimits(near=2.5))
    assert len(first) == 2
    assert first[1] - last[0] - 1 == pytest.approx(2 * 1500, abs=2)


def test_what_is_exactly_at_a_limit_is_seen() -> None:
    """A midpoint 3 m from the foot of a wall 4 m away is exactly 5 m away."""
    wall = SeenSegments(np.array([[250_000, 400_000]]), np.array([[350_000, 400_000]]), np.array([1]))
    unit = np.array([0])
    assert well_seen(wall, unit, ViewLimits(near=5.0))[0]
    assert not well_seen(wall, unit, ViewLimits(near=5.00001))[0]
    k = 5 * 5 / 4
    assert well_seen(wall, unit, ViewLimits(spacing=k * 2**-10, step=2**-10))[0]
    assert not well_seen(wall, unit, ViewLimits(spacing=math.nextafter(k, 0) * 2**-10, step=2**-10))[0]


def test_a_wall_seen_along_its_own_line_is_too_flat_for_any_limit() -> None:
    line = SeenSegments(np.array([[100_000, 0]]), np.array([[300_000, 0]]), np.array([10]))
    for limits in (ViewLimits(max_incidence=math.radians(89.9)), ViewLimits(spacing=1.0, step=STEP)):
        assert not len(clipped(line, np.array([0]), np.array([9]), limits)[0])
