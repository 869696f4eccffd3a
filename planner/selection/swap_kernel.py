"""Drop-and-repair's swaps: the best swap of a selection, again and again, until every demand is met.

The functions are plain functions over arrays of whole numbers. So the same source runs interpreted and
compiled, with the same result; `repair` is compiled as one loop and therefore stays whole.

Data, for the rows, columns and demands of one covering problem
---------------------------------------------------------------
- `row_first`, `seen`: row i sees the columns `seen[row_first[i]]` to `seen[row_first[i + 1] - 1]`.
- `run_first`, `run`: runs of rows that see a column, in the same way. Run k is of the rows from `run[2 k]` to
  before `run[2 k + 1]`.
- `adds_first`, `demand`, `worth`: the demands that a column adds to, and what it adds.
- `asks`: views that each column needs. `left`: those that it still needs, below 1 where it counts.
- `asked`: worth that each demand still needs, below 1 where it is met. `weight`: its penalty per unit.
- `gain`: what a row adds to a demand, at `demand * rows + row`.
- `chosen`: the rows of the selection, each in a place. `free`: 1 for each row that may be added, else 0.
- `tabu`: a ring of the rows removed last, which may not return.
- `place_of`: the place of each chosen row, -1 for all others.
- `counts`: of each place, the demands noted for its row, the first row that sees a column of it, and the one
  after the last; three numbers.
- `touched`, `lost`: these demands and their loss when the row leaves, `most` of each place.
- `noted`: where a demand is noted for a place, at `place * demands + demand`; -1 where it is not.
- `regained`: what a row's gain for such a demand changes when another row leaves, at
  `(place * most + demand) * rows + row`.
- `highest`: the most that any row adds to a demand, below 0 where it is not known.
- `common`: weighted shortfall with each row added and none removed.
- `found`: least shortfall, most coverage, and the place and the new row of that swap. Then the least
  `common`.
- `open_`: scratch, three numbers for each demand.

What a row sees of what another leaves is part of the loss, so no demand is shorter without the leaving. A
sum of shortfalls therefore ends as soon as it exceeds the least one. All numbers are sums of worth, times
penalties of no more than the number of swaps, below 2**62.
"""

from __future__ import annotations

from typing import Any

NEVER = 2**62
"""More than any shortfall."""
ABOVE = NEVER + 1
"""Shortfall of a row that may not be added."""


def repair(
    swaps: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, asks: Any, left: Any, asked: Any, weight: Any, gain: Any, chosen: Any,
    free: Any, tabu: Any, place_of: Any, counts: Any, touched: Any, lost: Any, noted: Any, regained: Any,
    highest: Any, common: Any, found: Any, open_: Any,
) -> int:  # fmt: skip
    """Swap rows until every demand is met; return 1 if fewer than so many swaps do, else 0."""
    held = 0
    for place in range(len(chosen)):
        enter(
            chosen[place], place, most, row_first, seen, run_first, run, adds_first, demand, worth, left,
            place_of, counts, touched, lost, noted, regained,
        )  # fmt: skip
    for swap in range(swaps):
        if add_up(asked, weight, gain, free, common, found, open_) == 0:
            return 1
        if len(chosen) + held == len(free):  # no other row is left to add
            for k in range(held):
                free[tabu[(swap - 1 - k) % len(tabu)]] = 1
            held = 0
        found[0] = NEVER
        for place in range(len(chosen)):
            try_swaps(
                place, most, asked, weight, gain, chosen, counts, touched, lost, regained, highest, common,
                found, open_,
            )  # fmt: skip
        for k in range(len(asked)):
            weight[k] += asked[k] > 0
        out = chosen[found[2]]
        exchange(
            found[2], found[3], most, row_first, seen, run_first, run, adds_first, demand, worth, asks,
            left, asked, gain, chosen, free, place_of, counts, touched, lost, noted, regained, highest,
        )  # fmt: skip
        if held == len(tabu):
            free[tabu[swap % len(tabu)]] = 1
        held = min(held + 1, len(tabu))
        tabu[swap % len(tabu)] = out
    return 0


