"""Districts of a large selection: each is searched for fewer stops while all others stay.

A swap on a large floor concerns few stops, but the search would evaluate all of them for each. So stops
that see the same things form a district, a small problem of its own: what the other stops leave to see.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.planner.geometry.index_ranges import distinct
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.running_coverage import RunningCoverage

SIZE = 60
"""Most stops of a district."""
DistrictSearch = Callable[[Cover, IntArray, int], IntArray]
"""`(problem, start, at least) -> rows`: as few rows as it finds."""


def improved_by_districts(
    cover: Cover, chosen: IntArray, search: DistrictSearch, *, at_least: int, settled: set[int]
) -> IntArray:
    """A smaller selection, never below the lower bound `at_least`: districts are searched in turn.

    Rows `settled` were searched before without success, and are again only around others. More are added.
    """
    is_chosen, coverage, many = _mask(cover, chosen), RunningCoverage(cover, chosen), len(chosen)
    is_settled = _mask(cover, np.fromiter(settled, np.int64))
    while many > at_least and len(district := _around_first(cover, is_chosen, is_settled)):
        coverage.remove(district)
        is_chosen[district] = False
        found = _searched(coverage, is_chosen, district, search, max(0, len(district) - (many - at_least)))
        if len(found) == len(district):
            settled.update(district.tolist())
            is_settled[district] = True
        coverage.add(found)
        is_chosen[found] = True
        many -= len(district) - len(found)
    return np.flatnonzero(is_chosen)


def _mask(cover: Cover, rows: IntArray) -> BoolArray:
    found = np.zeros(cover.rows, dtype=bool)
    found[rows] = True
    return found


def _around_first(cover: Cover, is_chosen: BoolArray, is_settled: BoolArray) -> IntArray:
    """The first row that is not settled, with those that see the same columns, directly or over others."""
    found = newest = np.flatnonzero(is_chosen & ~is_settled)[:1]
    while len(newest) and len(found) < SIZE:
        seers = cover.worths.seers(_to_cover(cover, newest))
        newest = np.setdiff1d(seers[is_chosen[seers]], found)
        found = np.concatenate([found, newest])
    return np.sort(found[:SIZE])


def _to_cover(cover: Cover, rows: IntArray) -> IntArray:
    """The columns of the whole that any of these rows sees.

    A separator of a network is seen by rows of many rooms, which have nothing else in common.
    """
    columns = cover.columns_of_each(rows)
    return distinct(columns[cover.weight[columns] > 0], cover.columns)


def _searched(
    others: RunningCoverage, is_other: BoolArray, district: IntArray, search: DistrictSearch, least: int
) -> IntArray:
    """The district's rows, or fewer if the search finds them; `others` covers what all other rows do."""
    problem, offered = _problem_of(others, is_other, district)
    found = search(problem, np.searchsorted(offered, district), least)
    return offered[found] if len(found) < len(district) else district


def _problem_of(others: RunningCoverage, is_other: BoolArray, district: IntArray) -> tuple[Cover, IntArray]:
    """The problem that the other rows leave in a district, and the rows offered there (ascending)."""
    cover, missing = others.cover, others.missing
    seen = distinct(cover.columns_of_each(district), cover.columns)
    seers = cover.worths.seers(seen[others.left(seen) > 0])
    offered = np.union1d(seers[~is_other[seers]], district)
    sees = cover.sees[offered]
    columns = distinct(sees.indices, cover.columns)
    left = others.left(columns)
    columns, left = columns[left > 0], left[left > 0]
    demands = np.union1d([0], np.flatnonzero(missing))
    worth = _with_columns(cover.adds_to[columns], demands)
    return Cover(_with_columns(sees, columns), csr_array(worth.T), missing[demands], left), offered


def _with_columns(matrix: csr_array, columns: IntArray) -> csr_array:
    """These columns (ascending) of a matrix, at no cost for all the others."""
    place_of = np.full(matrix.shape[1], -1, dtype=np.int32)
    place_of[columns] = np.arange(len(columns))
    place = place_of[matrix.indices]
    kept = place >= 0
    counts = np.concatenate([[0], np.cumsum(kept)])
    return csr_array(
        (matrix.data[kept], place[kept], counts[matrix.indptr]), shape=(matrix.shape[0], len(columns))
    )
