"""Connected selections, compared with every subset of small floors; and their separators."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.mission.settings import Settings
from stopgo.planner.selection import EXACT_ROUNDS, ROUNDS, Searches
from stopgo.planner.selection.bound import likely_rows, lower_bound
from stopgo.planner.selection.component_kernel import label_components
from stopgo.planner.selection.connected_selection import ConnectedCover, connected
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.improve import found_among
from stopgo.planner.selection.separators import components_of
from tests.faults.sizes import size
from tests.planner.checks import meets
from tests.planner.kernels import interpret

EXACT = Settings(selector="exact")


def task_of(
    seed: int, *, rows: int = 8, columns: int = 14, near: float = 0.42, share: float = 0.8
) -> ConnectedCover:
    """Rows at random positions; each sees some columns and registers with the rows near it."""
    rng = np.random.default_rng(seed)
    xy, at = rng.random((rows, 2)), rng.random((columns, 2))
    sees = csr_array((np.hypot(*(xy[:, None] - at[None]).transpose(2, 0, 1)) < 0.35).astype(np.int64))
    apart = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    links = csr_array(((apart < near) & (apart > 0)).astype(np.int64))
    weight = rng.integers(1, 9, columns)
    visible = int(weight[np.asarray(sees.sum(axis=0)).ravel() > 0].sum())
    return ConnectedCover(Cover.of_whole(sees, weight, int(0.8 * visible)), links, np.arange(rows))


def fewest(task: ConnectedCover) -> int:
    """Size of the smallest of all subsets that meet every demand and are connected in each region."""
    offered = np.sort(np.concatenate([np.empty(0, np.int64), *task.regions]))
    for many in range(len(offered) + 1):
        for chosen in combinations(offered.tolist(), many):
            rows = np.array(chosen, dtype=np.int64)
            if meets(task.cover, rows) and not task.parts(rows):
                return many
    raise AssertionError("all rows together do not see enough")


@pytest.mark.parametrize("seed", range(size(short=6, full=200)))
def test_no_subset_is_smaller_than_the_bound_and_exact_finds_the_smallest(seed: int) -> None:
    best = fewest(task_of(seed))
    for is_exact in (False, True):
        task = task_of(seed)
        search = Searches.exact(EXACT) if is_exact else Searches.default(task)
        rows, bound = connected(task, search, rounds=EXACT_ROUNDS if is_exact else ROUNDS)
        bound = max(bound, lower_bound(task.problem, found=len(rows)))
        assert meets(task.cover, rows)
        assert not task.parts(rows)
        assert bound <= best <= len(rows)
        if is_exact:
            assert bound == best == len(rows)


@pytest.mark.parametrize("seed", [40, 57])
def test_the_default_search_finds_the_fewest_connected_rows_where_a_component_sees_enough(seed: int) -> None:
    """Separators of such a component are conditions only, and need not hold for every selection."""
    task = task_of(seed, rows=12, columns=24, near=0.35)
    rows, _ = connected(task, Searches.default(task), rounds=ROUNDS)
    assert meets(task.cover, rows)
    assert not task.parts(rows)
    assert len(rows) == fewest(task)


def test_a_search_from_the_rows_of_a_relaxation_finds_fewer_or_keeps_what_is_known() -> None:
    for seed in range(size(short=4, full=12)):
        task = task_of(seed, rows=30, columns=60, near=0.35)
        rows, least = connected(task, Searches.default(task), rounds=ROUNDS)
        search = Searches.default(task, likely=likely_rows(task.problem))
        found, bound = connected(task, search, rounds=ROUNDS, known=(np.concatenate(task.regions), least))
        assert meets(task.cover, found)
        assert not task.parts(found)
        assert least <= bound <= len(found) <= len(rows) + 1
        same, _ = connected(task, lambda _, start, __: (start, 0), rounds=1, known=(rows, least))
        assert same.tolist() == rows.tolist()


def test_rows_that_do_not_see_enough_are_no_selection() -> None:
    cover = task_of(1).cover
    assert found_among(cover, np.empty(0, np.int64), at_least=0) is None
    assert found_among(cover, np.arange(cover.rows), at_least=0) is not None


def test_two_rooms_take_the_row_between_them() -> None:
    """Rows 0 and 2 see everything; only row 1, which sees nothing new, registers with both."""
    sees = csr_array(np.array([[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1]]))
    links = csr_array(np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]]))
    task = ConnectedCover(Cover.of_whole(sees, np.ones(4, np.int64), 4), links, np.arange(3))
    rows, _ = connected(task, Searches.default(task), rounds=ROUNDS)
    assert rows.tolist() == [0, 1, 2]
    assert lower_bound(task.problem, found=3) == 3


def test_rows_without_links_stay_in_as_few_components_as_needed() -> None:
    """Row 2 sees the same as row 3. Row 3 registers with no row, so it is not chosen."""
    sees = csr_array(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]))
    links = np.zeros((4, 4), np.int64)
    links[[0, 1, 1, 2], [1, 0, 2, 1]] = 1
    task = ConnectedCover(Cover.of_whole(sees, np.ones(3, np.int64), 3), csr_array(links), np.arange(4))
    rows, _ = connected(task, Searches.default(task), rounds=ROUNDS)
    assert rows.tolist() == [0, 1, 2]
    assert len(components_of(task.links, rows)) == 1


def test_components_follow_from_links() -> None:
    links = csr_array(np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]))
    rows: IntArray = np.array([3, 1, 0])
    assert [component.tolist() for component in components_of(links, rows)] == [[0, 1], [3]]


@pytest.mark.parametrize("seed", range(4))
def test_many_rows_meet_the_demands_as_few_would(seed: int) -> None:
    """Above half of all rows those that are missing are counted."""
    random = np.random.default_rng(seed)
    sees = csr_array(random.random((12, 30)) < 0.2)
    cover = Cover.of_whole(csr_array(sees.astype(np.int64)), random.integers(1, 9, 30), 90)
    for count in range(13):
        rows = np.sort(random.permutation(12)[:count])
        assert meets(cover, rows) == (not cover.missing(cover.covered_by(rows)).any())


@pytest.mark.parametrize("seed", range(4))
def test_components_are_the_same_compiled_interpreted_and_by_scipy(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = np.random.default_rng(seed)
    later = np.triu(random.random((60, 60)) < 0.02, 1).astype(np.int64)
    links = csr_array(later + later.T)
    rows = np.flatnonzero(random.random(60) < 0.8)
    compiled = [component.tolist() for component in components_of(links, rows)]
    interpreted = np.full(60, -1)
    label_components(
        links.indptr, links.indices, np.isin(np.arange(60), rows), interpreted, np.empty(60, int)
    )
    interpret(monkeypatch)
    assert [component.tolist() for component in components_of(links, rows)] == compiled
    assert interpreted.max() + 1 == len(compiled) > 1
    assert all(len(set(interpreted[component].tolist())) == 1 for component in compiled)


@pytest.mark.parametrize("seed", range(10))
def test_components_with_each_further_row_are_counted_at_once(seed: int) -> None:
    random = np.random.default_rng(seed)
    upper = np.triu(random.random((30, 30)) < 0.06, 1)
    links = csr_array((upper | upper.T).astype(np.int8))
    cover = Cover.of_whole(csr_array(np.eye(30, dtype=np.int8)), np.ones(30, np.int64), 24)
    task = ConnectedCover(cover, links, np.arange(30))
    for count in (0, 1, 8):
        rows = np.sort(random.choice(30, count, replace=False))
        each = [task.parts(np.union1d(rows, [row]).astype(np.int64)) for row in range(30)]
        assert task.parts_with_each(rows).tolist() == each


@pytest.mark.parametrize("seed", range(8))
def test_rows_that_stay_count_by_their_components(seed: int) -> None:
    task, random = task_of(seed, rows=30, near=0.2), np.random.default_rng(seed)
    mixed = random.permutation(30)
    rows, others = np.sort(mixed[:12]), np.sort(mixed[12:20])
    parts = task.among(rows, others)
    for _ in range(10):
        chosen = np.flatnonzero(random.random(12) < 0.4)
        each = task.parts_with_each(np.union1d(rows[chosen], others))
        assert parts(chosen).tolist() == each[rows].tolist()
    assert task.among(rows, others[:0])(chosen).tolist() == task.parts_with_each(rows[chosen])[rows].tolist()
