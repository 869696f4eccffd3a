"""Rows that miss a little -> as many rows that meet every demand, by swaps: a tabu search.

Of all swaps the one with the least weighted shortfall is made, also where it is a step back. The penalty of
what stays unmet rises, and a removed row may not return at once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.selection.board import Board
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.swap_kernel import repair
from stopgo.planner.selection.swaps import SwapBoard

TENURE = 7
"""Swaps for which a removed row may not return."""
LARGEST = 40_000_000
"""Numbers in the kernel's tables above which it is not used. Of these most are never touched."""


def repaired(cover: Cover, rows: list[int], swaps: int) -> IntArray | None:
    """Swap rows until every demand is met; None if not before the last swap."""
    if len(rows) in (0, cover.rows):  # there is nothing to swap
        chosen = np.array(sorted(rows), dtype=np.int64)
        return None if cover.missing(cover.covered_by(chosen)).any() else chosen
    kernel = compiled(repair, large=False)
    size = len(rows) * cover.rows * cover.most_demands
    if kernel is None or size > LARGEST:
        return _by_board(cover, rows, swaps)
    return by_kernel(kernel, cover, rows, swaps)


def by_kernel(kernel: Callable[..., int], cover: Cover, rows: list[int], swaps: int) -> IntArray | None:
    """`repaired` by the kernel, compiled or as written."""
    board, most = Board(cover, rows), max(1, cover.most_demands)
    many, demands = len(rows), len(cover.needed)
    chosen, free = np.array(rows, dtype=np.int64), np.ones(cover.rows, dtype=np.int64)
    free[chosen] = 0

    def scratch(size: int, value: int = 0) -> IntArray:
        return np.full(size, value, dtype=np.int64)

    state = [*board.state(), chosen, free, scratch(TENURE), scratch(cover.rows, -1)]
    tables = [scratch(size) for size in (3 * many, many * most, many * most)]
    tables += [scratch(many * demands, -1), np.zeros(many * cover.rows * most, dtype=np.int64)]
    others = [scratch(demands, -1), scratch(cover.rows), scratch(5), scratch(3 * demands)]
    problem = (*cover.seen_columns, *cover.worths.runs_of_rows, *cover.worths.added)
    met = kernel(swaps, most, *problem, cover.asks, *state, *tables, *others)
    return np.sort(chosen) if met else None


def _by_board(cover: Cover, rows: list[int], swaps: int) -> IntArray | None:
    """`repaired` in numpy."""
    board = SwapBoard(cover, rows)
    tabu: deque[int] = deque(maxlen=TENURE)
    for _ in range(swaps):
        if not board.missing.any():
            return np.array(sorted(rows), dtype=np.int64)
        if len(set(rows) | set(tabu)) == cover.rows:
            tabu.clear()  # no other row is left to add
        out, into = board.best_swap(rows, [*rows, *tabu])
        board.raise_penalties()
        board.drop(out)
        board.take(into)
        rows[rows.index(out)] = into
        tabu.append(out)
    return None
