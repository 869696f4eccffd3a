"""Stops and their order together: exchanges, drops and additions, by what the route then takes.

What is asked for may be missed on the way: what is missing costs time, the more the longer it stays missing
(Gendreau, Hertz and Laporte, "A tabu search heuristic for the vehicle routing problem", Management Science
1994). Of all changes the best one is made, be it for the worse; the best line that met everything is kept.
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
LOOKS = 40_000
"""Stops looked at for all those changes together, so that large floors get fewer of them."""
TENURE, LULL = 8, 10
"""Places left last that may not come back: 1, after so many changes 2, and up to 8, and anew."""
SCALE = 1024
"""Costs of what is missing are in microseconds by this, for each unit of weight."""
DEARER, CHEAPER = (9, 8), (15, 16)
"""How the cost of a demand changes with each step at which it is not met; and that of all where all are."""
RANGE = 256
"""By how much these costs may rise and fall from where they begin."""
TRIED = 30
"""Changes looked at, the best first, for one after which scans still register with one another."""
NEVER = 2**60


@dataclass(frozen=True, eq=False)
class LineTask:
    """What a line must see, and which of its places may change."""

    cover: Cover
    """What the places that stay leave to be seen; its rows are the places."""
    stays: BoolArray
    """Whether there must be a stop at each place (places,)."""
    rank: IntArray | None
    """Of the places of a line the one of the lowest rank comes first (places,); None: any may."""
    together: Callable[[IntArray], bool]
    """Whether the scans of stops at these places hang together as they must."""


@dataclass(frozen=True)
class _Change:
    """A stop that leaves, by where it is on the line, and a place that comes; None where none does."""

    at: int | None
    into: int | None


def shorter_line(times: LineTimes, task: LineTask, line: PointLine) -> PointLine:
    """A line from the same begin to the same end that meets what is asked for, and takes no longer."""
    search = _TourSearch(times, task, line)
    stops = max(1, len(line) - 2)
    for _ in range(min(STEPS, max(50, LOOKS // stops))):
        if not search.step():
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
        self._made = 0

    def _first_free(self, line: PointLine) -> int:
        """The first place of a line that may be driven to later."""
        return 1 if self._task.rank is None else 2

    def _places(self, line: PointLine) -> list[int]:
        """The stops of a line."""
        return [point for point in line if point < self._times.places]

    def step(self) -> bool:
        """Make the best change; whether there was one."""
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

    def _price(self, missing: IntArray) -> None:
        """Make what is missing dearer; where nothing is, everything cheaper."""
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

    def _leg_for(self, line: PointLine, place: int) -> int:
        """The leg in which this place adds least."""
        rank = self._task.rank
        first = 0
        if rank is not None and any(p < self._times.places for p in line):
            if rank[place] < min(rank[p] for p in line if p < self._times.places):
                return 0
            first = 1
        added = [int(self._times.inserted(line, leg)[place]) for leg in range(first, len(line) - 1)]
        return first + int(np.argmin(added))

    def _best_change(self) -> _Change | None:
        """The change after which time and what is missing cost least together, of those that are allowed."""
        found = list(self._changes())
        values = np.concatenate([value for _, value in found]) if found else np.empty(0, np.int64)
        ends = np.cumsum([len(value) for _, value in found])
        for _ in range(TRIED):
            k = int(np.argmin(values)) if len(values) else 0
            if not len(values) or values[k] >= NEVER:
                return None
            which = int(np.searchsorted(ends, k, side="right"))
            at, value = found[which]
            into = k - (int(ends[which]) - len(value))
            change = _Change(at, into if len(value) > 1 else None)
            if self._task.together(self._after(change)):
                return change
            values[k] = NEVER
        return None

    def _after(self, change: _Change) -> IntArray:
        """The stops after a change, ascending."""
        rest = self._line if change.at is None else without(self._line, change.at)
        more = [] if change.into is None else [change.into]
        return np.array(sorted({*self._places(rest), *more}), dtype=np.int64)

    def _changes(self) -> Iterator[tuple[int | None, IntArray]]:
        """For each stop that may leave, and for none: what each place that may come then costs (places,).

        Also what it costs if nobody comes (1,). All is told less the line's own time.
        """
        times, line = self._times, self._line
        legs = np.array([times.inserted(line, leg) for leg in range(len(line) - 1)])
        legs[: self._first_free(line) - 1] = NEVER
        ahead = np.minimum.accumulate(legs, axis=0)
        behind = np.minimum.accumulate(legs[::-1], axis=0)[::-1]
        barred = self._barred()
        yield None, self._allowed(ahead[-1] + self._missing_with(None), barred, None)
        for at in range(1, len(line) - 1):
            place = line[at]
            if place >= times.places:
                continue
            saved = times.removed(line, at)
            least = self._least_added(at, ahead, behind)
            value = least - saved + self._missing_with(at)
            here = int(least[place]) - saved
            value = self._allowed(value, barred, at)
            if self._task.stays[place]:
                value[:] = NEVER
            value[place] = here + self._missing_now() if here < 0 else NEVER
            yield at, value
            if not self._task.stays[place] and not self._leads(at):
                yield at, np.array([self._missing_without(at) - saved])

    def _leads(self, at: int) -> bool:
        """Whether the stop at this place of the line comes first because of its rank."""
        return self._task.rank is not None and at == 1

    def _least_added(self, at: int, ahead: IntArray, behind: IntArray) -> IntArray:
        """What each place adds where it adds least, once the stop `at` is left out (places,)."""
        times, line = self._times, self._line
        rest = without(line, at)
        if self._leads(at):
            return times.inserted(rest, 0)
        first = self._first_free(line) - 1
        near = [leg for leg in (at - 2, at - 1, at) if first <= leg < len(rest) - 1]
        least = np.minimum.reduce([times.inserted(rest, leg) for leg in near])
        if at - 3 >= 0:
            least = np.minimum(least, ahead[at - 3])
        if at + 2 < len(behind):
            least = np.minimum(least, behind[at + 2])
        return least

    def _barred(self) -> BoolArray:
        """Places that may not come: those on the line, and those left of late."""
        barred = np.zeros(self._times.places, dtype=bool)
        barred[[p for p in self._line if p < self._times.places]] = True
        spare = self._times.places - len(self._places(self._line))
        tenure = 1 + self._made // LULL % max(1, min(TENURE, spare // 2))
        barred[self._left[-tenure:]] = True
        return barred

    def _allowed(self, value: IntArray, barred: BoolArray, at: int | None) -> IntArray:
        value = np.where(barred, NEVER, value)
        rank = self._task.rank
        if rank is None:
            return value
        stops = [rank[p] for k, p in enumerate(self._line) if p < self._times.places and k != at]
        lowest = min(stops, default=None)
        if lowest is None:
            return value
        wrong = rank > lowest if at == 1 else rank < lowest
        return np.where(wrong, NEVER, value)

    def _missing_now(self) -> int:
        return int(self._board.weight @ self._board.missing) // SCALE

    def _missing_with(self, at: int | None) -> IntArray:
        """What is missing costs so much with each place, in exchange for the stop `at` if one is given."""
        if at is None:
            return self._board.after_takes() // SCALE
        if self._task.stays[self._line[at]]:
            return np.zeros(self._times.places, dtype=np.int64)
        return self._board.after_swaps(self._line[at])[0] // SCALE

    def _missing_without(self, at: int) -> int:
        return int(self._board.after_drop(self._line[at])) // SCALE
