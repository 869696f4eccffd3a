"""Drop-and-repair: remove one stop, then swap stops until every demand is met again.

The stop that uncovers least is removed first. Where the swaps then lead nowhere, each of the others is
removed instead, with fewer swaps and as long as the work allowed lasts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.districts import improved_by_districts
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.swap_search import TENURE, repaired

SWAPS = 400
"""Most swaps in the search for a smaller selection; a count, so that no plan depends on speed."""
TRIALS = 24_000
"""Stops evaluated in all those swaps together, so that large floors get fewer swaps."""
ENTRIES = 300_000_000
"""Views of columns evaluated in all swaps, so that open floors and long ranges also get fewer swaps.

With a sixth of them, `office-l1` takes 64 stops at range 10 for 60, and 61 at range 20 for 59.
"""
OTHER_SWAPS = 100
"""Most swaps after the removal of another stop than the one that uncovers least."""
OTHER_ENTRIES = 60_000_000
"""Views of columns evaluated after all such removals."""
FEW = 30
"""Most stops of a selection for which other removals are tried; they rarely help with more."""
LARGE = 100
"""Stops of a selection above which it is searched by districts."""
DISTRICT_SWAPS = 240
"""Swaps in a district before its search ends. With a quarter, 7 100 m² take 247 stops at range 10 for 235."""


def improved(
    cover: Cover,
    chosen: IntArray,
    *,
    at_least: int,
    swaps: int = SWAPS,
    settled: set[int] | None = None,
) -> IntArray:
    """The smallest selection that drop-and-repair finds, never below the lower bound `at_least`.

    A large one is searched by districts, each with `DISTRICT_SWAPS` at most; `settled` keeps the rows
    searched in vain between two searches.
    """
    if len(chosen) > LARGE:
        most = min(swaps, DISTRICT_SWAPS)
        return improved_by_districts(
            cover, chosen, lambda part, rows, least: _improved(part, rows, least, most),
            at_least=at_least, settled=set() if settled is None else settled,
        )  # fmt: skip
    return _improved(cover, chosen, at_least, min(swaps, most_swaps(cover, len(chosen))))


def found_among(cover: Cover, likely: IntArray, *, at_least: int) -> IntArray | None:
    """A selection of some rows alone; None if they do not meet every demand."""
    among = cover.offering(likely)
    return None if (among.needed < cover.needed).any() else improved(among, greedy(among), at_least=at_least)


def most_swaps(cover: Cover, many: int) -> int:
    """Swaps of a selection of so many rows that take no more than the work allowed."""
    least = min(TRIALS // max(1, many), ENTRIES // _entries_at_once(cover, many))
    return min(SWAPS, max(TENURE, least))


def _entries_at_once(cover: Cover, many: int) -> int:
    """Views of columns evaluated in one swap of so many rows, about."""
    return max(1, many * cover.sees.nnz**2 // max(1, cover.rows * cover.columns))


def repaired_again(cover: Cover, chosen: IntArray) -> IntArray | None:
    """As many rows that meet every demand, from rows that do not; None if none are found."""
    if len(chosen) > LARGE:
        return None
    return repaired(cover, chosen.tolist(), most_swaps(cover, len(chosen)))


@dataclass
class EntriesLeft:
    """Views of columns that may still be evaluated after the removal of other stops."""

    entries: int = OTHER_ENTRIES


def improved_otherwise(cover: Cover, chosen: IntArray, *, at_least: int, work: EntriesLeft) -> IntArray:
    """A smaller selection by the removal of another row than the one that uncovers least, if one is found.

    It is for selections that `improved` leaves as they are.
    """
    tried = _without_one(cover, chosen)[1:] if at_least < len(chosen) <= FEW else []
    for rows in tried:
        work.entries -= OTHER_SWAPS * _entries_at_once(cover, len(rows))
        if work.entries < 0:
            break
        smaller = repaired(cover, rows, OTHER_SWAPS)
        if smaller is not None:
            smaller = improved(cover, smaller, at_least=at_least)
            return improved_otherwise(cover, smaller, at_least=at_least, work=work)
    return chosen


def _improved(cover: Cover, best: IntArray, at_least: int, swaps: int) -> IntArray:
    while len(best) > at_least:
        smaller = repaired(cover, _without_one(cover, best)[0], swaps)
        if smaller is None:
            return best
        best = smaller
    return best


def _without_one(cover: Cover, chosen: IntArray) -> list[list[int]]:
    """The selection without each of its rows, those first whose removal uncovers least."""
    covered = cover.covered_by(chosen)
    alone = [int(cover.weight[c][covered[c] == cover.asks[c]].sum()) for c in map(cover.columns_of, chosen)]
    return [np.delete(chosen, k).tolist() for k in np.argsort(alone, kind="stable")]
