"""Greedy selection (paper, 3.4): first the candidate that sees most, then always the largest gain."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy_kernel import choose


def greedy(cover: Cover) -> IntArray:
    """Rows in the order of choice, until every demand is met or no row adds anything."""
    return _by_gain(cover, _first_gains(cover), until_met=True)


def in_greedy_order(cover: Cover, rows: IntArray) -> IntArray:
    """The same rows, ordered so that each next row has the largest gain."""
    covered, short = np.zeros(cover.columns, dtype=np.int64), cover.views_needed
    gains = [(*_gain(cover, row, covered, short, cover.needed), row) for row in rows.tolist()]
    return _by_gain(cover, np.array(gains, dtype=np.int64).reshape(-1, 4), until_met=False)


def _by_gain(cover: Cover, gains: IntArray, *, until_met: bool) -> IntArray:
    """Rows by their gain for unmet demands, then by their total gain, then by the lower row number.

    `gains` are those before any row is chosen: negative ones in three ways, so that the least is the best,
    and the row (rows, 4).
    Gains only fall while rows are chosen. So an outdated gain is computed again only when its row
    reaches the head of the queue (Minoux, 1978).
    """
    kernel = compiled(choose, large=False)
    if kernel is not None:
        return _by_kernel(kernel, cover, gains, until_met=until_met)
    queue: list[tuple[int, ...]] = list(map(tuple, gains.tolist()))
    covered = np.zeros(cover.columns, dtype=np.int64)
    short, missing = cover.views_needed.copy(), cover.needed
    heapq.heapify(queue)
    chosen: list[int] = []
    while queue and (missing.any() or not until_met):
        *_, row = heapq.heappop(queue)
        fresh = (*_gain(cover, row, covered, short, missing), row)
        if queue and fresh > queue[0]:
            heapq.heappush(queue, fresh)
            continue
        if until_met and fresh[0] == 0 and fresh[1] == 0:
            break  # the rows offered do not see enough
        chosen.append(row)
        short -= np.minimum(short, _adds(cover, row, covered))
        covered[cover.columns_of(row)] += 1
        missing = short if cover.once else cover.missing(covered)
    return np.array(chosen, dtype=np.int64)


def _by_kernel(kernel: Callable[..., int], cover: Cover, gains: IntArray, *, until_met: bool) -> IntArray:
    """`_by_gain` by the kernel, compiled or as written."""
    keys = np.zeros((cover.rows, 3), dtype=np.int64)
    keys[gains[:, 3]] = gains[:, :3]
    sums, touched = (np.zeros(len(cover.needed), dtype=np.int64) for _ in range(2))
    wanted, needed = cover.views_needed.astype(np.int64), cover.needed.astype(np.int64)
    heap, chosen = gains[:, 3].copy(), np.zeros(len(gains), dtype=np.int64)
    state = (cover.asks.astype(np.int32), wanted, needed, keys.ravel(), heap, sums, touched, chosen)
    return chosen[: kernel(int(until_met), *cover.seen_columns, *cover.worths.added, *state)]


def _first_gains(cover: Cover) -> IntArray:
    """`_gain` of every row before any is chosen, and the row (rows, 4)."""
    adds = cover.adds
    gain, unmet = adds.copy(), adds.copy()
    gain.data = np.minimum(adds.data, cover.views_needed[adds.indices])
    unmet.data = np.where(cover.needed[adds.indices] > 0, adds.data, 0)
    first = np.asarray(gain.sum(axis=1)).ravel()
    second = np.where(first > 0, 0, np.asarray(unmet.sum(axis=1)).ravel())
    whole = adds[:, [0]].toarray().ravel()
    return np.stack([-first, -second, -whole, np.arange(cover.rows)], axis=1)


def _gain(
    cover: Cover, row: int, covered: IntArray, short: IntArray, missing: IntArray
) -> tuple[int, int, int]:
    """Negative gain of a row, so that the least is the best.

    First the views that are short. If there are none: views of unmet demands, which may be of columns
    not counted as short. Last the views of the whole.
    """
    gain, unmet, whole = cover.worths.gain(cover.columns_of(row), covered, cover.asks, short, missing)
    return -gain, 0 if gain else -unmet, -whole


def _adds(cover: Cover, row: int, covered: IntArray) -> IntArray:
    """Weight that a row adds to each demand, counting columns that still need views (demands,)."""
    columns = cover.columns_of(row)
    new = columns[covered[columns] < cover.asks[columns]]
    return cover.worths.of(new)
