"""A linear programme solved by HiGHS, with the prices of its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from stopgo.mission.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Solution:
    """A cheapest solution, and what each row's demand adds to its cost."""

    values: FloatArray
    """(columns,)."""
    prices: FloatArray
    """Not negative (rows,). The solver's, so to be checked by whoever proves a bound from them."""


def minimised(cost: FloatArray, rows: Any, least: FloatArray, most: FloatArray) -> Solution | None:
    """Solve: least `cost` with `rows` @ x >= `least` and 0 <= x <= `most`; None if the solver fails.

    `rows` is a sparse matrix (rows, columns). The solver runs on one thread, so that it is reproducible.
    """
    import highspy

    matrix = csc_array(rows)
    model = highspy.HighsLp()
    model.num_row_, model.num_col_ = matrix.shape
    model.col_cost_, model.col_lower_, model.col_upper_ = cost, np.zeros(len(cost)), most
    model.row_lower_, model.row_upper_ = least, np.full(len(least), highspy.kHighsInf)
    model.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    model.a_matrix_.start_, model.a_matrix_.index_ = matrix.indptr, matrix.indices
    model.a_matrix_.value_ = matrix.data.astype(float)
    solver = highspy.Highs()
    for option, value in (("output_flag", False), ("threads", 1), ("random_seed", 0)):
        solver.setOptionValue(option, value)
    solver.passModel(model)
    solver.run()
    if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    found = solver.getSolution()
    return Solution(np.array(found.col_value), np.maximum(np.array(found.row_dual), 0.0))
