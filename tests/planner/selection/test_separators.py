"""Separators and what is around a component, compared with searches of the whole graph."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.component_kernel import grow_parts
from stopgo.planner.selection.connected_selection import ConnectedCover
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.link_graph import LinkGraph
from stopgo.planner.selection.running_coverage import RunningCoverage
from stopgo.planner.selection.separators import components_of, regions_of
from tests.faults.sizes import size
from tests.planner.checks import meets
from tests.planner.kernels import interpret
from tests.planner.selection.test_connected_selection import task_of
from tests.planner.selection.test_swaps import cover_of_rooms

SEEDS = range(size(short=8, full=100))


def graph_of(seed: int, rows: int = 60, share: float = 0.04) -> csr_array:
    random = np.random.default_rng(seed)
    later = np.triu(random.random((rows, rows)) < share, 1).astype(np.int64)
    return csr_array(later + later.T)


def _as_written(graph: LinkGraph, seeds: IntArray, inside: IntArray) -> int:
    """Number of rows met by the kernel as it is written."""
    label, following, met = (np.full(len(inside), -1, np.int64) for _ in range(3))
    parent, head, tail, turn = (np.zeros(len(seeds), np.int64) for _ in range(4))
    links = graph.links
    return grow_parts(
        links.indptr, links.indices, inside, seeds, label, parent, head, tail, turn, following, met
    )  # fmt: skip


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_around_rows_are_those_of_the_whole_graph(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    graph, random = LinkGraph(graph_of(seed)), np.random.default_rng(seed)
    inside = (random.random(60) < 0.7).astype(np.int64)
    seeds = np.flatnonzero(random.random(60) < 0.2)
    found = graph.parts_around(seeds, inside)
    components = [one.tolist() for one in components_of(graph.links, np.flatnonzero(inside))]
    touched = [one for one in components if set(one) & set(seeds.tolist())]
    known = [part.tolist() for part in found.whole]
    assert all(part in touched for part in known)
    assert len(known) + (len(found.last) > 0) == len(touched)
    assert all(any(set(part) <= set(one) for one in touched) for part in [found.last.tolist()])
    assert _as_written(graph, seeds, inside) == len(found.last) + sum(map(len, known))
    interpret(monkeypatch)
    plain = graph.parts_around(seeds, inside)
    assert sorted([*(part.tolist() for part in plain.whole), plain.last.tolist()]) == (
        sorted(touched) or [[]]
    )


def _plain_separators(task: ConnectedCover, rows: IntArray) -> Iterator[list[int]]:
    """Separators by components of the whole graph and sums over all rows."""
    for k, region in enumerate(task.regions):
        elsewhere = np.concatenate([np.empty(0, np.int64), *task.regions[:k], *task.regions[k + 1 :]])
        inner = components_of(task.links, np.intersect1d(rows, region))
        for component in inner:
            others = np.setdiff1d(np.concatenate(inner), component)
            around = np.setdiff1d(task.links[component].indices, component)
            for beyond in components_of(task.links, np.setdiff1d(region, around)):
                if np.isin(others, beyond).any():
                    between = np.setdiff1d(task.links[beyond].indices, beyond)
                    here = np.setdiff1d(region, np.union1d(beyond, between))
                    sides = (np.concatenate([side, elsewhere]) for side in (here, beyond))
                    if not any(meets(task.cover, side) for side in sides):
                        yield between.tolist()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("seed", SEEDS)
def test_separators_are_those_found_in_the_whole_graph(
    seed: int, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        interpret(monkeypatch)
    task = task_of(seed, rows=60, columns=90, near=0.13)
    rows = greedy(task.problem)
    found = [between.tolist() for between in task.separating.separators(rows)]
    assert found == list(_plain_separators(task, rows))


def test_some_floors_have_separators() -> None:
    tasks = [task_of(seed, rows=60, columns=90, near=0.13) for seed in SEEDS]
    assert (
        sum(len(list(task.separating.separators(greedy(task.problem)))) for task in tasks) > len(tasks) // 2
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_a_row_splits_a_selection_as_components_say(seed: int) -> None:
    task = task_of(seed, rows=40, columns=60, near=0.25)
    rows = np.concatenate(task.regions)
    inside = task.inside(rows)
    for row in rows.tolist():
        assert task.splits(row, inside) == (task.parts(rows[rows != row]) > 0), row


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("views", [1, 3])
def test_a_running_coverage_is_that_of_its_rows(
    views: int, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        interpret(monkeypatch)
    cover, random = cover_of_rooms(1, views=views), np.random.default_rng(1)
    here = set(range(0, 24, 2))
    coverage = RunningCoverage(cover, np.array(sorted(here)))
    for _ in range(20):
        some = random.permutation(24)[:4]
        come, leave = (np.array([r for r in some if (r in here) == was], np.int64) for was in (False, True))
        assert coverage.enough_with(come) == meets(cover, np.array(sorted(here | set(come.tolist()))))
        assert coverage.enough_without(leave) == meets(cover, np.array(sorted(here - set(leave.tolist()))))
        coverage.add(come)
        coverage.remove(leave)
        here = (here | set(come.tolist())) - set(leave.tolist())
        covered = cover.covered_by(np.array(sorted(here)))
        assert coverage.covered.tolist() == covered.tolist()
        assert coverage.missing.tolist() == cover.missing(covered).tolist()


@pytest.mark.parametrize("seed", SEEDS)
def test_only_regions_that_are_needed_stay(seed: int) -> None:
    task = task_of(seed, rows=40, columns=60, near=0.1)
    components = components_of(task.links, task.offered)
    needed = list(components)
    for component in reversed(components):
        rest = [other for other in needed if other is not component]
        if rest and meets(task.cover, np.concatenate(rest)):
            needed = rest
    regions = regions_of(task.cover, components)
    assert meets(task.cover, np.concatenate(regions))
    assert len(regions) <= len(needed)
    same = [one.tolist() for one in regions] == [one.tolist() for one in needed]
    assert same or len(regions) < len(needed)
    least = [one[0] for one in regions]
    assert sorted(least, key=lambda row: [row in one for one in components].index(True)) == least


def test_of_components_that_all_stand_alone_the_fewest_stay() -> None:
    """Ten rows see two of twenty columns each, and four see a quarter: without the smallest, ten stayed."""
    sees = np.zeros((14, 20), np.int8)
    for k in range(10):
        sees[k, [2 * k, 2 * k + 1]] = 1
    for k in range(4):
        sees[10 + k, k::4] = 1
    cover = Cover.of_whole(csr_array(sees), np.ones(20, np.int64), 20)
    alone = [np.array([row]) for row in range(14)]
    assert [one.tolist() for one in regions_of(cover, alone)] == [[10], [11], [12], [13]]