def exchange(
    place: int, into: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any,
    adds_first: Any, demand: Any, worth: Any, asks: Any, left: Any, asked: Any, gain: Any, chosen: Any,
    free: Any, place_of: Any, counts: Any, touched: Any, lost: Any, noted: Any, regained: Any, highest: Any,
) -> None:  # fmt: skip
    """Put another row into a place."""
    place_of[chosen[place]] = -1
    see(
        chosen[place], 1, most, row_first, seen, run_first, run, adds_first, demand, worth, asks, left, asked,
        gain, place_of, counts, touched, lost, noted, regained, highest,
    )  # fmt: skip
    see(
        into, -1, most, row_first, seen, run_first, run, adds_first, demand, worth, asks, left, asked, gain,
        place_of, counts, touched, lost, noted, regained, highest,
    )  # fmt: skip
    chosen[place], free[into] = into, 0
    enter(
        into, place, most, row_first, seen, run_first, run, adds_first, demand, worth, left, place_of,
        counts, touched, lost, noted, regained,
    )  # fmt: skip


def add_up(asked: Any, weight: Any, gain: Any, free: Any, common: Any, found: Any, open_: Any) -> int:
    """Sum up the shortfall with each free row added; return the number of unmet demands."""
    rows, unmet = len(free), 0
    for k in range(len(asked)):
        if asked[k] > 0:
            open_[unmet] = k
            unmet += 1
    for row in range(rows if unmet > 0 else 0):
        common[row] = 0 if free[row] == 1 else ABOVE
    for k in range(unmet):
        demand = open_[k]
        first, short, penalty = demand * rows, asked[demand], weight[demand]
        for row in range(rows):
            common[row] += penalty * max(short - gain[first + row], 0)
    least = NEVER
    for row in range(rows if unmet > 0 else 0):
        least = min(least, common[row])
    found[4] = least
    return unmet


