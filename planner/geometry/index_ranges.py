"""Ranges of indices, one after the other; and indices without repetition."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray


def ranges(first: IntArray, counts: IntArray) -> IntArray:
    """`first[k]`, `first[k] + 1`, …, `counts[k]` of each, one after the other."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    return np.arange(total) + np.repeat(first - (ends - counts), counts)


def distinct(indices: IntArray, size: int) -> IntArray:
    """Return each of the indices below `size` once, ascending; a mask does it faster than sorting."""
    found = np.zeros(size, dtype=bool)
    found[indices] = True
    return np.flatnonzero(found)
