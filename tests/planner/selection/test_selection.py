"""Selections and their bounds against every subset of small covers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, weights_of
from stopgo.planner.selection import METHODS, bound, bound_by_parts, growing_relaxation
from stopgo.planner.selection.bound import (
    coarse_bound,
    counting_bound,
    early_bound,
    first_bound,
    lower_bound,
    relaxation_bound,
)
from stopgo.planner.selection.cover import Cover, cover_of
from stopgo.planner.selection.demands import demands_of, needed_of
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.growing_relaxation import GrowingRelaxation, growing_bound
from stopgo.planner.selection.multiplier_bound import multiplier_bound
from tests.faults.sizes import size
from tests.planner.selection.test_swaps import cover_of_rooms
from tests.planner.worlds import box, column, element, hall, planned, two_rooms


def small_cover(seed: int) -> Cover:
    """Up to 10 candidates, 25 groups of units, each seen by someone, and 4 demands on them."""
    random = np.random.default_rng(seed)
    rows, columns = int(random.integers(1, 11)), int(random.integers(1, 26))
    sees = random.random((rows, columns)) < random.uniform(0.1, 0.6)
    sees[random.integers(0, rows, size=columns), np.arange(columns)] = True
    weight = random.integers(1, 30, size=columns)
    groups = random.random((int(random.integers(0, 4)), columns)) < 0.4
    worth = np.vstack([np.ones(columns), groups]).astype(np.int64) * weight
    share = random.choice([0.5, 0.9, 1.0], size=len(worth))
    return Cover(csr_array(sees.astype(np.int64)), csr_array(worth), needed_of(worth.sum(axis=1), share))


def asking(cover: Cover, views: int) -> Cover:
    """The same, where every column asks for so many views, or for as many as there are."""
    most = np.asarray(cover.sees.sum(axis=0)).ravel()
    return replace(cover, views=np.minimum(views, most))


def small_covers(seeds: range) -> Iterator[tuple[int, Cover, int]]:
    """Small covers, each asking for one view, two or three, and the fewest rows that are enough."""
    for seed in seeds:
        cover = small_cover(seed)
        yield from ((seed, asking(cover, views), optimum_of(seed, views)) for views in (1, 2, 3))


def test_rows_and_columns_without_an_entry_do_not_hide_a_long_range(monkeypatch: pytest.MonkeyPatch) -> None:
    sees = np.zeros((60, 50), dtype=np.int64)
    sees[:6, :40] = 1
    monkeypatch.setattr(bound_by_parts, "MOST_AROUND", 1000)  # a column has 6 rows, which see 40 columns
    assert not bound_by_parts.has_parts(Cover.of_whole(csr_array(sees), np.ones(50, dtype=np.int64), 20))
    alone = csr_array(np.eye(60, 50, dtype=np.int64))
    assert bound_by_parts.has_parts(Cover.of_whole(alone, np.ones(50, dtype=np.int64), 20))


def is_enough(cover: Cover, rows: np.ndarray) -> bool:
    return any_is_enough(cover, rows[None])


def any_is_enough(cover: Cover, sets: np.ndarray) -> bool:
    """True if any of some sets of as many rows (sets, rows) is enough."""
    seen = (cover.sees.toarray()[sets] > 0).sum(axis=1) >= cover.views
    return bool(np.any(np.all(seen @ cover.worth.toarray().T >= cover.needed, axis=1)))


def fewest(cover: Cover) -> int:
    """Rows of the smallest selection that covers enough, by trying all."""
    for count in range(cover.rows + 1):
        sets = np.array(list(combinations(range(cover.rows), count)), dtype=np.int64)
        if any_is_enough(cover, sets):
            return count
    raise AssertionError("not even all rows cover what is needed")


@cache
def optimum_of(seed: int, views: int) -> int:
    return fewest(asking(small_cover(seed), views))


def check_rows(cover: Cover, rows: np.ndarray) -> None:
    assert len(set(rows.tolist())) == len(rows)
    assert is_enough(cover, rows)


@pytest.mark.parametrize("name", sorted(METHODS))
def test_every_selector_lies_between_its_bound_and_greedy(name: str) -> None:
    for seed, cover, optimum in small_covers(range(size(short=2, full=300))):
        rows, bound = METHODS[name](cover, Settings())
        check_rows(cover, rows)
        assert counting_bound(cover) <= bound <= optimum <= len(rows) <= len(greedy(cover)), seed
        if name == "exact":
            assert bound == optimum == len(rows), seed
        if name == "default":
            assert len(rows) <= optimum + 1, seed


def test_no_bound_is_above_the_optimum(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bound, "COARSE", 20)
    monkeypatch.setattr(bound, "FINE", 40)
    monkeypatch.setattr(bound_by_parts, "SIZE", 20)
    monkeypatch.setattr(growing_relaxation, "FIRST", 2)
    monkeypatch.setattr(growing_relaxation, "ENTRIES", 20)
    for _, cover, optimum in small_covers(range(size(short=3, full=300))):
        assert counting_bound(cover) <= optimum
        assert coarse_bound(cover) <= relaxation_bound(cover) <= optimum
        assert multiplier_bound(cover, found=len(greedy(cover))) <= optimum
        assert bound_by_parts.bound_by_parts(cover, found=len(greedy(cover))) <= optimum
        assert growing_bound(cover) <= optimum


@pytest.mark.parametrize("seed", range(2))
def test_a_relaxation_grows_to_the_bound_of_all_rows(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """It begins with a few rows, which do not meet the demands, and ends with a part of them all."""
    monkeypatch.setattr(growing_relaxation, "FIRST", 12)
    monkeypatch.setattr(growing_relaxation, "JOINING", 20)
    cover = cover_of_rooms(seed, rows=300, columns=200, rooms=12)
    relaxation = GrowingRelaxation(cover)
    while relaxation.goes_on():
        pass
    assert relaxation.bound == pytest.approx(relaxation_bound(cover), abs=1.0)
    assert growing_bound(cover) in (relaxation_bound(cover) - 1, relaxation_bound(cover))


def test_a_long_range_is_bounded_by_a_relaxation_that_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bound, "LARGEST", 500)
    monkeypatch.setattr(bound, "has_parts", lambda cover: False)
    cover = cover_of_rooms(0, rows=60, columns=200, rooms=12)
    found = len(greedy(cover))
    assert lower_bound(cover, found=min(found, len(cover.needed))) == growing_bound(cover)
    monkeypatch.setattr(bound, "MOST_GROWN", 0)
    assert lower_bound(cover, found=found) <= growing_bound(cover)


@pytest.mark.parametrize(("seed", "found"), [(102, 4), (1088, 2), (1088, 3)])
def test_a_slope_of_rounding_raises_no_bound(seed: int, found: int) -> None:
    """A step along it made prices of 1e18, whose sums differ by more than any bound."""
    for views in (1, 2, 3):
        cover, optimum = asking(small_cover(seed), views), optimum_of(seed, views)
        assert bound_by_parts.bound_by_parts(cover, found=found) <= optimum
        assert multiplier_bound(cover, found=found, steps=60) <= optimum


def test_the_first_bound_of_a_large_problem_is_nearly_that_of_its_relaxation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Some 800 entries are large here, and groups of three columns are solved as one."""
    monkeypatch.setattr(bound, "FEW", 60)
    monkeypatch.setattr(bound, "COARSE", 300)
    covers = [cover_of_rooms(seed, rows=60, columns=200, rooms=12) for seed in range(4)]
    steps = []
    for cover in covers:
        found = len(greedy(cover))
        quick, few = early_bound(cover, found=found), first_bound(cover, found=found)
        assert few <= quick <= relaxation_bound(cover) <= quick + 1
        steps.append(quick - few)
    assert sum(steps) > 0  # of the relaxation: else the few steps alone would do


