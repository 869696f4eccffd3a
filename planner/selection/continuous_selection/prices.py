"""Dual prices of units that prove a lower bound on the number of stops, over all positions.

Take any prices of demands p_k >= 0 and of units u_j >= 0 such that no stop sees units that cost more than M
together. They give the bound (Σ needed_k p_k - Σ_j max(0, Σ_k w_kj p_k - u_j)) / M, by weak duality of the
covering problem with a row for every position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, hstack, vstack

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.selection.linear_programme import minimised


@dataclass(frozen=True, eq=False)
class WantedUnits:
    """Coverage demands: each one a least weight of the units that belong to it."""

    weight: IntArray
    """Weight of each unit (units,); 0 where it does not count."""
    member: IntArray
    """(memberships, units): demands that each unit belongs to, -1 for none."""
    needed: FloatArray
    """(demands,)."""

    def paid(self, demand: FloatArray) -> FloatArray:
        """Amount paid for each unit, at prices of demands (units,)."""
        rate = np.where(self.member >= 0, demand[self.member], 0.0).sum(axis=0)
        paid: FloatArray = rate * self.weight
        return paid


@dataclass(frozen=True, eq=False)
class Prices:
    """Prices, and the bound that they prove if no stop sees units worth more than 1."""

    unit: FloatArray
    demand: FloatArray
    value: float
    stops: FloatArray
    """Amount of each position in the relaxed solution (rows,)."""

    @classmethod
    def of(cls, asked: WantedUnits, unit: FloatArray, demand: FloatArray, stops: FloatArray) -> Prices:
        beyond = np.maximum(0.0, asked.paid(demand) - unit).sum()
        return cls(unit, demand, float(asked.needed @ demand - beyond), stops)


def prices_of(asked: WantedUnits, row: IntArray, first: IntArray, last: IntArray, rows: int) -> Prices | None:
    """The prices with the highest bound for these rows' runs of units; None if the solver fails."""
    group, sees = _groups(asked, row, first, last, rows)
    inside = np.flatnonzero(group >= 0)
    groups, scale = sees.shape[1], max(1.0, float(asked.weight.sum()) / max(1, sees.shape[1]))
    which = asked.member[:, inside]
    belongs = which >= 0
    entries = np.tile(asked.weight[inside] / scale, len(which))[belongs.ravel()]
    places = (which[belongs], np.tile(group[inside], (len(which), 1))[belongs])
    worth = coo_array((entries, places), shape=(len(asked.needed), groups)).tocsr()
    solution = minimised(
        np.concatenate([np.ones(rows), np.zeros(groups)]),
        vstack(
            [
                hstack([sees.T, diags_array(-np.ones(groups))]),
                hstack([csr_array((len(asked.needed), rows)), worth]),
            ]
        ),
        np.concatenate([np.zeros(groups), asked.needed / scale]),
        np.concatenate([np.full(rows, np.inf), np.ones(groups)]),
    )
    if solution is None:
        return None
    duals = solution.prices
    weight = np.bincount(group[inside], asked.weight[inside], groups)
    unit = np.zeros(len(asked.weight))
    unit[inside] = (duals[:groups] / weight)[group[inside]] * asked.weight[inside]
    return Prices.of(asked, unit, duals[groups:] / scale, solution.values[:rows])


def _groups(
    asked: WantedUnits, row: IntArray, first: IntArray, last: IntArray, rows: int
) -> tuple[IntArray, csr_array]:
    """Group of each unit by its rows and demands (-1: does not count); and the rows that see each group."""
    total = len(asked.weight)
    changes = (np.diff(asked.member, axis=1) != 0).any(axis=0) | (np.diff(asked.weight > 0) != 0)
    begin = np.unique(np.concatenate([[0], first, last + 1, np.flatnonzero(changes) + 1]))
    begin = begin[begin < total]
    low, high = np.searchsorted(begin, first), np.searchsorted(begin, last, side="right")
    piece = ranges(low, high - low)
    seen = csr_array((np.ones(len(piece)), (piece, np.repeat(row, high - low))), shape=(len(begin), rows))
    seen.sum_duplicates()
    seen.sort_indices()
    known: dict[tuple[bytes, bytes], int] = {}
    number, kept = np.full(len(begin), -1, dtype=np.int64), list[int]()
    for k in np.flatnonzero((asked.weight[begin] > 0) & (np.diff(seen.indptr) > 0)):
        key = (
            seen.indices[seen.indptr[k] : seen.indptr[k + 1]].tobytes(),
            asked.member[:, begin[k]].tobytes(),
        )
        if key not in known:
            known[key] = len(kept)
            kept.append(int(k))
        number[k] = known[key]
    return np.repeat(number, np.diff(np.append(begin, total))), seen[kept].T.tocsr()
