"""Candidates -> pairs whose scans register with one another, by the boundary that both see."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import IntArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates
from stopgo.mission.stages.network import CONFIDENCE, FLOOR_M, NOISE_M, noise_factor
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.instance_cache import instance_cached, store
from stopgo.planner.geometry.side_work import SideWork
from stopgo.planner.overlap.boundary import mesh_around, shown, solids_of
from stopgo.planner.overlap.pair_kernel import firm_pairs
from stopgo.planner.overlap.pairs import DIGITS, Overlaps, Pairs
from stopgo.planner.visibility.sight.mesh import Mesh

ACCURACY_M = 0.01
"""Error that a registered pair may have, also at LEVER_M from the scanner."""
LEAST_COMMON_M = 1.0
"""Least length of boundary in metres that both must see."""
MANY = 5000
"""Rows from which on two processes pair them."""
ROUNDING = 0.5 * 10.0**-DIGITS
"""Error of a pair's rounded figures."""


def least_hold_m(settings: Settings) -> float:
    """Least registration strength of a pair: metres of wall that face its weakest direction.

    With it 99 of 100 errors are within `ACCURACY_M`.
    """
    noise = CONFIDENCE * noise_factor(settings.range_noise)
    return round((noise * NOISE_M) ** 2 / (ACCURACY_M**2 - (noise * FLOOR_M) ** 2), 4)


@instance_cached
def overlaps_of(candidates: Candidates) -> Overlaps:
    """The boundary that kept candidates see in common."""
    return Overlaps(shown(candidates, np.arange(len(candidates.kept))))


def registers(pairs: Pairs, settings: Settings) -> IntArray:
    """Indices of the pairs that register: enough strength, common boundary and overlap ratio."""
    firm = (pairs.hold_m >= least_hold_m(settings)) & (pairs.common_m >= LEAST_COMMON_M)
    return np.flatnonzero(firm & (pairs.share >= settings.least_overlap))


@instance_cached
def links_of(candidates: Candidates) -> csr_array:
    """1 where two kept candidates register, by the overlap ratio of the settings (rows, rows)."""
    return _symmetric(_pairs_of(candidates), len(candidates.kept))


def _pairs_of(candidates: Candidates) -> list[tuple[NDArray[np.int32], ...]]:
    """Rows that register with later rows, and these, by row, in blocks."""
    settings, rows = candidates.settings, np.arange(len(candidates.kept))
    overlaps = Overlaps(shown(candidates, rows, only_wide=settings.least_overlap == 0))  # large, so not kept
    half, end = overlaps.rows // 2, overlaps.rows
    if end >= MANY:
        overlaps = overlaps.with_tables()
    with SideWork(lambda: _links(overlaps, settings, range(half, end)), forked=end >= MANY) as others:
        return _links(overlaps, settings, range(half)) + others.result()


def _symmetric(pairs: list[tuple[NDArray[np.int32], ...]], rows: int) -> csr_array:
    """The links of pairs in both directions (rows, rows); the pairs, by row, are as large, and forgotten."""
    pointer = np.zeros(rows + 1, dtype=np.int64)
    for row, _ in pairs:
        pointer[1:] += np.bincount(row, minlength=rows)
    np.cumsum(pointer, out=pointer)
    other = np.concatenate([np.empty(0, np.int32), *(other for _, other in pairs)])
    pairs.clear()
    small = pointer.astype(np.int32) if pointer[-1] < np.iinfo(np.int32).max // 2 else pointer
    later = csr_array((np.ones(len(other), np.int8), other, small), shape=(rows, rows))
    later.sort_indices()
    return csr_array((later + later.T.tocsr()).tocsr())


PairsFound = tuple[csr_array, BaseGeometry, Mesh]
"""Links, and from what they were found: the solids, and the open space around them."""


def pairs_found(candidates: Candidates) -> PairsFound:
    """The links of candidates with all that later questions about pairs need."""
    return links_of(candidates), solids_of(candidates.space), mesh_around(candidates)


def keep_pairs(candidates: Candidates, found: PairsFound) -> None:
    """Keep what another process found, so that it is not found again."""
    links, solids, mesh = found
    store(links_of, candidates, links)
    store(solids_of, candidates.space, solids)
    store(mesh_around, candidates, mesh)


def _links(overlaps: Overlaps, settings: Settings, rows: range) -> list[tuple[NDArray[np.int32], ...]]:
    """Rows that register with later rows, and these, in blocks and in 32 bits: there are millions."""
    kernel = compiled(firm_pairs, large=False)
    if kernel is None:
        pairs = _links_by_numpy(overlaps, settings, rows)
    else:
        pairs = links_by_kernel(kernel, overlaps, settings, rows)
    return [tuple(ends.astype(np.int32) for ends in some) for some in pairs]


def _links_by_numpy(
    overlaps: Overlaps, settings: Settings, rows: range
) -> Iterator[tuple[IntArray, IntArray]]:
    for pairs in overlaps.later(rows, least_m=LEAST_COMMON_M):
        good = registers(pairs, settings)
        yield pairs.row[good], pairs.other[good]


def links_by_kernel(
    kernel: Callable[..., int], overlaps: Overlaps, settings: Settings, rows: range | None = None
) -> Iterator[tuple[IntArray, IntArray]]:
    """The same by the kernel, compiled or as written, with the rounding of the figures of a pair."""
    least = (LEAST_COMMON_M - ROUNDING, least_hold_m(settings) - ROUNDING)
    for row, other, common in overlaps.firm(kernel, *least, rows):
        share = np.round(common / np.minimum(overlaps.shown_m[row], overlaps.shown_m[other]), DIGITS)
        found = share >= settings.least_overlap
        yield row[found], other[found]


__all__ = [
    "LEAST_COMMON_M",
    "Overlaps",
    "Pairs",
    "keep_pairs",
    "least_hold_m",
    "links_of",
    "overlaps_of",
    "pairs_found",
    "registers",
]
