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
    rows = np.sort(chosen)
    covered = cover.covered_by(rows)
    while len(rows) > at_least and len(district := _around_first(cover, rows, settled)):
        covered -= cover.covered_by(district)
        least = max(0, len(district) - (len(rows) - at_least))
        found = _searched(cover, rows, covered, district, search, least)
        if len(found) == len(district):
            settled.update(district.tolist())
        covered += cover.covered_by(found)
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
    cover: Cover,
    rows: IntArray,
    covered: IntArray,
    district: IntArray,
    search: DistrictSearch,
    least: int,
) -> IntArray:
    """The district's rows, or fewer if the search finds them; `covered` is what the other rows cover."""
    problem, offered = _problem_of(cover, np.setdiff1d(rows, district), covered, district)
    found = search(problem, np.searchsorted(offered, district), least)
    return offered[found] if len(found) < len(district) else district


def _problem_of(
    cover: Cover, others: IntArray, covered: IntArray, district: IntArray
) -> tuple[Cover, IntArray]:
    """The problem that the other rows leave in a district, and the rows offered there (ascending)."""
    lost = np.flatnonzero((covered < cover.asks) & (cover.covered_by(district) > 0))
    offered = np.setdiff1d(np.union1d(cover.seen_by[lost].indices, district), others).astype(np.int64)
    sees = cover.sees[offered]
    columns = np.flatnonzero((covered < cover.asks) & (np.asarray(sees.sum(axis=0)).ravel() > 0))
    missing = cover.missing(covered)
    demands = np.union1d([0], np.flatnonzero(missing))
    problem = Cover(
        csr_array(sees[:, columns]),
        csr_array(cover.worth[demands][:, columns]),
        missing[demands],
        (cover.asks - covered)[columns],
    )
    return problem, offered
