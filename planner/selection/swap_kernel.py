"""Drop-and-repair's swaps: the best swap of a selection, again and again, until every demand is met.

The functions are plain functions over arrays of whole numbers. So the same source runs interpreted and
compiled, with the same result; `repair` is compiled as one loop and therefore stays whole.

Data, for the rows, columns and demands of one covering problem
---------------------------------------------------------------
- `row_first`, `seen`: row i sees the columns `seen[row_first[i]]` to `seen[row_first[i + 1] - 1]`.
- `run_first`, `run`: runs of rows that see a column, in the same way. Run k is of the rows from `run[2 k]` to
  before `run[2 k + 1]`.
- `adds_first`, `demand`, `worth`: the demands that a column adds to, and what it adds.
- `left`: views that each column still needs, below 1 where it counts.
- `asked`: worth that each demand still needs, below 1 where it is met. `weight`: its penalty per unit.
- `gain`: what a row adds to a demand, at `row * demands + demand`.
- `chosen`: the rows of the selection, each in a place. `free`: 1 for each row that may be added, else 0.
- `tabu`: a ring of the rows removed last, which may not return.
- `stale`: 1 for each row whose leaving has other effects than when they were last computed, else 0.
- `counts`: of each place, the demands that change when its row leaves, the first row that sees a column of
  it, and the one after the last; three numbers.
- `touched`, `lost`: these demands and their loss, `most` of each place.
- `regained`: what it adds to a row's gain for such a demand, at `(place * most + demand) * rows + row`.
- `common`: weighted shortfall with each row added and none removed.
- `found`: least shortfall, most coverage, and the place and the new row of that swap.
- Scratch: `where`, -1 for each demand; `open_`, three numbers for each demand.

What a row sees of what another leaves is part of the loss, so no demand is shorter without the leaving. A
sum of shortfalls therefore ends as soon as it exceeds the least one. All numbers are sums of worth, times
penalties of no more than the number of swaps, below 2**62.
"""

from __future__ import annotations

from typing import Any

NEVER = 2**62
"""More than any shortfall."""


def repair(
    swaps: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, left: Any, asked: Any, weight: Any, gain: Any, chosen: Any, free: Any,
    tabu: Any, stale: Any, counts: Any, touched: Any, lost: Any, regained: Any, common: Any,
    found: Any, where: Any, open_: Any,
) -> int:  # fmt: skip
    """Swap rows until every demand is met; return 1 if fewer than so many swaps do, else 0."""
    held = 0
    for swap in range(swaps):
        if add_up(asked, weight, gain, common, open_) == 0:
            return 1
        if len(chosen) + held == len(free):  # no other row is left to add
            for k in range(held):
                free[tabu[(swap - 1 - k) % len(tabu)]] = 1
            held = 0
        found[0] = NEVER
        for place in range(len(chosen)):
            if stale[chosen[place]] == 1:
                leave(
                    place, most, row_first, seen, run_first, run, adds_first, demand, worth, left, chosen,
                    stale, counts, touched, lost, regained, where,
                )  # fmt: skip
            try_swaps(
                place, most, asked, weight, gain, chosen, free, counts, touched, lost, regained, common,
                found, open_,
            )  # fmt: skip
        for k in range(len(asked)):
            weight[k] += asked[k] > 0
        out, into = chosen[found[2]], found[3]
        see(out, 1, row_first, seen, run_first, run, adds_first, demand, worth, left, asked, gain, stale)
        see(into, -1, row_first, seen, run_first, run, adds_first, demand, worth, left, asked, gain, stale)
        chosen[found[2]], free[into], stale[into] = into, 0, 1
        if held == len(tabu):
            free[tabu[swap % len(tabu)]] = 1
        held = min(held + 1, len(tabu))
        tabu[swap % len(tabu)] = out
    return 0


def add_up(asked: Any, weight: Any, gain: Any, common: Any, open_: Any) -> int:
    """Sum up the shortfall with each row added; return the number of unmet demands."""
    demands, unmet = len(asked), 0
    for k in range(demands):
        if asked[k] > 0:
            open_[unmet] = k
            unmet += 1
    for row in range(len(common) if unmet > 0 else 0):
        total = 0
        for k in range(unmet):
            short = asked[open_[k]] - gain[row * demands + open_[k]]
            if short > 0:
                total += weight[open_[k]] * short
        common[row] = total
    return unmet


def leave(
    place: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, left: Any, chosen: Any, stale: Any, counts: Any, touched: Any, lost: Any,
    regained: Any, where: Any,
) -> None:  # fmt: skip
    """Compute the effects of the row in a place leaving: losses, and what other rows then gain.

    They gain the columns that only it covers, and lose those that need two more views once it has left.
    """
    row, rows, first = chosen[place], len(stale), place * most
    for at in range(first, first + counts[3 * place]):
        for to in range(at * rows + counts[3 * place + 1], at * rows + counts[3 * place + 2]):
            regained[to] = 0
    demands, counts[3 * place + 1], counts[3 * place + 2] = 0, rows, 0
    for at in range(row_first[row], row_first[row + 1]):
        if left[seen[at]] == 0 or left[seen[at]] == 1:
            demands = lose(
                seen[at], first, demands, adds_first, demand, worth, left, touched, lost, where
            )  # fmt: skip
            regain(
                seen[at], place, first, rows, run_first, run, adds_first, demand, worth, left, counts,
                regained, where,
            )  # fmt: skip
    counts[3 * place], stale[row] = demands, 0
    for k in range(demands):
        where[touched[first + k]] = -1


