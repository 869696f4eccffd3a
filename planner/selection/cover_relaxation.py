"""Linear relaxation of a selection: stops in part, with inequalities that whole stops meet, and its bound."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack, vstack

from stopgo.mission.geometry import FloatArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.knapsack_cuts import tightened
from stopgo.planner.selection.linear_programme import LinearProgramme, Solution


class CoverRelaxation:
    """The relaxation of a covering problem, of about so many entries: neighbouring columns are one.

    Demands on rows are added and taken away again, the last first. They may be left unmet at `unmet_cost`,
    so that there always is a solution.
    """

    def __init__(self, cover: Cover, entries: int, *, unmet_cost: float = 0.0) -> None:
        self._cover = cover
        self._fraction = group_fractions(cover, -(-cover.sees.nnz // entries))
        self._groups = self._fraction.shape[1]
        self._programme, self._scale = programme_of(grouped(cover, self._fraction), unmet_cost)
        self._demands = csr_array((0, cover.rows), dtype=float)
        self._least = np.empty(0)

    def __len__(self) -> int:
        """Number of demands on rows."""
        return len(self._least)

    def solution(self) -> Solution | None:
        """The cheapest solution, with knapsack cover inequalities added; None if the solver fails."""
        solution, cuts = tightened(self._programme, self._cover, whole=True)
        self._take(cuts.fractions, np.ones(len(cuts)))
        return solution

    def demand(self, adds: FloatArray, least: float) -> None:
        """Demand that what rows add (rows,) is so much at least; it may be left unmet."""
        row = csr_array(adds[None, :])
        unmet = csr_array(hstack([row, csr_array((1, self._groups)), np.ones((1, 1))]))
        self._programme.add(unmet, np.array([least]))
        self._take(row, np.array([least]))

    def forget(self, kept: int) -> None:
        """Take all demands on rows away but the first `kept`."""
        self._programme.forget(len(self) - kept)
        self._demands, self._least = self._demands[:kept], self._least[:kept]

    def _take(self, demands: csr_array, least: FloatArray) -> None:
        self._demands = csr_array(vstack([self._demands, demands], format="csr"))
        self._least = np.concatenate([self._least, least])

    def proved(self, solution: Solution) -> float:
        """The bound at a solution's prices; where one view suffices, they are scaled to be feasible."""
        cover, groups = self._cover, self._groups
        of_groups, of_demands, price = np.split(solution.prices, [groups, groups + len(cover.needed)])
        column_price, demand_price = self._fraction @ of_groups, of_demands / self._scale
        paid_to = cover.sees @ column_price + self._demands.T @ price
        if cover.once:
            heaviest = max(1.0, float(paid_to.max(initial=0.0)))
            column_price, price, paid_to = column_price / heaviest, price / heaviest, np.zeros(0)
        beyond = np.maximum(0.0, cover.worth.T @ demand_price - cover.asks * column_price).sum()
        beyond += np.maximum(0.0, paid_to - 1.0).sum()
        return float(cover.needed @ demand_price + self._least @ price - beyond)


def grouped(cover: Cover, fraction: csr_array) -> Cover:
    """The problem in which groups of columns are one, with views of a part of each."""
    of_group = csr_array((np.ones(cover.columns), fraction.indices, fraction.indptr), shape=fraction.shape)
    asks = np.zeros(fraction.shape[1], dtype=np.int64)
    asks[fraction.indices] = cover.asks
    return Cover(csr_array(cover.sees @ fraction), csr_array(cover.worth @ of_group), cover.needed, asks)


def group_fractions(cover: Cover, size: int) -> csr_array:
    """Fraction of its group that each column is by weight (columns, groups).

    Groups are up to `size` consecutive columns that add to the same demands and need as many views.
    """
    demands = np.split(cover.adds_to.indices, cover.adds_to.indptr[1:-1])
    alike = [(*of.tolist(), -views) for of, views in zip(demands, cover.asks.tolist(), strict=True)]
    group = np.zeros(cover.columns, dtype=np.int64)
    members = 1
    for k in range(1, cover.columns):
        members = members + 1 if alike[k] == alike[k - 1] and members < size else 1
        group[k] = group[k - 1] + (members == 1)
    weight = np.maximum(cover.weight, 1).astype(float)
    fraction = weight / np.bincount(group, weight)[group]
    return csr_array((fraction, group, np.arange(cover.columns + 1)))


def programme_of(cover: Cover, unmet_cost: float) -> tuple[LinearProgramme, float]:
    """The programme, of rows, columns, and what is left unmet; and the divisor of the problem's demands."""
    rows, columns = cover.rows, cover.columns
    seen = hstack([cover.sees.T, diags_array(-cover.asks.astype(float))])
    worth, needed, scale = scaled(cover)
    demand = hstack([csr_array((len(needed), rows)), worth])
    matrix = vstack([seen, demand])
    programme = LinearProgramme(
        np.concatenate([np.ones(rows), np.zeros(columns), [unmet_cost]]),
        hstack([matrix, csr_array((matrix.shape[0], 1))]),
        np.concatenate([np.zeros(columns), needed]),
        np.concatenate([np.full(rows, np.inf if cover.once else 1.0), np.ones(columns), [np.inf]]),
    )
    return programme, scale


def scaled(cover: Cover) -> tuple[csr_array, FloatArray, float]:
    """Worth and needs scaled to about one per column for the solver; and the divisor."""
    scale = max(1.0, float(cover.weight.mean())) if cover.columns else 1.0
    return (cover.worth / scale).tocsr(), cover.needed / scale, scale
