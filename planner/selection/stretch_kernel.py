"""Runs of stretches of boundary that rows see -> the columns that they see.

Plain functions over arrays: the same source runs interpreted and compiled, with the types of
`stretch_kernel_compiled.pxd`. All numbers are places in arrays, which fit 64 bits.

Data
----
- `run_first`, `begin`, `end`: row i sees the stretches from `begin[k]` to before `end[k]` for each run k from
  `run_first[i]` to before `run_first[i + 1]`.
- `before`: number of columns before each stretch, and of all.
"""

from __future__ import annotations

from typing import Any


def count_columns(run_first: Any, begin: Any, end: Any, before: Any, pointer: Any) -> None:
    """Note the first entry of each row, and the end of the last one (rows + 1,)."""
    total = 0
    for row in range(len(run_first) - 1):
        for k in range(run_first[row], run_first[row + 1]):
            total += before[end[k]] - before[begin[k]]
        pointer[row + 1] = total


def note_columns(begin: Any, end: Any, before: Any, seen: Any) -> None:
    """Note the columns that rows see, row by row (entries,)."""
    to = 0
    for k in range(len(begin)):
        for column in range(before[begin[k]], before[end[k]]):
            seen[to] = column
            to += 1
