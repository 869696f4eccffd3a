"""Greedy choice of rows by their gains, each computed again only when its row has the largest known one.

The functions are plain functions over arrays of whole numbers. So the same source runs interpreted and
compiled, with the same result; `choose` is compiled as one loop and therefore stays whole.

Data, for the rows, columns and demands of one covering problem
---------------------------------------------------------------
- `row_first`, `seen`: row i sees the columns `seen[row_first[i]]` to `seen[row_first[i + 1] - 1]`.
- `adds_first`, `demand`, `worth`: the demands that a column adds to, and what it adds.
- `left`: views that each column still needs; 0 or less if none.
- `wanted`: views that each demand still needs, by weight. `needed`: its weight still missing, below 1 if met.
- `keys`: gain of each row in three ways as it was computed last, negative, so that the least is the best.
- `heap`: rows, the least by key and then by number first; row k is not after rows 2 k + 1 and 2 k + 2.
- `sums`: zeros (demands,), and zeros again afterwards. `touched`: scratch, the demands that are not 0 there.

Gains are weights of units, and their sum over a floor is below 2**62.
"""

from __future__ import annotations

from typing import Any


def choose(
    until_met: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, left: Any,
    wanted: Any, needed: Any, keys: Any, heap: Any, sums: Any, touched: Any, chosen: Any,
) -> int:  # fmt: skip
    """Choose rows until every demand is met or no row adds anything, else all; return their number."""
    size, count, unmet = len(heap), 0, 0
    for at in range(size // 2 - 1, -1, -1):
        sink(at, size, keys, heap)
    while size > 0:
        unmet = next_unmet(unmet, needed)
        if until_met == 1 and unmet == len(needed):
            break
        row = heap[0]
        evaluate(
            row, row_first, seen, adds_first, demand, worth, left, wanted, needed, keys, sums, touched
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
        take(row, row_first, seen, adds_first, demand, worth, left, wanted, needed, sums, touched)
    return count


def next_unmet(begin: int, needed: Any) -> int:
    """The first unmet demand from one on, else the number of demands; a demand that is met stays so."""
    while begin < len(needed) and needed[begin] <= 0:
        begin += 1
    return begin


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
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, left: Any, wanted: Any,
    needed: Any, keys: Any, sums: Any, touched: Any,
) -> None:  # fmt: skip
    """Compute the gain of a row: what is wanted, then, if nothing is, of unmet demands; last of the whole."""
    many = add(row, row_first, seen, adds_first, demand, worth, left, sums, touched)
    first, second, whole_gain = 0, 0, sums[0]
    for k in range(many):
        total = sums[touched[k]]
        first += min(total, wanted[touched[k]])
        if needed[touched[k]] > 0:
            second += total
        sums[touched[k]] = 0
    keys[3 * row], keys[3 * row + 1] = -first, -second if first == 0 else 0
    keys[3 * row + 2] = -whole_gain


def add(
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, left: Any, sums: Any,
    touched: Any,
) -> int:  # fmt: skip
    """Add the worth of a row's columns that still need views to each demand; return how many are touched."""
    many = 0
    for at in range(row_first[row], row_first[row + 1]):
        if left[seen[at]] > 0:
            for entry in range(adds_first[seen[at]], adds_first[seen[at] + 1]):
                if sums[demand[entry]] == 0 and worth[entry] != 0:
                    touched[many] = demand[entry]
                    many += 1
                sums[demand[entry]] += worth[entry]
    return many


def take(
    row: int, row_first: Any, seen: Any, adds_first: Any, demand: Any, worth: Any, left: Any, wanted: Any,
    needed: Any, sums: Any, touched: Any,
) -> None:  # fmt: skip
    """Count a row as chosen."""
    many = add(row, row_first, seen, adds_first, demand, worth, left, sums, touched)
    for k in range(many):
        wanted[touched[k]] -= min(wanted[touched[k]], sums[touched[k]])
        sums[touched[k]] = 0
    for at in range(row_first[row], row_first[row + 1]):
        column = seen[at]
        left[column] -= 1
        if left[column] == 0:
            for entry in range(adds_first[column], adds_first[column + 1]):
                needed[demand[entry]] -= worth[entry]
