"""A linear programme solved by HiGHS, with the prices of its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from stopgo.mission.geometry import FloatArray


@dataclass(frozen=True, eq=False)
class Solution:
    """A cheapest solution, and what each row's demand adds to its cost."""

    values: FloatArray
    """(columns,)."""
    prices: FloatArray
    """Not negative (rows,). The solver's, so to be checked by whoever proves a bound from them."""
    cost: float


class LinearProgramme:
    """The programme: least `cost` with `rows` @ x >= `least` and 0 <= x <= `most`; both can be added.

    `rows` is a sparse matrix (rows, columns). The solver runs on one thread, so that it is reproducible.
    Without `presolve` it does not simplify the programme first.
    """

    def __init__(
        self, cost: FloatArray, rows: Any, least: FloatArray, most: FloatArray, *, presolve: bool = True
    ) -> None:
        import highspy

        matrix = csc_array(rows)
        model = highspy.HighsLp()
        model.num_row_, model.num_col_ = matrix.shape
        model.col_cost_, model.col_lower_, model.col_upper_ = cost, np.zeros(len(cost)), most
        model.row_lower_, model.row_upper_ = least, np.full(len(least), highspy.kHighsInf)
        model.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        model.a_matrix_.start_, model.a_matrix_.index_ = matrix.indptr, matrix.indices
        model.a_matrix_.value_ = matrix.data.astype(float)
        self._solver = highspy.Highs()
        for option, value in (("output_flag", False), ("threads", 1), ("random_seed", 0)):
            self._solver.setOptionValue(option, value)
        if not presolve:
            self._solver.setOptionValue("presolve", "off")
        self._solver.passModel(model)

    def add(self, rows: csr_array, least: FloatArray) -> None:
        """Demand more: `rows` @ x >= `least` of the first columns; the next solution begins at the last."""
        import highspy

        first, to = rows.indptr[:-1].astype(np.int32), rows.indices.astype(np.int32)
        infinite = np.full(len(least), highspy.kHighsInf)
        self._solver.addRows(len(least), least, infinite, rows.nnz, first, to, rows.data.astype(float))

    def add_columns(self, columns: csr_array, cost: FloatArray, most: FloatArray) -> None:
        """Offer more: a column (rows,) of each row of `columns`; the next solution begins at the last."""
        first, to = columns.indptr[:-1].astype(np.int32), columns.indices.astype(np.int32)
        added = len(cost), cost, np.zeros(len(cost)), most, columns.nnz, first, to, columns.data.astype(float)
        self._solver.addCols(*added)

    def forget(self, many: int) -> None:
        """Take the last so many rows away."""
        rows = self._solver.getNumRow()
        self._solver.deleteRows(many, np.arange(rows - many, rows, dtype=np.int32))

    def solution(self) -> Solution | None:
        """Solve it; None if the solver fails."""
        import highspy

        self._solver.run()
        if self._solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            return None
        found, cost = self._solver.getSolution(), self._solver.getInfo().objective_function_value
        return Solution(np.array(found.col_value), np.maximum(np.array(found.row_dual), 0.0), cost)


def minimised(cost: FloatArray, rows: Any, least: FloatArray, most: FloatArray) -> Solution | None:
    """The solution of one programme; None if the solver fails."""
    return LinearProgramme(cost, rows, least, most).solution()
