"""Candidates -> pairs whose scans register with one another, by the boundary that both see."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.mission.stages import Candidates
from stopgo.mission.stages.network import CONFIDENCE
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.overlap.boundary import shown
from stopgo.planner.overlap.pair_kernel import firm_pairs
from stopgo.planner.overlap.pairs import DIGITS, FLOOR_M, NOISE_M, Overlaps, Pairs

ACCURACY_M = 0.01
"""Error that a registered pair may have, also at LEVER_M from the scanner."""
LEAST_HOLD_M = round((CONFIDENCE * NOISE_M) ** 2 / (ACCURACY_M**2 - (CONFIDENCE * FLOOR_M) ** 2), 4)
"""Least registration strength of a pair: metres of wall that face its weakest direction."""
LEAST_COMMON_M = 1.0
"""Least length of boundary in metres that both must see."""
ROUNDING = 0.5 * 10.0**-DIGITS
"""Error of a pair's rounded figures."""


@instance_cached
def overlaps_of(candidates: Candidates) -> Overlaps:
    """The boundary that kept candidates see in common."""
    return _overlaps_of(candidates)


def _overlaps_of(candidates: Candidates) -> Overlaps:
    """The same, not kept: of a large floor it is a tenth of all memory."""
    return Overlaps(shown(candidates, np.arange(len(candidates.kept))))


def registers(pairs: Pairs, *, share: float) -> IntArray:
    """Indices of the pairs that register: enough strength, common boundary and overlap ratio."""
    firm = (pairs.hold_m >= LEAST_HOLD_M) & (pairs.common_m >= LEAST_COMMON_M)
    return np.flatnonzero(firm & (pairs.share >= share))


def links_of(candidates: Candidates) -> csr_array:
    """1 where two kept candidates register, by the overlap ratio of the settings (rows, rows)."""
    overlaps, share = _overlaps_of(candidates), candidates.settings.least_overlap
    kernel = compiled(firm_pairs, large=False)
    pairs = _links(overlaps, share) if kernel is None else links_by_kernel(kernel, overlaps, share)
    ends = tuple(np.concatenate([np.empty(0, np.int64), *ends]) for ends in zip(*pairs, strict=True))
    later = csr_array((np.ones(len(ends[0]), np.int8), ends), shape=(overlaps.rows,) * 2)
    return (later + later.T).tocsr()


def _links(overlaps: Overlaps, share: float) -> Iterator[tuple[IntArray, IntArray]]:
    """Rows that register with later rows, and these, in numpy."""
    for pairs in overlaps.later(least_m=LEAST_COMMON_M):
        good = registers(pairs, share=share)
        yield pairs.row[good], pairs.other[good]


def links_by_kernel(
    kernel: Callable[..., int], overlaps: Overlaps, share: float
) -> Iterator[tuple[IntArray, IntArray]]:
    """The same by the kernel, compiled or as written, with the rounding of the figures of a pair."""
    least = (LEAST_COMMON_M - ROUNDING, LEAST_HOLD_M - ROUNDING)
    for row, other, common in overlaps.firm(kernel, *least):
        found = np.round(common / np.minimum(overlaps.shown_m[row], overlaps.shown_m[other]), DIGITS) >= share
        yield row[found], other[found]


__all__ = [
    "LEAST_COMMON_M",
    "LEAST_HOLD_M",
    "Overlaps",
    "Pairs",
    "links_of",
    "overlaps_of",
    "registers",
]
