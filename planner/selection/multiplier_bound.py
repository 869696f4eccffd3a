"""Multiplier bound of a selection: prices of columns and demands, raised and lowered step by step."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import FloatArray
from stopgo.planner.selection.cover import Cover

STEPS = 1000
"""Most steps of the multiplier bound; a count, so that no bound depends on speed."""
WORK = 200_000_000
"""Entries evaluated in all those steps together, so that large floors get fewer steps."""
PATIENCE = 20
"""Steps without a better bound after which steps are halved, besides their shrinking to nothing."""
LEVEL = 1.1
"""The best bound so far times this is aimed at, where the best known selection is higher."""
FIRST_STEP = 2.0
"""First step as a multiple of Polyak's for the value aimed at."""
LEAST_NORM = 1e-12
"""Square of a slope below which it is rounding, and a step along it would be of any length."""
ROUNDING = 1e-12
"""Rounding error of a bound, as a fraction of all amounts that it sums up."""
SMOOTHING = 0.2
"""Weight of the newest slope in the direction of a step.

With a weight of 0.7 and steps that are only halved, the bound of 29 000 m² was 9 % lower.
"""


def multiplier_bound(cover: Cover, *, found: int, steps: int = STEPS, work: int = WORK) -> int:
    """Lagrangian bound: prices u_j on v_j y_j <= Σ x_i, raised where a column is used and not seen.

    For any prices u >= 0 of columns and p >= 0 of all demands but the whole, Σ_i min(0, 1 - Σ_j in i u_j)
    + Σ_k p_k needed_k + the cheapest way to meet the whole at v_j u_j - Σ_k p_k worth_kj per column is a
    bound (Geoffrion, 1974).
    """
    return rounded_up(multiplier_prices(PricedCover(cover), found=found, steps=steps, work=work)[0])


def rounded_up(bound: float) -> int:
    """The least whole number of rows that a bound leaves, its rounding errors allowed for."""
    return int(np.ceil(bound - 1e-6))


def multiplier_prices(
    problem: PricedCover, *, found: int, steps: int, work: int = WORK
) -> tuple[float, FloatArray]:
    """The best bound of so many steps, and its prices; `found` rows are known to suffice.

    Prices follow Polyak's subgradient rule, smoothed, by shrinking steps.
    """
    prices = best_prices = problem.first_prices
    best, step, waited, direction = 0.0, FIRST_STEP, 0, np.zeros(len(prices))
    steps = min(steps, max(50, work // max(1, problem.cover.sees.nnz)))
    for k in range(steps):
        value, slope = problem.value(prices)
        waited = 0 if value > best + 1e-4 else waited + 1
        if value > best:
            best, best_prices = value, prices
        direction = slope if not direction.any() else SMOOTHING * slope + (1 - SMOOTHING) * direction
        norm = float((direction * direction).sum())  # no BLAS: its threads wait for each other for longer
        if best > found - 1 + 1e-6 or norm < LEAST_NORM:
            break
        if waited >= PATIENCE:
            step, waited = step / 2, 0
        aim = min(found - 0.5, max(LEVEL * best, best + 1.5))
        prices = np.maximum(0.0, prices + step * (1 - k / steps) * (aim - value) / norm * direction)
    return best, best_prices


class PricedCover:
    """A covering problem with weights as fractions of the largest view; gives the bound at prices.

    Prices are those of columns, then those of all demands but the whole (columns + demands - 1,).
    """

    def __init__(self, cover: Cover) -> None:
        self.cover = cover
        scale = float(cover.paid_to(cover.weight.astype(float)).max(initial=1.0))
        self.weight = cover.weight / scale
        self.needed = cover.needed / scale
        self.worth = csr_array(cover.worth.astype(float) / scale)
        """What columns add to demands (demands, columns)."""
        self._rest = self.worth[1:]
        self._rest_of_column = self._rest.T

    @property
    def first_prices(self) -> FloatArray:
        return np.concatenate([self.weight, np.zeros(len(self.needed) - 1)])

    def value(self, prices: FloatArray, paid_besides: FloatArray | float = 0.0) -> tuple[float, FloatArray]:
        """The lower bound at these prices, and its subgradient; rows are paid something besides (rows,)."""
        cover = self.cover
        column, demand = prices[: cover.columns], prices[cover.columns :]
        paid_to = cover.paid_to(column) + paid_besides
        paid, gained = cover.asks * column, self._rest_of_column @ demand
        spare, cost = 1.0 - paid_to, paid - gained
        bought = self._cheapest(cost)
        whole = float(np.minimum(spare, 0.0).sum() + demand @ self.needed[1:])
        amounts = paid_to.sum() + paid.sum() + gained.sum() + demand @ self.needed[1:]
        value = whole + float((cost * bought).sum()) - ROUNDING * float(amounts)
        seen = cover.covered_by(np.flatnonzero(spare < 0))
        return value, np.concatenate([cover.asks * bought - seen, self.needed[1:] - self._rest @ bought])

    def bought(self, column: FloatArray, demand: FloatArray) -> tuple[float, FloatArray]:
        """Least cost of columns that meet the demands at these prices, as if rows cost nothing; its slope.

        The slope is by the prices of the columns, then of the demands.
        """
        cost = self.cover.asks * column - self._rest_of_column @ demand
        bought = self._cheapest(cost)
        value = float(demand @ self.needed[1:]) + float((cost * bought).sum())
        return value, np.concatenate([self.cover.asks * bought, self.needed[1:] - self._rest @ bought])

    def price_of_whole(self, prices: FloatArray) -> float:
        """Highest cost, per weight, of what is bought to meet the whole's demand at these prices."""
        columns = self.cover.columns
        cost = self.cover.asks * prices[:columns] - self._rest_of_column @ prices[columns:]
        bought = (self._cheapest(cost) > 0) & (self.weight > 0)
        return float((cost[bought] / self.weight[bought]).max(initial=0.0))

    def _cheapest(self, cost: FloatArray) -> FloatArray:
        """Fractions of columns that meet the whole's demand at least cost; negative costs are taken."""
        worth = np.where(self.weight > 0, self.weight, 1.0)
        order = np.argsort(cost / worth, kind="stable")
        before = np.cumsum(self.weight[order]) - self.weight[order]
        bought = np.empty(len(cost))
        bought[order] = np.clip((self.needed[0] - before) / worth[order], 0.0, 1.0)
        return np.where(cost < 0, 1.0, np.where(self.weight > 0, bought, 0.0))