def test_rows_that_the_coarse_relaxation_proves_need_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    cover = cover_of_rooms(1, rows=60, columns=200, rooms=12)
    monkeypatch.setattr(bound, "COARSE", 300)
    monkeypatch.setattr(bound, "relaxation_bound", lambda cover: pytest.fail("was not needed"))
    proved = coarse_bound(cover)
    assert counting_bound(cover) < proved == lower_bound(cover, found=proved)
    assert proved == early_bound(cover, found=proved + 1)


def test_a_search_for_many_rows_begins_with_the_bound_by_counting(monkeypatch: pytest.MonkeyPatch) -> None:
    cover = cover_of_rooms(1, rows=60, columns=200, rooms=12)
    found = len(greedy(cover))
    monkeypatch.setattr(bound, "FEW", found - 1)
    assert early_bound(cover, found=found) == counting_bound(cover) < lower_bound(cover, found=found)


@pytest.mark.parametrize("seed", range(3))
def test_the_multiplier_bound_of_a_large_problem_is_nearly_that_of_its_relaxation(seed: int) -> None:
    """Also where the best known selection has half as many rows more."""
    cover = cover_of_rooms(seed, rows=300, columns=900, rooms=40)
    best = relaxation_bound(cover)
    assert best - 1 <= multiplier_bound(cover, found=len(greedy(cover)), steps=170) <= best


