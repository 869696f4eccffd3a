"""Zones: sets of candidates of which every selection has at least one.

Some fraction of the targets may stay unseen, so a single target makes no zone. A zone grows around a
candidate until the candidates outside it see less than some demand requires.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.selection.cover import Cover

MOST_SEEDS = 1500
"""Most candidates around which zones are grown."""


@dataclass(frozen=True, eq=False)
class Zone:
    """Rows of which every selection has one, and the distance of the farthest from the centre."""

    rows: IntArray
    radius: float


def zones_of(cover: Cover, lengths: FloatArray) -> list[Zone]:
    """A zone around each row that sees anything, the smallest first; `lengths` (rows, rows) are of paths."""
    growth = _Growth(cover)
    offered = np.flatnonzero(np.diff(cover.sees.indptr))
    seeds = offered[:: max(1, -(-len(offered) // MOST_SEEDS))]
    grown = [zone for seed in seeds.tolist() if (zone := growth.round(lengths[seed])) is not None]
    return sorted(grown, key=lambda zone: zone.radius)


class _Growth:
    """Growth of zones: what rows beyond a distance can still see, by demand."""

    def __init__(self, cover: Cover) -> None:
        self._cover = cover
        self._seen = np.flatnonzero(np.diff(cover.seen_by.indptr))
        self._first = cover.seen_by.indptr[self._seen]
        worth = cover.worth.tocoo()
        self._demand, self._column = (np.asarray(at, dtype=np.int64) for at in worth.coords)
        few = len(cover.needed) <= np.iinfo(np.int16).max
        self._short_demand = self._demand.astype(np.int16) if few else self._demand  # sorted in one pass
        self._worth = worth.data.astype(np.int64)
        self._begin = np.searchsorted(np.sort(self._demand), np.arange(len(cover.needed)))
        self._sees = [self._seers(demand) for demand in range(len(cover.needed))]

    def _seers(self, demand: int) -> IntArray:
        """Rows that see any part of a demand."""
        columns = self._column[self._demand == demand]
        return np.unique(self._cover.seen_by[columns].indices).astype(np.int64)

    def round(self, away: FloatArray) -> Zone | None:
        """The smallest zone around a seed, by the distance of each row, `away` (rows,); None if none."""
        cover = self._cover
        farthest = np.full(cover.columns, -np.inf)
        farthest[self._seen] = np.maximum.reduceat(away[cover.seen_by.indices], self._first)
        reach = farthest[self._column]
        order = np.argsort(-reach, kind="stable")
        order = order[np.argsort(self._short_demand[order], kind="stable")]
        sums = np.cumsum(self._worth[order])
        before = np.concatenate([[0], sums])[self._begin]
        radius, which = np.inf, -1
        for demand in np.flatnonzero(cover.needed > 0).tolist():
            k = int(np.searchsorted(sums, before[demand] + cover.needed[demand]))
            if k < len(order) and self._demand[order[k]] == demand and reach[order[k]] < radius:
                radius, which = float(reach[order[k]]), demand
        if which < 0:
            return None
        rows = self._sees[which]
        return Zone(rows[away[rows] <= radius], radius)