def enter(
    row: int, place: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any,
    adds_first: Any, demand: Any, worth: Any, left: Any, place_of: Any, counts: Any, touched: Any,
    lost: Any, noted: Any, regained: Any,
) -> None:  # fmt: skip
    """Compute what it costs that a row leaves again, which is in a place now, and what others then gain.

    They gain the columns that only it covers, and lose those that need two more views once it has left.
    """
    rows, first, notes = len(place_of), place * most, place * (len(noted) // (len(counts) // 3))
    for at in range(first, first + counts[3 * place]):
        noted[notes + touched[at]] = -1
        for to in range(at * rows + counts[3 * place + 1], at * rows + counts[3 * place + 2]):
            regained[to] = 0
    counts[3 * place], counts[3 * place + 1], counts[3 * place + 2], place_of[row] = 0, rows, 0, place
    for at in range(row_first[row], row_first[row + 1]):
        if left[seen[at]] == 0 or left[seen[at]] == 1:
            change(
                seen[at], place, most, 1 - left[seen[at]], 1 - 2 * left[seen[at]], run_first, run,
                adds_first, demand, worth, place_of, counts, touched, lost, noted, regained,
            )  # fmt: skip


def change(
    column: int, place: int, most: int, loss: int, more: int, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, place_of: Any, counts: Any, touched: Any, lost: Any, noted: Any,
    regained: Any,
) -> None:  # fmt: skip
    """Change by a column what the leaving of the row in a place costs, and what others then gain."""
    rows, first, notes = len(place_of), place * most, place * (len(noted) // (len(counts) // 3))
    low, high = run_first[column], run_first[column + 1]
    if low < high:
        counts[3 * place + 1] = min(counts[3 * place + 1], run[2 * low])
        counts[3 * place + 2] = max(counts[3 * place + 2], run[2 * high - 1])
    for entry in range(adds_first[column], adds_first[column + 1]):
        at = noted[notes + demand[entry]]
        if at < 0:
            at = first + counts[3 * place]
            counts[3 * place] += 1
            noted[notes + demand[entry]], touched[at], lost[at] = at, demand[entry], 0
        lost[at] += loss * worth[entry]
        value = more * worth[entry]
        for k in range(low, high):
            for to in range(at * rows + run[2 * k], at * rows + run[2 * k + 1]):
                regained[to] += value


def try_swaps(
    place: int, most: int, asked: Any, weight: Any, gain: Any, chosen: Any, counts: Any, touched: Any,
    lost: Any, regained: Any, highest: Any, common: Any, found: Any, open_: Any,
) -> None:  # fmt: skip
    """Compare the swaps of the row in a place for each free row with the best one found.

    The least shortfall is the best; of equal ones the most coverage, then the lowest rows. Rows that see
    nothing of what the row leaves are passed over where even one that adds most would be worse.
    """
    rows, first, whole_at, opened, apart = len(common), place * most, -1, 0, found[4]
    for k in range(first, first + counts[3 * place]):
        short = asked[touched[k]]
        if touched[k] == 0:
            whole_at = k
        if short + lost[k] > 0:
            open_[3 * opened], open_[3 * opened + 1], open_[3 * opened + 2] = touched[k], k * rows, lost[k]
            opened += 1
            if highest[touched[k]] < 0:
                highest[touched[k]] = most_of(gain, touched[k] * rows, rows)
            short -= highest[touched[k]]
            apart += weight[touched[k]] * (max(short + lost[k], 0) - max(short, 0))
    begin = counts[3 * place + 1] if apart > found[0] else 0
    end = counts[3 * place + 2] if apart > found[0] else rows
    for row in range(begin, end):
        if common[row] > found[0]:
            continue
        total = shortfall(row, opened, common, found[0], asked, weight, gain, regained, open_)
        if total > found[0]:
            continue
        covered = gain[row]
        if whole_at >= 0:
            covered += regained[whole_at * rows + row] - lost[whole_at]
        if total < found[0] or is_better(place, covered, chosen, found):
            found[0], found[1], found[2], found[3] = total, covered, place, row


def most_of(gain: Any, first: int, rows: int) -> int:
    """Return the most that any row adds to a demand, whose numbers begin at `first`."""
    most = 0
    for at in range(first, first + rows):
        most = max(most, gain[at])
    return most


def shortfall(
    row: int, opened: int, common: Any, least: int, asked: Any, weight: Any, gain: Any, regained: Any,
    open_: Any,
) -> int:  # fmt: skip
    """Return the shortfall with a row added after a leaving; some sum above `least` if it is above."""
    rows, total = len(common), common[row]
    for k in range(opened):
        before = asked[open_[3 * k]] - gain[open_[3 * k] * rows + row]
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
    row: int, more: int, most: int, row_first: Any, seen: Any, run_first: Any, run: Any, adds_first: Any,
    demand: Any, worth: Any, asks: Any, left: Any, asked: Any, gain: Any, place_of: Any, counts: Any,
    touched: Any, lost: Any, noted: Any, regained: Any, highest: Any,
) -> None:  # fmt: skip
    """Let the columns of a row need one view more (1, as it leaves) or less (-1, as it comes).

    What that changes for the leaving of others is changed for those in a place.
    """
    rows = len(place_of)
    for at in range(row_first[row], row_first[row + 1]):
        column = seen[at]
        short = max(left[column], left[column] + more)
        left[column] += more
        if short < 0 or short > 2:
            continue
        k, others = run_first[column], asks[column] - left[column] - (more < 0)
        while others > 0:
            for seer in range(run[2 * k], run[2 * k + 1]):
                if place_of[seer] >= 0:
                    others -= 1
                    change(
                        column, place_of[seer], most, more * (short == 0) - more * (short == 1),
                        -2 * more if short == 1 else more, run_first, run, adds_first, demand, worth,
                        place_of, counts, touched, lost, noted, regained,
                    )  # fmt: skip
            k += 1
        for entry in range(adds_first[column], adds_first[column + 1] if short > 0 else 0):
            asked[demand[entry]] += more * worth[entry] if short == 1 else 0
            highest[demand[entry]] = -1
            value = more * worth[entry] if short == 1 else -more * worth[entry]
            for k in range(run_first[column], run_first[column + 1]):
                for to in range(demand[entry] * rows + run[2 * k], demand[entry] * rows + run[2 * k + 1]):
                    gain[to] += value
