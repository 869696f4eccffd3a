"""Stretches of the boundary, joined where they touch: the same pieces as counted one by one."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.planner.candidates import candidates
from stopgo.planner.overlap import boundary
from stopgo.planner.overlap.boundary import _Stretches, shown
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility.unit_ranges import runs_of
from tests.planner.worlds import element, hall, two_rooms


@pytest.mark.parametrize("seed", range(6))
def test_joined_stretches_have_the_same_pieces_in_the_fewest_runs(seed: int) -> None:
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 9, 12)
    face, start = np.repeat(np.arange(12), sizes), np.cumsum(sizes) - sizes
    row = np.sort(random.integers(0, 5, 40))
    on = random.integers(0, 12, 40)
    low = random.integers(0, sizes[on])
    high = random.integers(low, sizes[on])
    some = _Stretches(row, start[on] + low, start[on] + high)
    joined = some.joined(face)
    for k, pieces in enumerate(some.pieces(5)):
        first, last = runs_of(pieces, face)
        assert joined.first[joined.row == k].tolist() == first.tolist()
        assert joined.last[joined.row == k].tolist() == last.tolist()


def test_nothing_seen_is_no_stretch() -> None:
    nothing = np.empty(0, np.int64)
    assert len(_Stretches(nothing, nothing, nothing).joined(np.zeros(3, np.int64)).row) == 0


@pytest.mark.parametrize("fov", [360, 200])
def test_what_is_found_block_by_block_is_what_is_found_at_once(
    fov: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = candidates(navigable(two_rooms(1.0), Settings(fov=fov, grid=0.5)))
    rows = np.arange(len(found.kept))[::-1]
    whole = shown(found, rows)
    monkeypatch.setattr(boundary, "BLOCK", 7)
    parts = shown(found, rows)
    assert len(rows) > 3 * 7 and len(whole.surface)
    for name in ("pointer", "surface", "begin", "end", "xy"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name)), name
    assert len(shown(found, rows[:0]).surface) == 0


@pytest.mark.parametrize("fov", [360, 200])
def test_without_narrow_surfaces_the_same_stretches_count(fov: float) -> None:
    """A column with eight sides of 23 cm, and a round one: only the former's surfaces are too narrow."""
    rings = (
        radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        for radius, turn in ((0.3, np.arange(8) * np.pi / 4), (0.3, np.arange(40) * np.pi / 20))
    )
    columns = [
        element(f"c{k}", "columns", Polygon.of(ring + np.array((2.0 + 2 * k, 2.0))))
        for k, ring in enumerate(rings)
    ]
    found = candidates(navigable(hall(6, 4, *columns), Settings(fov=fov, grid=0.5)))
    rows = np.arange(len(found.kept))
    whole, wide = shown(found, rows), shown(found, rows, only_wide=True)
    assert len(wide.surface)
    for name in ("pointer", "surface", "begin", "end", "xy"):
        assert np.array_equal(getattr(wide, name), getattr(whole, name)), name
    assert (wide.metres <= whole.metres).all() and (wide.metres < whole.metres).any()
