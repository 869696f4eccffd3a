"""Zones: sets of candidates of which every selection has at least one.

Some fraction of the targets may stay unseen, so a single target makes no zone. A zone grows around a
candidate until the candidates outside it see less than some demand requires.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.selection.cover import Cover

WIDEST = 400_000
"""Entries of a demand's columns above which no zones grow for it: they would hold most candidates."""
WORK = 30_000_000
"""Entries evaluated for a demand, so that zones grow around fewer candidates where it is wide."""


@dataclass(frozen=True, eq=False)
class Zones:
    """Sets of rows of which every selection has one, and the distance of the farthest from the centre."""

    rows: list[IntArray]
    radius: FloatArray
    """(zones,)."""
    required: IntArray
    """Rows that are all in every selection."""
    candidates: int

    @classmethod
    def of(cls, cover: Cover, xy: FloatArray, required: IntArray) -> Zones:
        """A zone for each demand around each row at `xy` (rows, 2) that sees some of it, at most."""
        demands = np.flatnonzero(cover.needed > 0).tolist()
        grown = [zone for demand in demands for zone in _grown(cover, xy, demand)]
        radius = np.array([radius for _, radius in grown])
        return cls([rows for rows, _ in grown], radius, required, cover.rows)

    @cached_property
    def packings(self) -> list[list[IntArray]]:
        """Sets of zones without common rows: those that have few in common with others first, or small ones.

        Each required row is a zone of its own in all of them.
        """
        size = np.array([len(rows) for rows in self.rows])
        times = np.bincount(np.concatenate([*self.rows, np.empty(0, np.int64)]), minlength=self.candidates)
        most, all_ = (np.array([of(times[rows]) for rows in self.rows]) for of in (np.max, np.sum))
        return [self._packed(np.argsort(by, kind="stable")) for by in (all_, most, size, self.radius)]

    def _packed(self, order: IntArray) -> list[IntArray]:
        is_used, packed = np.zeros(self.candidates, dtype=bool), list(self.required[:, None])
        is_used[self.required] = True
        for rows in (self.rows[k] for k in order.tolist()):
            if not is_used[rows].any():
                is_used[rows] = True
                packed.append(rows)
        return packed


def _grown(cover: Cover, xy: FloatArray, demand: int) -> Iterator[tuple[IntArray, float]]:
    """Zones of a demand, with their radii."""
    own = slice(cover.worth.indptr[demand], cover.worth.indptr[demand + 1])
    columns, worth = cover.worth.indices[own], cover.worth.data[own].astype(np.int64)
    is_seen = np.diff(cover.seen_by.indptr)[columns] > 0
    seen_by, worth = cover.seen_by[columns[is_seen]], worth[is_seen]
    if not len(worth) or seen_by.nnz > WIDEST:
        return
    rows, place = np.unique(seen_by.indices, return_inverse=True)
    for seed in range(0, len(rows), max(1, -(-len(rows) * seen_by.nnz // WORK))):
        away = np.round(np.hypot(*(xy[rows] - xy[rows[seed]]).T), 6)
        farthest = np.maximum.reduceat(away[place], seen_by.indptr[:-1])
        order = np.argsort(-farthest, kind="stable")
        k = int(np.searchsorted(np.cumsum(worth[order]), cover.needed[demand]))
        if k < len(order):
            radius = float(farthest[order[k]])
            yield rows[away <= radius].astype(np.int64), radius
