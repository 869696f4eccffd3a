"""Drop-and-repair: try to do with one stop fewer, by swapping stops until every demand is met again."""

from __future__ import annotations

from collections import deque

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.board import Board
from stopgo.planner.selection.cover import Cover

SWAPS = 400
"""Most swaps tried before a smaller selection is given up; a count, so that no plan depends on speed."""
TRIALS = 24_000
"""Stops looked at for all those swaps together, so that large floors get fewer swaps."""
ENTRIES = 50_000_000
"""Views of columns looked at for them together, so that open floors and long ranges get fewer of them too."""
TENURE = 7
"""Swaps for which a row that left may not come back."""


def improved(cover: Cover, chosen: IntArray, *, at_least: int, swaps: int = SWAPS) -> IntArray:
    """A selection with as few rows as drop-and-repair finds, never fewer than the bound `at_least`."""
    best = chosen
    at_once = len(chosen) * cover.sees.nnz**2 // max(1, cover.rows * cover.columns)
    least = min(TRIALS // max(1, len(chosen)), ENTRIES // max(1, at_once))
    swaps = min(swaps, max(TENURE, least))
    while len(best) > at_least:
        smaller = _repaired(cover, _without_least(cover, best), swaps)
        if smaller is None:
            return best
        best = smaller
    return best


def _without_least(cover: Cover, chosen: IntArray) -> list[int]:
    """The selection without the row that least hangs on."""
    covered = cover.covered_by(chosen)
    alone = [int(cover.weight[c][covered[c] == cover.asks[c]].sum()) for c in map(cover.columns_of, chosen)]
    return np.delete(chosen, int(np.argmin(alone))).tolist()


def _repaired(cover: Cover, rows: list[int], swaps: int) -> IntArray | None:
    """Swap one row for another while that helps, or hurts least (tabu), until every demand is met."""
    board = Board(cover, rows)
    tabu: deque[int] = deque(maxlen=TENURE)
    for _ in range(swaps):
        if not board.missing.any():
            return np.array(sorted(rows), dtype=np.int64)
        if len(rows) == cover.rows:
            return None
        if len(set(rows) | set(tabu)) == cover.rows:
            tabu.clear()  # nobody else is left to come
        out, into = _best_swap(board, rows, tabu)
        board.insist()
        board.drop(out)
        board.take(into)
        rows[rows.index(out)] = into
        tabu.append(out)
    return None


def _best_swap(board: Board, rows: list[int], tabu: deque[int]) -> tuple[int, int]:
    """The swap after which least is missing, and of those the one after which most is covered."""
    best, swap = (np.inf, np.inf), (rows[0], rows[0])
    blocked = np.array([*rows, *tabu], dtype=np.int64)
    for out in sorted(rows):
        missing, covered = board.after_swaps(out)
        missing[blocked] = np.iinfo(np.int64).max
        alike = np.flatnonzero(missing == missing.min())
        into = int(alike[np.argmax(covered[alike])])
        worth = (int(missing[into]), -int(covered[into]))
        if worth < best:
            best, swap = worth, (out, into)
    return swap
