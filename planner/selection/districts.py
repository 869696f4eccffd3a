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
    while len(rows) > at_least and len(district := _around_first(cover, rows, settled)):
        found = _searched(cover, rows, district, search, at_least)
        if len(found) == len(rows):
            settled.update(district.tolist())
        rows = found
    return rows


def _around_first(cover: Cover, rows: IntArray, settled: set[int]) -> IntArray:
    """The first row that is not settled, with those that see the same columns, directly or over others."""
    first = next((k for k, row in enumerate(rows.tolist()) if row not in settled), None)
    if first is None:
        return rows[:0]
    sees = cover.sees[rows]
    found, newest = np.array([first]), np.array([first])
    while len(newest) and len(found) < SIZE:
        seen = np.zeros(cover.columns, dtype=np.int64)
        seen[sees[newest].indices] = 1
        newest = np.setdiff1d(np.flatnonzero(sees @ seen), found)
        found = np.concatenate([found, newest])
    return np.sort(rows[found[:SIZE]])


def _searched(
    cover: Cover, rows: IntArray, district: IntArray, search: DistrictSearch, at_least: int
) -> IntArray:
    """The rows, with fewer in one district if the search finds them."""
    others = np.setdiff1d(rows, district)
    problem, offered = _problem_of(cover, others, district)
    least = max(0, len(district) - (len(rows) - at_least))
    found = search(problem, np.searchsorted(offered, district), least)
    return np.sort(np.concatenate([others, offered[found]])) if len(found) < len(district) else rows


def _problem_of(cover: Cover, others: IntArray, district: IntArray) -> tuple[Cover, IntArray]:
    """The problem that the other rows leave in a district, and the rows offered there (ascending)."""
    covered = cover.covered_by(others)
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
