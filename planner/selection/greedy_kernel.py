"""Greedy choice of rows by their gains, each computed again only when its row has the largest known one.

The functions are plain functions over arrays of whole numbers. So the same source runs interpreted and
compiled, with the same result; `choose` is compiled as one loop and therefore stays whole.

Data, for the rows, columns and demands of one covering problem
---------------------------------------------------------------
- `row_first`, `seen`: row i sees the columns `seen[row_first[i]]` to `seen[row_first[i + 1] - 1]`.
- `adds_first`, `demand`, `worth`: the demands that a column adds to, and what it adds.
- `covered`, `asks`: views that each column has and needs.
- `wanted`: views that each demand still needs, by weight. `needed`: its weight still missing, below 1 if met.
- `keys`: gain of each row in three ways as it was computed last, negative, so that the least is the best.
- `heap`: rows, the least by key and then by number first; row k is not after rows 2 k + 1 and 2 k + 2.
- `sums`: zeros (demands,), and zeros again afterwards.

Gains are weights of units, and their sum over a floor is below 2**62.
"""

from __future__ import annotations

from typing import Any


def choose(
    until_met: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, asks: Any,
    covered: Any, wanted: Any, needed: Any, keys: Any, heap: Any, sums: Any, chosen: Any,
) -> int:  # fmt: skip
    """Choose rows until every demand is met or no row adds anything, else all; return their number."""
    size, count = len(heap), 0
    for at in range(size // 2 - 1, -1, -1):
        sink(at, size, keys, heap)
    while size > 0 and (until_met == 0 or any_unmet(needed)):
        row = heap[0]
        evaluate(
            row, row_first, seen, adds_first, demand, worth, asks, covered, wanted, needed, keys, sums
        )  # fmt: skip
        sink(0, size, keys, heap)
        if heap[0] != row:
            continue
        if until_met == 1 and keys[3 * row] == 0 and keys[3 * row + 1] == 0:
            break  # the rows offered do not see enough
        size -= 1
        heap[0] = heap[size]
        sink(0, size, keys, heap)
        chosen[count] = row
        count += 1
        take(row, row_first, seen, adds_first, demand, worth, asks, covered, wanted, needed, sums)
    return count


def any_unmet(needed: Any) -> int:
    """Return 1 if any demand is unmet, else 0."""
    for k in range(len(needed)):
        if needed[k] > 0:
            return 1
    return 0


def is_before(a: int, b: int, keys: Any) -> int:
    """Return 1 if row a is before row b, else 0."""
    for k in range(3):
        if keys[3 * a + k] != keys[3 * b + k]:
            return keys[3 * a + k] < keys[3 * b + k]
    return a < b


def sink(at: int, size: int, keys: Any, heap: Any) -> None:
    """Move the row at an index of the heap down to where it belongs."""
    row = heap[at]
    while 2 * at + 1 < size:
        child = 2 * at + 1
        if child + 1 < size and is_before(heap[child + 1], heap[child], keys):
            child += 1
        if not is_before(heap[child], row, keys):
            break
        heap[at] = heap[child]
        at = child
    heap[at] = row


def evaluate(
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, asks: Any, covered: Any,
    wanted: Any, needed: Any, keys: Any, sums: Any,
) -> None:  # fmt: skip
    """Compute the gain of a row: what is wanted, then, if nothing is, of unmet demands; last of the whole."""
    add(row, row_first, seen, adds_first, demand, worth, asks, covered, sums)
    first, second, whole_gain = 0, 0, sums[0]
    for at in range(row_first[row], row_first[row + 1]):
        for entry in range(adds_first[seen[at]], adds_first[seen[at] + 1]):
            total = sums[demand[entry]]
            if total != 0:
                first += min(total, wanted[demand[entry]])
                if needed[demand[entry]] > 0:
                    second += total
                sums[demand[entry]] = 0
    keys[3 * row], keys[3 * row + 1] = -first, -second if first == 0 else 0
    keys[3 * row + 2] = -whole_gain


def add(
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, asks: Any, covered: Any,
    sums: Any,
) -> None:  # fmt: skip
    """Add the worth of a row's columns that still need views to each demand."""
    for at in range(row_first[row], row_first[row + 1]):
        if covered[seen[at]] < asks[seen[at]]:
            for entry in range(adds_first[seen[at]], adds_first[seen[at] + 1]):
                sums[demand[entry]] += worth[entry]


def take(
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, asks: Any, covered: Any,
    wanted: Any, needed: Any, sums: Any,
) -> None:  # fmt: skip
    """Count a row as chosen."""
    add(row, row_first, seen, adds_first, demand, worth, asks, covered, sums)
    for at in range(row_first[row], row_first[row + 1]):
        column = seen[at]
        covered[column] += 1
        for entry in range(adds_first[column], adds_first[column + 1]):
            wanted[demand[entry]] -= min(wanted[demand[entry]], sums[demand[entry]])
            sums[demand[entry]] = 0
            if covered[column] == asks[column]:
                needed[demand[entry]] -= worth[entry]
