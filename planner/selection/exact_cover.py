"""Exact selection: the covering problem as a mixed integer programme, solved by HiGHS, with its bound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array, hstack, vstack

from stopgo.mission.geometry import IntArray
from stopgo.mission.settings import Settings
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.cover_relaxation import scaled
from stopgo.planner.selection.separators import Conditions

WHOLE = 1e-6
"""The solver's bound may exceed the truth by its tolerance; it is lowered by this before rounding up."""


def exact(
    cover: Cover, start: IntArray, *, settings: Settings, conditions: Conditions | None = None
) -> tuple[IntArray, int]:
    """Fewest rows that meet every demand, and a lower bound on their number.

    min Σ x_i, v_j y_j <= Σ x_i that see j, Σ w_kj y_j >= needed_k; x whole, y in [0, 1], and whole too where
    v_j > 1, since a column counts for nothing until it has all views it needs. The search begins at the
    rows `start`, runs on one thread and ends at a node limit, so that it is reproducible. If it ends
    before the gap closes, the bound stays below the number of rows found.
    """
    import highspy

    solver = highspy.Highs()
    for option, value in _options(settings).items():
        solver.setOptionValue(option, value)
    solver.passModel(_model(cover, conditions or Conditions(cover.rows)))
    first = highspy.HighsSolution()
    first.col_value = _as_solution(cover, start)
    solver.setSolution(first)
    solver.run()
    dual = solver.getInfo().mip_dual_bound
    bound = math.ceil(dual - WHOLE) if math.isfinite(dual) else 0  # a time limit may end it before the first
    values = np.array(solver.getSolution().col_value[: cover.rows])
    rows = np.flatnonzero(values > 0.5) if len(values) == cover.rows else start
    met = not cover.missing(cover.covered_by(rows)).any()
    return (rows if met and len(rows) < len(start) else start), max(0, min(bound, len(start)))


def _options(settings: Settings) -> dict[str, Any]:
    options: dict[str, Any] = {
        "output_flag": False,
        "threads": 1,
        "random_seed": settings.seed,
        "mip_max_nodes": settings.node_limit,
        "mip_abs_gap": 1.0 - 1e-3,  # the objective is a whole number: a gap below 1 is closed
        "mip_rel_gap": 0.0,
    }
    if settings.time_limit is not None:
        options["time_limit"] = settings.time_limit
    return options


def _model(cover: Cover, conditions: Conditions) -> Any:
    """The programme in HiGHS's form: columns x then y; rows for coverage, demands, then conditions."""
    import highspy

    rows, columns = cover.rows, cover.columns
    worth, needed, _ = scaled(cover)
    demand = hstack([csr_array((len(needed), rows)), worth])
    asks = diags_array(-cover.asks.astype(float))
    further = hstack([conditions.matrix, csr_array((len(conditions.least), columns))])
    matrix = vstack([hstack([cover.sees.T, asks]), demand, further], format="csc")
    model = highspy.HighsLp()
    model.num_col_, model.num_row_ = rows + columns, matrix.shape[0]
    model.col_cost_ = np.concatenate([np.ones(rows), np.zeros(columns)])
    model.col_lower_, model.col_upper_ = np.zeros(rows + columns), np.ones(rows + columns)
    model.row_lower_ = np.concatenate([np.zeros(columns), needed, conditions.least])
    model.row_upper_ = np.full(matrix.shape[0], highspy.kHighsInf)
    model.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    model.a_matrix_.start_, model.a_matrix_.index_ = matrix.indptr, matrix.indices
    model.a_matrix_.value_ = matrix.data.astype(float)
    kinds = (highspy.HighsVarType.kContinuous, highspy.HighsVarType.kInteger)
    model.integrality_ = [kinds[1]] * rows + [kinds[int(views > 1)] for views in cover.asks]
    return model


def _as_solution(cover: Cover, chosen: IntArray) -> list[float]:
    x = np.zeros(cover.rows)
    x[chosen] = 1.0
    return [*x.tolist(), *(cover.covered_by(chosen) >= cover.asks).astype(float).tolist()]
