"""Sums of the worth of columns, for each demand, and for each demand and row; and what rows reach.

Plain functions over lists or arrays: the same source runs interpreted and compiled, with the types of
`worth_kernel_compiled.pxd`. Worths are weights of units, and their sum over a floor is below 2**62.
"""

from __future__ import annotations

from typing import Any


def add_worth(columns: Any, adds_first: Any, demand: Any, worth: Any, sums: Any) -> None:
    """Add the worth of columns to each demand.

    Parameters
    ----------
    columns
        Numbers of columns (n,).
    adds_first
        First entry of each column in `demand` and `worth`, and their end (columns + 1,).
    demand, worth
        Demand of each entry, and what the column adds to it (entries,).
    sums
        Receives the sums (demands,).
    """
    for k in range(len(columns)):
        column = columns[k]
        for entry in range(adds_first[column], adds_first[column + 1]):
            sums[demand[entry]] += worth[entry]


def add_worth_by_row(
    columns: Any, run_first: Any, run: Any, adds_first: Any, demand: Any, worth: Any, place: Any,
    rows: int, sums: Any,
) -> None:  # fmt: skip
    """Add the worth of columns to each demand, for each row that sees them.

    Parameters
    ----------
    columns, adds_first, demand, worth
        As for `add_worth`.
    run_first, run
        First run of each column, and their end (columns + 1,). Run k is of the rows from `run[2 k]` to before
        `run[2 k + 1]`, which see the column.
    place
        Place of each demand in the result, -1 where it is not asked for (demands,).
    rows
        Number of rows.
    sums
        Receives the sums, flat (asked demands * rows,).
    """
    for k in range(len(columns)):
        column = columns[k]
        for entry in range(adds_first[column], adds_first[column + 1]):
            if place[demand[entry]] < 0:
                continue
            begin, value = place[demand[entry]] * rows, worth[entry]
            for at in range(run_first[column], run_first[column + 1]):
                for to in range(begin + run[2 * at], begin + run[2 * at + 1]):
                    sums[to] += value


def add_worth_of_rows(
    low: int, high: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, demands: int,
    sums: Any,
) -> None:  # fmt: skip
    """Add the worth of the columns that each row from `low` to before `high` sees to each demand.

    The sums are flat, by row ((high - low) * demands,); the others are as for `count_views`.
    """
    for row in range(low, high):
        begin = (row - low) * demands
        for at in range(row_first[row], row_first[row + 1]):
            for entry in range(adds_first[seen[at]], adds_first[seen[at] + 1]):
                sums[begin + demand[entry]] += worth[entry]


def count_runs(row_first: Any, seen: Any, last: Any, many: Any) -> None:
    """Count the runs of successive rows that see each column, from -2 as the `last` row (columns,)."""
    for row in range(len(row_first) - 1):
        for at in range(row_first[row], row_first[row + 1]):
            if last[seen[at]] != row - 1:
                many[seen[at]] += 1
            last[seen[at]] = row


def note_runs(row_first: Any, seen: Any, last: Any, place: Any, run: Any) -> None:
    """Note these runs: of each its first row, and the one after its last (2 * runs,).

    `place` is that of the first run of each column, and receives that after its last one (columns,).
    """
    for row in range(len(row_first) - 1):
        for at in range(row_first[row], row_first[row + 1]):
            column = seen[at]
            if last[column] != row - 1:
                run[2 * place[column]] = row
                place[column] += 1
            run[2 * place[column] - 1] = row + 1
            last[column] = row


def count_views(
    rows: Any, step: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, asks: Any,
    covered: Any, reached: Any,
) -> None:  # fmt: skip
    """Count the views of rows that come (step 1) or leave (step -1), and what each demand then reaches.

    Parameters
    ----------
    rows, step
        Numbers of rows (n,), and 1 or -1.
    row_first, seen
        First entry of each row in `seen`, and their end (rows + 1,); columns that the row sees.
    adds_first, demand, worth
        As for `add_worth`.
    asks, covered, reached
        Views that each column needs and has (columns,), and the worth reached (demands,).
    """
    for k in range(len(rows)):
        for at in range(row_first[rows[k]], row_first[rows[k] + 1]):
            column = seen[at]
            if max(covered[column], covered[column] + step) == asks[column]:
                for entry in range(adds_first[column], adds_first[column + 1]):
                    reached[demand[entry]] += step * worth[entry]
            covered[column] += step


def take_gain(
    columns: Any, covered: Any, asks: Any, adds_first: Any, demand: Any, worth: Any, short: Any,
    missing: Any, sums: Any, gains: Any,
) -> None:  # fmt: skip
    """Sum up what columns add that still need views: of what is short, of unmet demands, of the whole.

    Parameters
    ----------
    columns, adds_first, demand, worth
        As for `add_worth`.
    covered, asks
        Views that each column has and needs (columns,).
    short, missing
        Views and weight that each demand still needs (demands,).
    sums
        Zeros (demands,), and zeros again afterwards.
    gains
        Receives the three sums (3,). A demand counts in the first for no more than it is short.
    """
    gains[0] = gains[1] = gains[2] = 0
    for k in range(len(columns)):
        column = columns[k]
        if covered[column] < asks[column]:
            for entry in range(adds_first[column], adds_first[column + 1]):
                sums[demand[entry]] += worth[entry]
    for k in range(len(columns)):
        column = columns[k]
        for entry in range(adds_first[column], adds_first[column + 1]):
            total = sums[demand[entry]]
            if total:
                gains[0] += min(total, short[demand[entry]])
                if missing[demand[entry]] > 0:
                    gains[1] += total
                if demand[entry] == 0:
                    gains[2] = total
                sums[demand[entry]] = 0


def sum_by_row(row_first: Any, seen: Any, value: Any, sums: Any) -> None:
    """Sum up the values of the columns that each row sees, in their order.

    Parameters
    ----------
    row_first, seen
        As for `count_views`.
    value, sums
        Floating-point numbers of the columns (columns,), and their sums (rows,).
    """
    for row in range(len(sums)):
        total = 0.0
        for at in range(row_first[row], row_first[row + 1]):
            total += value[seen[at]]
        sums[row] = total


def add_views(rows: Any, row_first: Any, seen: Any, views: Any) -> None:
    """Count how many of these rows see each column (columns,); the others are as for `count_views`."""
    for k in range(len(rows)):
        for at in range(row_first[rows[k]], row_first[rows[k] + 1]):
            views[seen[at]] += 1
