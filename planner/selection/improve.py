"""Drop-and-repair: remove one stop, then swap stops until every demand is met again."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.districts import improved_by_districts
from stopgo.planner.selection.swap_search import TENURE, repaired

SWAPS = 400
"""Most swaps in the search for a smaller selection; a count, so that no plan depends on speed."""
TRIALS = 24_000
"""Stops evaluated in all those swaps together, so that large floors get fewer swaps."""
ENTRIES = 50_000_000
"""Views of columns evaluated in all swaps, so that open floors and long ranges also get fewer swaps."""
LARGE = 100
"""Stops of a selection above which it is searched by districts."""
DISTRICT_SWAPS = 60
"""Swaps in a district before its search ends."""


def improved(
    cover: Cover,
    chosen: IntArray,
    *,
    at_least: int,
    swaps: int = SWAPS,
    settled: set[int] | None = None,
) -> IntArray:
    """The smallest selection that drop-and-repair finds, never below the lower bound `at_least`.

    A large one is searched by districts, each with `DISTRICT_SWAPS`; `settled` keeps the rows searched in
    vain between two searches.
    """
    if len(chosen) > LARGE:
        return improved_by_districts(
            cover, chosen, lambda part, rows, least: _improved(part, rows, least, DISTRICT_SWAPS),
            at_least=at_least, settled=set() if settled is None else settled,
        )  # fmt: skip
    at_once = len(chosen) * cover.sees.nnz**2 // max(1, cover.rows * cover.columns)
    least = min(TRIALS // max(1, len(chosen)), ENTRIES // max(1, at_once))
    return _improved(cover, chosen, at_least, min(swaps, max(TENURE, least)))


def _improved(cover: Cover, best: IntArray, at_least: int, swaps: int) -> IntArray:
    while len(best) > at_least:
        smaller = repaired(cover, _without_least(cover, best), swaps)
        if smaller is None:
            return best
        best = smaller
    return best


def _without_least(cover: Cover, chosen: IntArray) -> list[int]:
    """The selection without the row whose removal uncovers least."""
    covered = cover.covered_by(chosen)
    alone = [int(cover.weight[c][covered[c] == cover.asks[c]].sum()) for c in map(cover.columns_of, chosen)]
    return np.delete(chosen, int(np.argmin(alone))).tolist()
