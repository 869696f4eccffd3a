"""Drop-and-repair: try to do with one stop fewer, by swapping stops until the coverage holds again."""

from __future__ import annotations

from collections import deque

import numpy as np

from mission.geometry import IntArray
from planner.selection.cover import Cover

SWAPS = 400
"""Most swaps tried before a smaller selection is given up; a count, so that no plan depends on speed."""
TRIALS = 24_000
"""Stops looked at for all those swaps together, so that large floors get fewer swaps."""
TENURE = 7
"""Swaps for which a row that left may not come back."""


def improved(cover: Cover, chosen: IntArray, *, at_least: int, swaps: int = SWAPS) -> IntArray:
    """A selection with as few rows as drop-and-repair finds, never fewer than the bound `at_least`."""
    best = chosen
    swaps = min(swaps, max(TENURE, TRIALS // max(1, len(chosen))))
    while len(best) > at_least:
        smaller = _repaired(cover, _without_least(cover, best), swaps)
        if smaller is None:
            return best
        best = smaller
    return best


def _without_least(cover: Cover, chosen: IntArray) -> list[int]:
    """The selection without the row that covers fewest units alone."""
    covered = cover.covered_by(chosen)
    alone = [int(cover.weight[c][covered[c] == 1].sum()) for c in map(cover.columns_of, chosen)]
    return np.delete(chosen, int(np.argmin(alone))).tolist()


def _repaired(cover: Cover, rows: list[int], swaps: int) -> IntArray | None:
    """Swap one row for another while that helps, or hurts least (tabu), until enough is covered."""
    covered = cover.covered_by(np.array(rows, dtype=np.int64))
    tabu: deque[int] = deque(maxlen=TENURE)
    for _ in range(swaps):
        if cover.units(covered) >= cover.needed:
            return np.array(sorted(rows), dtype=np.int64)
        out, into = _best_swap(cover, rows, covered, tabu)
        covered[cover.columns_of(out)] -= 1
        covered[cover.columns_of(into)] += 1
        rows[rows.index(out)] = into
        tabu.append(out)
    return None


def _best_swap(cover: Cover, rows: list[int], covered: IntArray, tabu: deque[int]) -> tuple[int, int]:
    """The swap after which most units are covered: units lost by leaving, then the largest gain."""
    best, swap = -np.inf, (rows[0], rows[0])
    blocked = np.array([*rows, *tabu], dtype=np.int64)
    gains_now = cover.gains(covered)
    for out in sorted(rows):
        columns = cover.columns_of(out)
        alone = columns[covered[columns] == 1]
        gains = gains_now + cover.weights_of(alone)
        gains[blocked] = -1
        into = int(np.argmax(gains))
        change = int(gains[into]) - int(cover.weight[alone].sum())
        if change > best:
            best, swap = change, (out, into)
    return swap
