"""Proven lower bounds on the number of stops, each by weak duality from prices it has checked itself."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack, vstack

from mission.geometry import FloatArray
from planner.selection.cover import Cover

LARGEST = 150_000
"""Entries of the covering matrix above which the relaxation is not solved: it takes seconds then."""
STEPS = 1000
"""Most steps of the multiplier bound; a count, so that no bound depends on speed."""
WORK = 200_000_000
"""Entries looked at in all those steps together, so that large floors get fewer of them."""
PATIENCE = 20
"""Steps without a better bound after which steps are halved."""
FIRST_STEP = 1.5
SMOOTHING = 0.7
"""Weight of the newest slope in the direction of a step."""


def counting_bound(cover: Cover) -> int:
    """Fewest rows whose views could reach the needed units if none overlapped."""
    gains = np.sort(cover.gains(np.zeros(len(cover.weight), dtype=np.int64)))[::-1]
    return int(np.searchsorted(np.cumsum(gains), cover.needed)) + 1 if cover.needed > 0 else 0


def lower_bound(cover: Cover, *, found: int) -> int:
    """No selection has fewer rows than this; `found` rows are known to be enough.

    The relaxation is solved where that is quick, prices are searched for where it is not.
    """
    simple = counting_bound(cover)
    if simple >= found or cover.needed == 0:
        return simple
    better = relaxation_bound(cover) if cover.sees.nnz <= LARGEST else multiplier_bound(cover, found=found)
    return max(simple, better)


def multiplier_bound(cover: Cover, *, found: int) -> int:
    """Lagrangian bound: prices u_j on y_j <= Σ x_i, raised where a column is used and not seen.

    For any prices Σ_i min(0, 1 - Σ_j in i u_j) + the cheapest way to buy the needed units at u_j per
    column is a bound (Geoffrion, 1974); the prices follow Polyak's subgradient rule, smoothed.
    """
    weight = cover.weight.astype(float)
    prices = weight / max(1.0, float(cover.gains(np.zeros(len(weight), dtype=np.int64)).max(initial=1)))
    best, step, waited, direction = 0.0, FIRST_STEP, 0, np.zeros(len(weight))
    for _ in range(min(STEPS, max(50, WORK // max(1, cover.sees.nnz)))):
        value, slope = _multiplier_value(cover, weight, prices)
        waited = 0 if value > best + 1e-4 else waited + 1
        best = max(best, value)
        direction = slope if not direction.any() else SMOOTHING * slope + (1 - SMOOTHING) * direction
        norm = float(direction @ direction)
        if best > found - 1 + 1e-6 or norm == 0.0:
            break
        if waited >= PATIENCE:
            step, waited = step / 2, 0
        prices = np.maximum(0.0, prices + step * (found - 0.5 - value) / norm * direction)
    return int(np.ceil(best - 1e-6))


def _multiplier_value(cover: Cover, weight: FloatArray, prices: FloatArray) -> tuple[float, FloatArray]:
    """The bound at these prices, and the direction in which it rises."""
    spare = 1.0 - cover.sees @ prices
    taken = (spare < 0).astype(float)
    order = np.argsort(prices / weight, kind="stable")
    before = np.cumsum(weight[order]) - weight[order]
    bought = np.zeros(len(weight))
    bought[order] = np.clip((cover.needed - before) / weight[order], 0.0, 1.0)
    value = float(np.minimum(spare, 0.0).sum() + prices @ bought)
    return value, bought - cover.seen_by @ taken


def relaxation_bound(cover: Cover) -> int:
    """Rounded-up optimum of: min Σ x_i, y_j <= Σ x_i that see j, y_j <= 1, Σ w_j y_j >= needed.

    The number does not rest on the solver's tolerances: any prices u_j >= 0 with Σ u_j <= 1 over the
    columns of each row and any p >= 0 give the bound needed · p - Σ_j max(0, w_j p - u_j) by weak
    duality; the solver's prices are made feasible and the bound is computed from them.
    """
    prices = _relaxation_prices(cover) if cover.needed else None
    return 0 if prices is None else int(np.ceil(_dual_value(cover, *prices) - 1e-6))


def _relaxation_prices(cover: Cover) -> tuple[FloatArray, float] | None:
    """Dual prices of the columns (columns,) and of one needed unit, or None where the solver gives up."""
    rows, columns = cover.rows, len(cover.weight)
    seen = hstack([-cover.sees.T, eye_array(columns)], format="csr")
    demand = csr_array(np.concatenate([np.zeros(rows), -cover.weight.astype(float)])[None, :])
    solution = linprog(
        np.concatenate([np.ones(rows), np.zeros(columns)]),
        A_ub=vstack([seen, demand], format="csr"),
        b_ub=np.concatenate([np.zeros(columns), [-float(cover.needed)]]),
        bounds=[(0, None)] * rows + [(0, 1)] * columns,
        method="highs",
    )
    if solution.status != 0:
        return None
    duals = -np.asarray(solution.ineqlin.marginals)
    return np.maximum(duals[:-1], 0.0), max(float(duals[-1]), 0.0)


def _dual_value(cover: Cover, column_price: FloatArray, unit_price: float) -> float:
    heaviest = float((cover.sees @ column_price).max(initial=0.0))
    column_price = column_price / max(1.0, heaviest)
    return cover.needed * unit_price - float(np.maximum(0.0, cover.weight * unit_price - column_price).sum())