def test_the_default_selector_finds_nearly_every_optimum() -> None:
    missed = sum(
        len(METHODS["default"](cover, Settings())[0]) > fewest(cover)
        for cover in map(small_cover, range(1000, 1000 + size(short=50, full=150)))
    )
    assert missed <= 1


def test_more_views_never_take_fewer_stops() -> None:
    for seed in range(size(short=10, full=300)):
        cover = small_cover(seed)
        once, twice, thrice = (optimum_of(seed, views) for views in (1, 2, 3))
        assert once <= twice <= thrice
        rows, _ = METHODS["default"](asking(cover, 2), Settings())
        assert is_enough(cover, rows)


def test_what_chosen_rows_saw_once_is_asked_for_once_more() -> None:
    for seed in range(40):
        cover = asking(small_cover(seed), 2)
        first = np.arange(min(2, cover.rows))
        rows = greedy(cover.after(first))
        assert not set(rows.tolist()) & set(first.tolist())
        assert is_enough(cover, np.concatenate([first, rows]))
        assert len(rows) >= fewest(cover) - len(first)


def test_greedy_takes_what_adds_most_and_ties_go_to_the_lower_row() -> None:
    sees = np.array([[1, 1, 0, 0], [0, 1, 1, 1], [1, 0, 1, 1], [1, 0, 0, 0]])
    cover = Cover.of_whole(csr_array(sees), np.array([1, 1, 1, 1]), 4)
    assert greedy(cover).tolist() == [1, 0]


@pytest.mark.parametrize(
    ("total", "required", "needed"),
    [(10, 0.9, 9), (10, 0.91, 10), (7334, 0.9, 6601), (1000, 0.3, 300), (1, 0.01, 1)],
)
def test_needed_units_are_the_fewest_that_make_the_share(total: int, required: float, needed: int) -> None:
    assert needed_of(np.array(total), required) == needed


def test_units_that_look_alike_are_merged_without_loss() -> None:
    floor = two_rooms(1.0, more=(column("c", 2.0, 1.0), element("b", "beams", box(1, 3, 7, 3.2))))
    _, nouns = planned(floor, Settings(range=4))
    visibility = nouns[Selection].visibility
    cover = cover_of(visibility, demands_of(visibility))
    weight = weights_of(visibility.targets, visibility.settings)
    seen = np.zeros((visibility.rows, visibility.targets.total), dtype=bool)
    for row in range(visibility.rows):
        seen[row, visibility.seen_by(row)] = True
    assert cover.total == weight[seen.any(axis=0)].sum()
    patterns = {column.tobytes() for column in seen.T if column.any()}
    assert cover.columns == len(patterns)
    random = np.random.default_rng(0)
    for _ in range(50):
        rows = random.permutation(visibility.rows)[: random.integers(1, 6)]
        assert cover.seen_weight(cover.covered_by(rows)) == weight[seen[rows].any(axis=0)].sum()


@pytest.mark.parametrize("name", sorted(METHODS))
def test_coverage_rises_with_every_stop_and_reaches_what_is_required(name: str) -> None:
    floor = two_rooms(1.0, more=(column("c", 2.0, 1.0), column("k", 6.0, 3.0)))
    for required in (0.5, 0.9, 1.0):
        settings = Settings(
            selector=name, coverage=required, room_coverage=0, kind_coverage=0, range=3, refine=False
        )
        _, nouns = planned(floor, settings)
        steps = nouns[Selection].coverage_steps
        assert all(one <= other for one, other in pairwise(steps))
        assert steps[-1] >= required
        assert len(steps) < 2 or steps[-2] < required


def test_one_stop_in_the_middle_of_a_small_hall_is_enough() -> None:
    mission, nouns = planned(hall(4, 4), Settings(coverage=1.0))
    assert len(mission.stops) == 1
    assert nouns[Selection].bound == 1
    assert mission.return_ is None


@pytest.mark.parametrize("views", [1, 2])
def test_the_bound_by_parts_is_nearly_that_of_the_relaxation(
    views: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parts of a sixteenth; also where every column needs two views."""
    once = cover_of_rooms(3, rows=120, columns=360, rooms=16)
    cover = replace(once, views=views)
    monkeypatch.setattr(bound_by_parts, "SIZE", cover.sees.nnz // 16)
    best = relaxation_bound(cover)
    found = bound_by_parts.bound_by_parts(cover, found=2 * best)
    assert best - 1 <= found <= best
    assert found > multiplier_bound(cover, found=2 * best, steps=60)
