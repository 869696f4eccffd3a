"""Greedy selection (paper, 3.4): the candidate that sees most first, then always the largest gain."""

from __future__ import annotations

import numpy as np

from mission.geometry import IntArray
from planner.selection.cover import Cover


def greedy(cover: Cover) -> IntArray:
    """Rows in the order they are chosen, until enough is covered; ties go to the lower row."""
    covered = np.zeros(len(cover.weight), dtype=np.int64)
    chosen: list[int] = []
    while cover.units(covered) < cover.needed:
        gains = cover.gains(covered)
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break  # the rows offered do not see enough
        chosen.append(best)
        covered[cover.columns_of(best)] += 1
    return np.array(chosen, dtype=np.int64)


def in_greedy_order(cover: Cover, rows: IntArray) -> IntArray:
    """The same rows, each time the one with the largest gain first."""
    covered = np.zeros(len(cover.weight), dtype=np.int64)
    left, ordered = sorted(rows.tolist()), []
    while left:
        gains = cover.gains(covered)[left]
        ordered.append(left.pop(int(np.argmax(gains))))
        covered[cover.columns_of(ordered[-1])] += 1
    return np.array(ordered, dtype=np.int64)
