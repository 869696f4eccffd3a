"""Overlap and registration strength of two scans: numbers that can be checked on paper."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.stages import KEPT, OUTSIDE, Candidates
from stopgo.mission.stages.network import CONFIDENCE, MOST_NOISE_MM, predicted_error_m
from stopgo.planner import overlap
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import read_floor
from stopgo.planner.overlap import ACCURACY_M, least_hold_m, links_by_kernel, links_of, overlaps_of
from stopgo.planner.overlap.boundary import MOST_SPACING_M
from stopgo.planner.overlap.pair_kernel import firm_pairs
from stopgo.planner.overlap.pairs import EDGE_M, LEVER_M
from stopgo.planner.space.navigable import navigable
from tests.planner.kernels import interpret, machine_code
from tests.planner.worlds import LAYERED, SHARED, box, column, door, floor_of, shell, wall

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
SETTINGS = Settings(d_sec=0.5, edge=0.0, overlap=0.1)


def standing(floor: FloorPlan, settings: Settings, *places: tuple[float, float]) -> Candidates:
    """Candidates where one wants them."""
    found = candidates(navigable(floor, replace(settings, use=places)))
    return replace(found, reason=frozen(np.where(found.must, KEPT, OUTSIDE), np.int64))


def hold_of_box(width: float, height: float, at: tuple[float, float]) -> float:
    """Least eigenvalue for all four walls of an empty box (0, 0)-(width, height), less its corners."""
    x, y = at
    normal = np.zeros((3, 3))
    for n, length, arms in (
        ((1.0, 0.0), height, (-y, height - y)),
        ((-1.0, 0.0), height, (-y, height - y)),
        ((0.0, 1.0), width, (-x, width - x)),
        ((0.0, -1.0), width, (-x, width - x)),
    ):
        s = np.linspace(arms[0] + EDGE_M, arms[1] - EDGE_M, 20_001)
        s = (s[:-1] + s[1:]) / 2
        turn = (-n[0] * s if n[0] else n[1] * s) / LEVER_M
        j = np.stack([np.full_like(s, n[0]), np.full_like(s, n[1]), turn])
        normal += j @ j.T * (length - 2 * EDGE_M) / len(s)
    return float(np.linalg.eigvalsh(normal)[0])


def test_two_stops_in_an_empty_room_share_all_of_it() -> None:
    floor = floor_of(box(0, 0, 6, 4), elements=(shell(0, 0, 6, 4),))
    pairs = overlaps_of(standing(floor, SETTINGS, (1.5, 2), (4, 1.5))).of(0)
    assert pairs.other.tolist() == [1]
    assert pairs.common_m[0] == pytest.approx(20)
    assert pairs.share[0] == pytest.approx(1)
    expected = min(hold_of_box(6, 4, (1.5, 2)), hold_of_box(6, 4, (4, 1.5)))
    assert pairs.hold_m[0] == pytest.approx(expected, rel=1e-6)


def test_one_long_wall_holds_nothing_along_itself() -> None:
    """In the open, before a wall 20 m long, with 20 m beyond what either sees of its ends."""
    floor = floor_of(box(0, 0, 60, 10), elements=(wall("w", box(0, 10, 60, 10.2)),))
    settings = replace(SETTINGS, overlap_range=15.0)
    pairs = overlaps_of(standing(floor, settings, (28, 5), (32, 5))).of(0)
    assert pairs.common_m[0] > 20
    assert pairs.hold_m[0] == 0


def test_boundary_beyond_the_range_does_not_count() -> None:
    floor = floor_of(box(0, 0, 30, 4), elements=(shell(0, 0, 30, 4),))
    near = overlaps_of(standing(floor, replace(SETTINGS, overlap_range=3.0), (5, 2), (20, 2))).of(0)
    assert not len(near.other)


def test_an_opening_shows_little_of_the_other_room() -> None:
    """A door 0.9 m wide: what both see of one room is less than all of it, and a column stands in its way."""
    rooms = (wall("w", box(5, 0, 5.2, 1.5), box(5, 2.4, 5.2, 4)), shell(0, 0, 10, 4))
    open_door = floor_of(box(0, 0, 10, 4), elements=rooms, openings=(door("d", (5.1, 1.5), (5.1, 2.4)),))
    behind = replace(open_door, elements=(*rooms, column("c", 4.0, 1.95)))
    places = (2.0, 1.95), (8.0, 1.95)
    free = overlaps_of(standing(open_door, SETTINGS, *places)).of(0)
    hidden = overlaps_of(standing(behind, SETTINGS, *places)).of(0)
    assert 0 < free.share[0] < 0.6
    assert not len(hidden.other) or hidden.common_m[0] < free.common_m[0]


@pytest.mark.parametrize("name", LAYERED[1:2])
def test_a_pair_is_the_same_from_both_ends(name: str) -> None:
    if not (SHARED / name).exists():
        pytest.skip(f"{SHARED / name} is not there")
    found = candidates(navigable(read_floor(SHARED / name), SETTINGS))
    overlaps = overlaps_of(found)
    known: dict[tuple[int, int], tuple[float, ...]] = {}
    for row in range(overlaps.rows):
        pairs = overlaps.of(row)
        for other, *figures in zip(*vars(pairs).values(), strict=True):
            known[row, int(other)] = tuple(figures)
    assert known
    assert all(known[b, a] == figures for (a, b), figures in known.items())
    links = links_of(found)
    assert (links != links.T).nnz == 0
    assert not links.diagonal().any()


@pytest.mark.parametrize(("deep", "holds"), [(0.2, False), (0.4, True)])
def test_what_is_too_narrow_to_have_a_direction_holds_nothing(deep: float, holds: bool) -> None:
    """A wall 20 m long and a pillar on it: its sides face along the wall, and nothing else does."""
    pillar = wall("p", box(29.5, 10 - deep, 30.5, 10))
    floor = floor_of(box(0, 0, 60, 10), elements=(wall("w", box(0, 10, 60, 10.2)), pillar))
    settings = replace(SETTINGS, overlap_range=15.0)
    pairs = overlaps_of(standing(floor, settings, (26, 5), (27, 4))).of(0)
    assert pairs.common_m[0] > 15
    assert bool(pairs.hold_m[0] > 0.05) == holds


@pytest.mark.parametrize("step", [0.02, 0.1, 1.0])
def test_a_wall_counts_as_far_as_its_points_have_a_direction(step: float) -> None:
    """From 1 m before a long wall: 11.43 m to either side (85°); 9.22 m at 0.1°, 2.76 m at 1°."""
    floor = floor_of(box(0, 0, 60, 10), elements=(wall("w", box(0, 10, 60, 10.2)),))
    settings = replace(SETTINGS, overlap_range=30.0, angular_step=step)
    overlaps = overlaps_of(standing(floor, settings, (30, 9), (30.5, 9)))
    half = min(math.sqrt(MOST_SPACING_M / math.radians(step) - 1), math.tan(math.radians(85)))
    assert overlaps.shown_m[0] == pytest.approx(2 * half, abs=1e-6)
    assert overlaps.of(0).common_m[0] == pytest.approx(2 * half - 0.5, abs=1e-6)


def test_the_least_strength_is_that_of_the_accuracy() -> None:
    """With the least strength 99 of 100 errors are within the accuracy, whatever the scanner's noise."""
    least = least_hold_m(Settings())
    assert predicted_error_m(least, 1.0) * CONFIDENCE == pytest.approx(ACCURACY_M, rel=0.01)
    assert predicted_error_m(4 * least, 1.0) == pytest.approx(predicted_error_m(least, 1.0) / 2, rel=0.05)
    noisy = least_hold_m(Settings(range_noise=6.0))
    assert noisy > 9 * least
    assert predicted_error_m(noisy, 3.0) * CONFIDENCE == pytest.approx(ACCURACY_M, rel=0.01)
    assert least_hold_m(Settings(range_noise=0.5)) == least
    most = PARAMETERS["range_noise"].most
    assert most == MOST_NOISE_MM and least_hold_m(Settings(range_noise=most)) < 1.1


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_links_are_the_same_in_numpy_as_written_and_compiled(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the sample office, where thousands of pairs lie on both sides of each limit."""
    found = candidates(navigable(read_floor(SAMPLE), Settings(overlap=share, grid=1.5)))
    fast = links_of(found)
    pairs = [
        links_by_kernel(kernel, overlaps_of(found), found.settings)
        for kernel in (firm_pairs, machine_code(firm_pairs))
    ]
    written, built = (sorted(zip(*map(np.concatenate, zip(*one, strict=True)), strict=True)) for one in pairs)
    assert written == built and 100 < fast.nnz == 2 * len(built)
    monkeypatch.setattr(overlap, "MANY", 0)
    for _ in range(2):  # in two processes, and then interpreted
        assert (fast != links_of(replace(found))).nnz == 0
        interpret(monkeypatch)


def test_normal_matrices_are_those_of_each_pair() -> None:
    found = candidates(navigable(read_floor(SAMPLE), Settings(grid=2.0)))
    overlaps = overlaps_of(found)
    pairs = [(row, int(other)) for row in (7, 3, 5) for other in overlaps.of(row).other[::-4]]
    assert len(pairs) > 10
    several = overlaps.normal_matrices(pairs)
    assert several.tolist() == [overlaps.normal_matrix(*pair).tolist() for pair in pairs]
    assert overlaps.normal_matrices([]).shape == (0, 3, 3)
