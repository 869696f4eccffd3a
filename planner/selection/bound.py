"""A proven lower bound on the number of stops: from the linear relaxation, checked by its own duals."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array, eye_array, hstack, vstack

from mission.geometry import FloatArray
from planner.selection.cover import Cover

LARGEST = 400_000
"""Entries of the covering matrix above which only the counting bound is taken."""


def counting_bound(cover: Cover) -> int:
    """Fewest rows whose views could reach the needed units if none overlapped."""
    gains = np.sort(cover.gains(np.zeros(len(cover.weight), dtype=np.int64)))[::-1]
    return int(np.searchsorted(np.cumsum(gains), cover.needed)) + 1 if cover.needed > 0 else 0


def relaxation_bound(cover: Cover) -> int:
    """Rounded-up optimum of: min Σ x_i, y_j <= Σ x_i that see j, y_j <= 1, Σ w_j y_j >= needed.

    The number does not rest on the solver's tolerances: any prices u_j >= 0 with Σ u_j <= 1 over the
    columns of each row and any p >= 0 give the bound needed · p - Σ_j max(0, w_j p - u_j) by weak
    duality; the solver's prices are made feasible and the bound is computed from them.
    """
    simple = counting_bound(cover)
    if cover.needed == 0 or cover.sees.nnz > LARGEST:
        return simple
    prices = _relaxation_prices(cover)
    return simple if prices is None else max(simple, int(np.ceil(_dual_value(cover, *prices) - 1e-6)))


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
