"""Districts of a large selection: each is searched for fewer stops while all others stay.

A swap on a large floor concerns few stops, but the search would evaluate all of them for each. So stops
that see the same things form a district, a small problem of its own: what the other stops leave to see.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
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
    rows, coverage = np.sort(chosen), RunningCoverage(cover, chosen)
    while len(rows) > at_least and len(district := _around_first(cover, rows, settled)):
        coverage.remove(district)
        least = max(0, len(district) - (len(rows) - at_least))
        found = _searched(coverage, np.setdiff1d(rows, district), district, search, least)
        if len(found) == len(district):
            settled.update(district.tolist())
        coverage.add(found)
        rows = np.union1d(np.setdiff1d(rows, district), found)
    return rows


def _around_first(cover: Cover, rows: IntArray, settled: set[int]) -> IntArray:
    """The first row that is not settled, with those that see the same columns, directly or over others."""
    first = next((row for row in rows.tolist() if row not in settled), None)
    if first is None:
        return rows[:0]
    is_chosen = np.zeros(cover.rows, dtype=bool)
    is_chosen[rows] = True
    found = newest = np.array([first], dtype=np.int64)
    while len(newest) and len(found) < SIZE:
        seers = np.unique(cover.worths.seers(np.unique(cover.sees[newest].indices)))
        newest = np.setdiff1d(seers[is_chosen[seers]], found)
        found = np.concatenate([found, newest])
    return np.sort(found[:SIZE])


def _searched(
    others: RunningCoverage, rows: IntArray, district: IntArray, search: DistrictSearch, least: int
) -> IntArray:
    """The district's rows, or fewer if the search finds them; `others` covers what all other `rows` do."""
    problem, offered = _problem_of(others, rows, district)
    found = search(problem, np.searchsorted(offered, district), least)
    return offered[found] if len(found) < len(district) else district


def _problem_of(others: RunningCoverage, rows: IntArray, district: IntArray) -> tuple[Cover, IntArray]:
    """The problem that the other rows leave in a district, and the rows offered there (ascending)."""
    cover, left = others.cover, others.cover.asks - others.covered
    seen = np.unique(cover.sees[district].indices)
    seers = cover.worths.seers(seen[left[seen] > 0].astype(np.int64))
    offered = np.setdiff1d(np.union1d(seers, district), rows).astype(np.int64)
    sees, missing = cover.sees[offered], others.missing
    columns = np.unique(sees.indices)
    columns = columns[left[columns] > 0]
    demands = np.union1d([0], np.flatnonzero(missing))
    worth = _with_columns(cover.adds_to[columns], demands)
    return Cover(_with_columns(sees, columns), csr_array(worth.T), missing[demands], left[columns]), offered


def _with_columns(matrix: csr_array, columns: IntArray) -> csr_array:
    """These columns (ascending) of a matrix, at no cost for all the others."""
    place = np.searchsorted(columns, matrix.indices)
    place[place == len(columns)] = 0
    kept = columns[place] == matrix.indices if len(columns) else np.zeros(len(place), dtype=bool)
    counts = np.concatenate([[0], np.cumsum(kept)])
    return csr_array(
        (matrix.data[kept], place[kept], counts[matrix.indptr]), shape=(matrix.shape[0], len(columns))
    )
