"""Tabu search over stops and their order: exchanges, removals and additions, by the time of the route.

Demands may be violated during the search. A shortfall is a penalty in time, which grows while the demand
stays unmet (Gendreau, Hertz and Laporte, "A tabu search heuristic for the vehicle routing problem",
Management Science 1994). Each step makes the best change, even if it is worse. Then each stop of the best
line that met every demand is exchanged where that saves time, until no exchange does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.planner.covering_tour.timed_line import LineTimes, PointLine, without
from stopgo.planner.selection.board import Board
from stopgo.planner.selection.cover import Cover

STEPS = 400
"""Changes made at most; a count, so that no plan depends on speed."""
WORK = 6_000_000
"""Exchanges evaluated for all those changes together, so that large floors get fewer changes."""
SWEEPS = 10
"""Most rounds in which each stop in turn is exchanged for a better one."""
TENURE, LULL = 8, 10
"""Removed positions that may not return: 1, one more after each LULL changes up to TENURE, then again 1."""
SCALE = 1024
"""Penalties are in microseconds / SCALE per unit of missing weight."""
DEARER, CHEAPER = (9, 8), (15, 16)
"""Factors of a penalty at each step: for an unmet demand, and for all demands if all are met."""
RANGE = 256
"""Factor by which a penalty may rise above and fall below its first value."""
NEVER = 2**60


@dataclass(frozen=True, eq=False)
class LineTask:
    """Demands on a line, and the positions that must stay."""

    cover: Cover
    """The covering problem that remains after the required positions; its rows are the positions."""
    stays: BoolArray
    """True for required positions (positions,)."""
    rank: IntArray | None
    """The position of the lowest rank comes first on a line (positions,); None: any may."""
    joins: Callable[[IntArray], BoolArray]
    """Returns, for stops at some positions, True for each position where scans are connected with theirs."""


@dataclass(frozen=True)
class _Change:
    """An index of the line whose stop is removed, and a position that is added; None for neither."""

    at: int | None
    into: int | None


def shorter_line(times: LineTimes, task: LineTask, line: PointLine) -> PointLine:
    """A line between the same ends that meets every demand and takes no longer."""
    search = _TourSearch(times, task, line)
    for _ in range(min(STEPS, WORK // max(1, times.positions * len(line)))):
        if not search.step():
            break
    search = _TourSearch(times, task, search.best)
    for _ in range(SWEEPS):
        if not search.sweep():
            break
    return search.best


class _TourSearch:
    def __init__(self, times: LineTimes, task: LineTask, line: PointLine) -> None:
        self._times, self._task = times, task
        self._line = times.turned(line, self._first_free(line))
        self._board = Board(task.cover, [p for p in self._places(self._line) if not task.stays[p]])
        self.best, self._least = self._line, times.total(self._line)
        start = max(1, self._least * SCALE // max(1, int(task.cover.needed.max(initial=1))))
        most = NEVER // max(1, int(task.cover.needed.sum()))  # so that no sum of costs leaves 64 bits
        self._dearest, self._cheapest = min(start * RANGE, most), max(1, min(start // RANGE, most))
        self._board.weight = np.full(len(task.cover.needed), start, dtype=np.int64)
        self._left: list[int] = []
        self._ranked: tuple[PointLine, list[tuple[int, int]]] = ([], [])
        """A line, and the two lowest ranks on it with their indices."""
        self._made = 0

    def _first_free(self, line: PointLine) -> int:
        """The first index of a line whose point may move to a later index."""
        return 1 if self._task.rank is None else 2

    def _places(self, line: PointLine) -> list[int]:
        """The stops of a line."""
        return [point for point in line if point < self._times.positions]

    def step(self) -> bool:
        """Make the best change; return False if there is none."""
        change = self._best_change()
        if change is None:
            return False
        self._make(change)
        self._made += 1
        missing = self._board.missing
        self._price(missing)
        self._line = self._times.turned(self._line, self._first_free(self._line))
        if not missing.any():
            total = self._times.total(self._line)
            if total < self._least:
                self.best, self._least = self._line, total
        return True

    def sweep(self) -> bool:
        """Exchange or remove each stop where that saves time; return False if it never does.

        Every demand is met before and after.
        """
        before = self._least
        for position in self._places(self._line):
            change = self._saving(self._line.index(position))
            if change is not None:
                self._make(change)
        self._line = self._times.turned(self._line, self._first_free(self._line))
        self.best, self._least = self._line, self._times.total(self._line)
        return self._least < before

    def _saving(self, at: int) -> _Change | None:
        """The exchange or removal of a stop that saves most time and leaves every demand met."""
        times, position = self._times, self._line[at]
        if self._task.stays[position]:
            return None
        saved = times.removed(self._line, at)
        barred = np.zeros(times.positions, dtype=bool)
        barred[self._places(self._line)] = True
        value = self._allowed(self._least_near(at) - saved, barred, at)
        value[(self._missing_with(at) > 0) | (value >= 0)] = NEVER
        found: list[tuple[int | None, IntArray]] = [(at, value)]
        if not self._leads(at) and not self._missing_without(at):
            found.append((at, np.array([-saved])))
        return self._best_of(found)

    def _price(self, missing: IntArray) -> None:
        """Raise the penalties of unmet demands; lower all penalties if every demand is met."""
        (up, by), (down, of) = DEARER, CHEAPER
        weight = self._board.weight
        changed = (
            np.where(missing > 0, weight * up // by + 1, weight) if missing.any() else weight * down // of
        )
        self._board.weight = np.clip(changed, self._cheapest, self._dearest)

    def _make(self, change: _Change) -> None:
        task = self._task
        if change.at is not None:
            left = self._line[change.at]
            self._line = without(self._line, change.at)
            if not task.stays[left]:
                self._board.drop(left)
            if change.into != left:
                self._left.append(left)
        if change.into is not None:
            leg = self._leg_for(self._line, change.into)
            self._line = [*self._line[: leg + 1], change.into, *self._line[leg + 1 :]]
            if not task.stays[change.into]:
                self._board.take(change.into)

    def _leg_for(self, line: PointLine, position: int) -> int:
        """The leg in which this position adds least time."""
        rank = self._task.rank
        first = 0
        if rank is not None and any(p < self._times.positions for p in line):
            if rank[position] < min(rank[p] for p in line if p < self._times.positions):
                return 0
            first = 1
        added = [int(self._times.inserted(line, leg)[position]) for leg in range(first, len(line) - 1)]
        return first + int(np.argmin(added))

    def _best_change(self) -> _Change | None:
        """The allowed change with the least sum of time and penalties."""
        return self._best_of(list(self._changes()))

    def _best_of(self, found: list[tuple[int | None, IntArray]]) -> _Change | None:
        """The change with the least cost after which scans are connected as required."""
        least = [int(value.min(initial=NEVER)) for _, value in found]
        connected: set[int] = set()
        while found and (value := min(least)) < NEVER:
            which = least.index(value)
            at, values = found[which]
            if which in connected:
                return _Change(at, int(np.argmin(values)) if len(values) > 1 else None)
            connected.add(which)
            found[which] = at, self._connected(at, values)
            least[which] = int(found[which][1].min(initial=NEVER))
        return None

    def _connected(self, at: int | None, values: IntArray) -> IntArray:
        """The costs, NEVER for each change after which scans are not connected as required."""
        rest = self._line if at is None else without(self._line, at)
        stops = np.array(sorted(self._places(rest)), dtype=np.int64)
        joins = self._task.joins(stops)
        return np.where(joins if len(values) > 1 else joins[stops[:1]], values, NEVER)

    def _changes(self) -> Iterator[tuple[int | None, IntArray]]:
        """Costs of changes, for each removable stop and for none: of adding each position (positions,).

        Also the cost of removal alone (1,). All costs are relative to the line's own time.
        """
        times, line = self._times, self._line
        legs = np.array([times.inserted(line, leg) for leg in range(len(line) - 1)])
        legs[: self._first_free(line) - 1] = NEVER
        ahead = np.minimum.accumulate(legs, axis=0)
        behind = np.minimum.accumulate(legs[::-1], axis=0)[::-1]
        barred = self._barred()
        yield None, self._allowed(ahead[-1] + self._missing_with(None), barred, None)
        for at in range(1, len(line) - 1):
            position = line[at]
            if position >= times.positions:
                continue
            saved = times.removed(line, at)
            least = self._least_added(at, ahead, behind)
            value = least - saved + self._missing_with(at)
            here = int(least[position]) - saved
            value = self._allowed(value, barred, at)
            if self._task.stays[position]:
                value[:] = NEVER
            value[position] = here + self._missing_now() if here < 0 else NEVER
            yield at, value
            if not self._task.stays[position] and not self._leads(at):
                yield at, np.array([self._missing_without(at) - saved])

    def _leads(self, at: int) -> bool:
        """True if the stop at this index of the line comes first because of its rank."""
        return self._task.rank is not None and at == 1

    def _least_added(self, at: int, ahead: IntArray, behind: IntArray) -> IntArray:
        """Least time that each position adds after the stop at index `at` is removed (positions,)."""
        least = self._least_near(at)
        if self._leads(at):
            return least
        if at - 3 >= 0:
            least = np.minimum(least, ahead[at - 3])
        if at + 2 < len(behind):
            least = np.minimum(least, behind[at + 2])
        return least

    def _least_near(self, at: int) -> IntArray:
        """Least time that each position adds near the stop at index `at`, which is removed (positions,)."""
        times, rest = self._times, without(self._line, at)
        if self._leads(at):
            return times.inserted(rest, 0)
        first = self._first_free(self._line) - 1
        near = [leg for leg in (at - 2, at - 1, at) if first <= leg < len(rest) - 1]
        return np.minimum.reduce([times.inserted(rest, leg) for leg in near])

    def _barred(self) -> BoolArray:
        """True for positions that may not be added: those on the line, and those removed recently."""
        barred = np.zeros(self._times.positions, dtype=bool)
        barred[[p for p in self._line if p < self._times.positions]] = True
        spare = self._times.positions - len(self._places(self._line))
        tenure = 1 + self._made // LULL % max(1, min(TENURE, spare // 2))
        barred[self._left[-tenure:]] = True
        return barred

    def _allowed(self, value: IntArray, barred: BoolArray, at: int | None) -> IntArray:
        """The costs, NEVER for barred positions and those whose rank forbids or asks for the first place."""
        rank, lowest = self._task.rank, self._lowest_rank(at)
        if rank is None or lowest is None:
            return np.where(barred, NEVER, value)
        wrong = rank > lowest if at == 1 else rank < lowest
        return np.where(barred | wrong, NEVER, value)

    def _lowest_rank(self, at: int | None) -> int | None:
        """The lowest rank of the line's stops but the one at an index; None without others, or any rank."""
        rank, line = self._task.rank, self._line
        if rank is None:
            return None
        if self._ranked[0] is not line:
            stops = [(int(rank[p]), k) for k, p in enumerate(line) if p < self._times.positions]
            self._ranked = line, sorted(stops)[:2]
        return next((lowest for lowest, k in self._ranked[1] if k != at), None)

    def _missing_now(self) -> int:
        return int(self._board.weight @ self._board.missing) // SCALE

    def _missing_with(self, at: int | None) -> IntArray:
        """Penalty after each position is added, in exchange for the stop at index `at` if one is given."""
        if at is None:
            return self._board.after_takes() // SCALE
        if self._task.stays[self._line[at]]:
            return np.zeros(self._times.positions, dtype=np.int64)
        return self._board.after_swaps(self._line[at])[0] // SCALE

    def _missing_without(self, at: int) -> int:
        return int(self._board.after_drop(self._line[at])) // SCALE