def lose(
    column: int, first: int, demands: int, adds_first: Any, demand: Any, worth: Any, left: Any, touched: Any,
    lost: Any, where: Any,
) -> int:  # fmt: skip
    """Note the demands of a column, and their loss; return the number of demands noted by then."""
    for entry in range(adds_first[column], adds_first[column + 1]):
        if where[demand[entry]] < 0:
            where[demand[entry]] = demands
            touched[first + demands], lost[first + demands] = demand[entry], 0
            demands += 1
        if left[column] == 0:
            lost[first + where[demand[entry]]] += worth[entry]
    return demands


def regain(
    column: int, place: int, first: int, rows: int, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, left: Any, counts: Any, regained: Any, where: Any,
) -> None:  # fmt: skip
    """Note between which rows those are that see a column, and what their gain changes."""
    low, high = run_first[column], run_first[column + 1]
    if low < high:
        counts[3 * place + 1] = min(counts[3 * place + 1], run[2 * low])
        counts[3 * place + 2] = max(counts[3 * place + 2], run[2 * high - 1])
    for entry in range(adds_first[column], adds_first[column + 1]):
        begin = (first + where[demand[entry]]) * rows
        value = worth[entry] if left[column] == 0 else -worth[entry]
        for k in range(low, high):
            for to in range(begin + run[2 * k], begin + run[2 * k + 1]):
                regained[to] += value


def try_swaps(
    place: int, most: int, asked: Any, weight: Any, gain: Any, chosen: Any, free: Any, counts: Any,
    touched: Any, lost: Any, regained: Any, common: Any, found: Any, open_: Any,
) -> None:  # fmt: skip
    """Compare the swaps of the row in a place for each free row with the best one found.

    The least shortfall is the best; of equal ones the most coverage, then the lowest rows.
    """
    demands, rows, first, whole_at, opened = len(asked), len(free), place * most, -1, 0
    for k in range(first, first + counts[3 * place]):
        if touched[k] == 0:
            whole_at = k
        if asked[touched[k]] + lost[k] > 0:
            open_[3 * opened], open_[3 * opened + 1], open_[3 * opened + 2] = touched[k], k * rows, lost[k]
            opened += 1
    for row in range(rows):
        if free[row] == 0 or common[row] > found[0]:
            continue
        total = shortfall(row, opened, common[row], found[0], asked, weight, gain, regained, open_)
        if total > found[0]:
            continue
        covered = gain[row * demands]
        if whole_at >= 0:
            covered += regained[whole_at * rows + row] - lost[whole_at]
        if total < found[0] or is_better(place, covered, chosen, found):
            found[0], found[1], found[2], found[3] = total, covered, place, row


def shortfall(
    row: int, opened: int, total: int, least: int, asked: Any, weight: Any, gain: Any, regained: Any,
    open_: Any,
) -> int:  # fmt: skip
    """Add to the shortfall `total` what demands are shorter by a leaving; some sum above `least` if it is."""
    demands = len(asked)
    for k in range(opened):
        before = asked[open_[3 * k]] - gain[row * demands + open_[3 * k]]
        after = before + open_[3 * k + 2] - regained[open_[3 * k + 1] + row]
        total += weight[open_[3 * k]] * (max(after, 0) - max(before, 0))
        if total > least:
            break
    return total


def is_better(place: int, covered: int, chosen: Any, found: Any) -> int:
    """Return 1 if a swap with the least shortfall is better than that found; rows ascend in each place."""
    if covered != found[1]:
        return covered > found[1]
    return chosen[place] < chosen[found[2]]


def see(
    row: int, more: int, row_first: Any, seen: Any, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, left: Any, asked: Any, gain: Any, stale: Any,
) -> None:  # fmt: skip
    """Let the columns of a row need one view more (1, as it leaves) or less (-1, as it comes)."""
    demands = len(asked)
    for at in range(row_first[row], row_first[row + 1]):
        column = seen[at]
        short = max(left[column], left[column] + more)
        left[column] += more
        if short < 0 or short > 2:
            continue
        if short == 1:
            for entry in range(adds_first[column], adds_first[column + 1]):
                asked[demand[entry]] += more * worth[entry]
        for k in range(run_first[column], run_first[column + 1]):
            for seer in range(run[2 * k], run[2 * k + 1]):
                stale[seer] = 1
            if short == 0:
                continue
            for entry in range(adds_first[column], adds_first[column + 1]):
                value = more * worth[entry] if short == 1 else -more * worth[entry]
                for seer in range(run[2 * k], run[2 * k + 1]):
                    gain[seer * demands + demand[entry]] += value
