"""The line of points that a route drives, and what every change of it would take, in whole microseconds.

A line begins and ends at a given place, at a stop that stays, or at `free`, a point without a place, from and
to which nothing is driven.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.covering_tour.leg_table import NO_HEADING, LegTable

MOST_KEPT = 4000
"""Legs whose insertions are remembered."""

PointLine = list[int]


@dataclass(eq=False)
class LineTimes:
    """Times of lines over the points of a table: places that may be stops first, then starts and ends."""

    table: LegTable
    places: int
    """Points that may be stops."""
    pause: int
    """Settling and scanning at a stop."""
    scan: IntArray
    """Heading of the scan at each point; NO_HEADING where it is that of the arrival (points,)."""
    start_heading: int
    """With which a line leaves its first point; NO_HEADING where it takes that of its first leg."""
    _inserted: dict[tuple[int, int, int, int], IntArray] = field(default_factory=dict)

    def total(self, line: Sequence[int]) -> int:
        """Microseconds of a whole line."""
        points = np.array(line, dtype=np.int64)
        come, go = self._headings(points)
        driven = int(self.table.spent[points[:-1], points[1:]].sum())
        return driven + int(self._at(points, come, go).sum()) + self.pause * self.stops_of(line)

    def stops_of(self, line: Sequence[int]) -> int:
        """How many stops a line has."""
        return sum(point < self.places for point in line)

    def _headings(self, points: IntArray) -> tuple[IntArray, IntArray]:
        """Headings with which each point of a line is reached and left."""
        a, b = points[:-1], points[1:]
        come = np.concatenate([[self.start_heading], self.table.arriving[a, b]])
        go = np.concatenate([self.table.leaving[a, b], [NO_HEADING]])
        return come, go

    def _at(self, point: IntArray | int, come: IntArray | int, go: IntArray | int) -> IntArray:
        """Turns at points that are reached and left with these headings: to the scan's, and from it."""
        scan, come, go = np.broadcast_arrays(self.scan[point], come, go)
        come = np.where(
            (come < 0) & (scan >= 0), go, come
        )  # a route begins with the heading of its first leg
        through = self.table.turns(come, go)
        looked = self.table.turns(come, scan) + self.table.turns(scan, go)
        return np.where(scan < 0, through, looked)

    def inserted(self, line: PointLine, leg: int) -> IntArray:
        """What a stop at each place adds between point `leg` of a line and the next one (places,)."""
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
        place = np.arange(self.places)
        come = self.start_heading if before < 0 else int(arriving[before, a])
        go = NO_HEADING if beyond < 0 else int(leaving[b, beyond])
        there = self._at(a, come, leaving[a, place]) + self._at(b, arriving[place, b], go)
        here = self._at(a, come, leaving[a, b]) + self._at(b, arriving[a, b], go)
        own = self._at(place, arriving[a, place], leaving[place, b])
        driven = spent[a, place] + spent[place, b] - spent[a, b]
        added: IntArray = driven + own + there - here + self.pause
        return added

    def removed(self, line: PointLine, at: int) -> int:
        """What a line takes less without the stop at place `at` of it."""
        return int(self.inserted(without(line, at), at - 1)[line[at]])

    def turned(self, line: PointLine, first: int) -> PointLine:
        """The line in which no stretch from place `first` on, turned round, makes it shorter."""
        while True:
            i, j, gain = self._best_turn(line, first)
            if gain <= 0:
                return line
            line = [*line[:i], *line[i : j + 1][::-1], *line[j + 1 :]]

    def _best_turn(self, line: PointLine, first: int) -> tuple[int, int, int]:
        """The stretch, from `i` to `j`, whose turning round saves most, and how much that is."""
        points = np.array(line, dtype=np.int64)
        i, j = np.triu_indices(len(line) - 1 - first, 1)
        if not len(i):
            return 0, 0, 0
        i, j = i + first, j + first
        come, go = self._headings(points)
        spent, leaving, arriving = self.table.spent, self.table.leaving, self.table.arriving
        a, x, y, b = (points[k] for k in (i - 1, i, j, j + 1))
        at = self._at(points, come, go)
        old = spent[a, x] + spent[y, b] + at[i - 1] + at[i] + at[j] + at[j + 1]
        new = spent[a, y] + spent[x, b]
        new = new + self._at(a, come[i - 1], leaving[a, y]) + self._at(b, arriving[x, b], go[j + 1])
        new = new + self._at(y, arriving[a, y], leaving[y, points[j - 1]])
        new = new + self._at(x, arriving[points[i + 1], x], leaving[x, b])
        gain = old - new + self._inner(points, at, i, j)
        best = int(np.argmax(gain))
        return int(i[best]), int(j[best]), int(gain[best])

    def _inner(self, points: IntArray, at: IntArray, i: IntArray, j: IntArray) -> IntArray:
        """What stretches save inside, driven the other way: nothing but where scans have headings."""
        back = self._at(
            points[1:-1],
            self.table.arriving[points[2:], points[1:-1]],
            self.table.leaving[points[1:-1], points[:-2]],
        )
        saved = np.concatenate([[0], np.cumsum(at[1:-1] - back)])
        inner: IntArray = saved[j - 1] - saved[i]
        return inner


def without(line: PointLine, at: int) -> PointLine:
    """The line without the point at place `at` of it."""
    return [*line[:at], *line[at + 1 :]]
