"""Times of a line, the sequence of points of a route, and of its changes, in whole microseconds.

A line begins and ends at a given position, at a required stop, or at `free`, a virtual point: driving from
it or to it takes no time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.routing.leg_table import NO_HEADING, LegTable

MOST_KEPT = 4000
"""Legs whose insertions are cached."""

PointLine = list[int]


@dataclass(eq=False)
class LineTimes:
    """Times of lines over the points of a table: possible stops first, then starts and ends."""

    table: LegTable
    positions: int
    """Number of points that may be stops."""
    pause: int
    """Microseconds of settling and scanning at a stop."""
    scan: IntArray
    """Heading of the scan at each point; NO_HEADING for the heading of arrival (points,)."""
    start_heading: int
    """Heading at a line's first point; NO_HEADING for the heading of its first leg."""
    _inserted: dict[tuple[int, int, int, int], IntArray] = field(default_factory=dict)

    def total(self, line: Sequence[int]) -> int:
        """Microseconds of a whole line."""
        points = np.array(line, dtype=np.int64)
        come, go = self._headings(points)
        driven = int(self.table.spent[points[:-1], points[1:]].sum())
        return driven + int(self._at(points, come, go).sum()) + self.pause * self.stops_of(line)

    def stops_of(self, line: Sequence[int]) -> int:
        """Number of stops of a line."""
        return sum(point < self.positions for point in line)

    def _headings(self, points: IntArray) -> tuple[IntArray, IntArray]:
        """Headings of arrival and departure at each point of a line."""
        a, b = points[:-1], points[1:]
        come = np.concatenate([[self.start_heading], self.table.arriving[a, b]])
        go = np.concatenate([self.table.leaving[a, b], [NO_HEADING]])
        return come, go

    def _at(self, point: IntArray | int, come: IntArray | int, go: IntArray | int) -> IntArray:
        """Times of turning at points, from the arrival to the scan's heading and on to the departure."""
        scan, come, go = np.broadcast_arrays(self.scan[point], come, go)
        come = np.where(
            (come < 0) & (scan >= 0), go, come
        )  # a route begins with the heading of its first leg
        through = self.table.turns(come, go)
        looked = self.table.turns(come, scan) + self.table.turns(scan, go)
        return np.where(scan < 0, through, looked)

    def inserted(self, line: PointLine, leg: int) -> IntArray:
        """Time added by a stop at each position between points `leg` and `leg` + 1 of a line (positions,)."""
        before = line[leg - 1] if leg else NO_HEADING
        beyond = line[leg + 2] if leg + 2 < len(line) else NO_HEADING
        key = (before, line[leg], line[leg + 1], beyond)
        if key not in self._inserted:
            if len(self._inserted) >= MOST_KEPT:
                self._inserted.clear()
            self._inserted[key] = self._added(*key)
        return self._inserted[key]

    def _added(self, before: int, a: int, b: int, beyond: int) -> IntArray:
        spent, leaving, arriving = self.table.spent, self.table.leaving, self.table.arriving
        position = np.arange(self.positions)
        come = self.start_heading if before < 0 else int(arriving[before, a])
        go = NO_HEADING if beyond < 0 else int(leaving[b, beyond])
        there = self._at(a, come, leaving[a, position]) + self._at(b, arriving[position, b], go)
        here = self._at(a, come, leaving[a, b]) + self._at(b, arriving[a, b], go)
        own = self._at(position, arriving[a, position], leaving[position, b])
        driven = spent[a, position] + spent[position, b] - spent[a, b]
        added: IntArray = driven + own + there - here + self.pause
        return added

    def removed(self, line: PointLine, at: int) -> int:
        """Time saved by removing the stop at index `at` of a line."""
        return int(self.inserted(without(line, at), at - 1)[line[at]])

    def turned(self, line: PointLine, first: int) -> PointLine:
        """The line after reversing stretches from index `first` on, while that saves time."""
        while True:
            i, j, gain = self._best_turn(line, first)
            if gain <= 0:
                return line
            line = [*line[:i], *line[i : j + 1][::-1], *line[j + 1 :]]

    def _best_turn(self, line: PointLine, first: int) -> tuple[int, int, int]:
        """The stretch from `i` to `j` whose reversal saves most, and the time saved.

        Turns are counted only where the reversal could save time if no turns were left at its ends.
        """
        points = np.array(line, dtype=np.int64)
        if len(line) - first < 3:
            return 0, 0, 0
        come, go = self._headings(points)
        spent, leaving, arriving = self.table.spent, self.table.leaving, self.table.arriving
        at = self._at(points, come, go)
        saved = self._saved_inside(points, at)
        i, j = self._likely_turns(points, at, saved, first)
        if not len(i):
            return 0, 0, 0
        a, x, y, b = (points[k] for k in (i - 1, i, j, j + 1))
        old = spent[a, x] + spent[y, b] + at[i - 1] + at[i] + at[j] + at[j + 1]
        new = spent[a, y] + spent[x, b]
        new = new + self._at(a, come[i - 1], leaving[a, y]) + self._at(b, arriving[x, b], go[j + 1])
        new = new + self._at(y, arriving[a, y], leaving[y, points[j - 1]])
        new = new + self._at(x, arriving[points[i + 1], x], leaving[x, b])
        gain = old - new + saved[j - 1] - saved[i]
        best = int(np.argmax(gain))
        return int(i[best]), int(j[best]), int(gain[best])

    def _likely_turns(
        self, points: IntArray, at: IntArray, saved: IntArray, first: int
    ) -> tuple[IntArray, IntArray]:
        """Stretches, from i to j, whose reversal may save time (n,)."""
        away = self.table.spent[np.ix_(points, points)]
        step = np.diagonal(away, 1)
        begins = step[first - 1 : -1] + at[first - 1 : -2] + at[first:-1] - saved[first:]
        ends = step[first:] + at[first:-1] + at[first + 1 :] + saved[first - 1 : -1]
        most = begins[:, None] + ends[None, :] - away[first - 1 : -2, first:-1] - away[first:-1, first + 1 :]
        i, j = np.nonzero(np.triu(most > 0, 1))
        return i + first, j + first

    def _saved_inside(self, points: IntArray, at: IntArray) -> IntArray:
        """Time saved inside a stretch that is reversed, summed up to each index (len(points) - 1,).

        All 0 unless scans have headings.
        """
        back = self._at(
            points[1:-1],
            self.table.arriving[points[2:], points[1:-1]],
            self.table.leaving[points[1:-1], points[:-2]],
        )
        return np.concatenate([[0], np.cumsum(at[1:-1] - back)])


def without(line: PointLine, at: int) -> PointLine:
    """The line without the point at index `at`."""
    return [*line[:at], *line[at + 1 :]]
