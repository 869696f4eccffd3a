"""Long routes: each stretch of stops is improved by itself, between the stops next to it.

The table of all paths grows with the square of the positions. So a stretch has positions of its own, those
nearest to its stops, and paths are found only as far as they are needed. Stops outside it stay. They count
as seen, and its scans must stay connected with theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.console.plugins import variant
from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import FloatArray, IntArray, frozen, polyline_length
from stopgo.planner.covering_tour.problem import TourProblem, nearest_rows, of_rows
from stopgo.planner.covering_tour.search import LineTask, shorter_line
from stopgo.planner.covering_tour.timed_line import LineTimes
from stopgo.planner.routing import GRAPHS, rank_at_door
from stopgo.planner.routing.leg_table import MICROSECONDS, NO_HEADING, LegTable, leg_table
from stopgo.planner.routing.legs import Legs
from stopgo.planner.routing.paths import shortest_paths
from stopgo.planner.routing.roadmap import graph_of

LONGEST = 140
"""Stops of a stretch."""
POSITIONS = 1000
"""Most positions of a stretch."""
FARTHEST = 8.0
"""Farthest path that is found, as a multiple of the mean leg; no leg of the stretch is longer."""


def by_stretches(problem: TourProblem) -> IntArray:
    """Rows of the stops in their order, once each stretch takes the least time found.

    The first and the last stop, and one between any two stretches, stay.
    """
    rows = problem.route.selection.chosen[problem.route.order]
    legs = np.array([polyline_length(leg) for leg in problem.route.approaches])
    done, come, pieces = rows[:1], NO_HEADING, pieces_of(problem)
    for first in range(1, len(rows) - 1, LONGEST + 1):
        last = min(first + LONGEST, len(rows) - 1)
        stretch = _Stretch(problem, pieces, done, rows[first:last], rows[last:], legs[first : last + 1], come)
        found = stretch.improved()
        come = int(stretch.table.arriving[[stretch.after - 1, *found][-1], stretch.after])
        done = np.concatenate([done, stretch.rows[found], rows[last : last + 1]])
    return np.concatenate([done, rows[-1:]]) if done[-1] != rows[-1] else done


def pieces_of(problem: TourProblem) -> tuple[FloatArray, IntArray]:
    """Nodes and straight pieces of the paths between all rows of a problem, which are the first nodes."""
    return graph_of(problem.route.space, problem.candidates.xy[problem.candidates.kept[problem.placed_rows]])


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Stops `own` of a route, after those that are `done` and before those that are `left`, all as rows."""

    problem: TourProblem
    pieces: tuple[FloatArray, IntArray]
    done: IntArray
    own: IntArray
    left: IntArray
    legs: FloatArray
    """Metres of the legs from the stop before to the stop after."""
    come: int
    """Heading of arrival at the last of the stops done."""

    @cached_property
    def rows(self) -> IntArray:
        """Row of each position (positions,)."""
        offered = np.setdiff1d(self.problem.offered, self.others)
        if self.problem.begins_at_door:  # no other stop may be nearer to the door than the first
            rank = rank_at_door(self.problem.candidates, np.append(offered, self.done[0]))[0]
            offered = offered if rank is None else offered[rank[:-1] > rank[-1]]
        nearest = nearest_rows(self.problem.candidates, offered, self.own, most=POSITIONS)
        return np.union1d(nearest, self.own).astype(np.int64)

    @cached_property
    def others(self) -> IntArray:
        return np.union1d(self.done, self.left).astype(np.int64)

    @property
    def after(self) -> int:
        """The point of the next stop; that of the stop before is one less."""
        return len(self.rows) + 1

    def improved(self) -> list[int]:
        """Positions of the stops in their new order."""
        order = np.searchsorted(self.rows, self.own).tolist()
        found = shorter_line(self.times, self.task, [self.after - 1, *order, self.after])
        return found[1:-1]

    @cached_property
    def task(self) -> LineTask:
        problem, others = self.problem, self.others
        every = np.union1d(self.rows, others).astype(np.int64)
        cover = of_rows(problem.cover, every).after(np.searchsorted(every, others))
        return LineTask(
            cover=of_rows(cover, np.searchsorted(every, self.rows)),
            stays=np.isin(self.rows, problem.stays),
            rank=None,
            joins=problem.joins_among(self.rows, others),
        )

    @cached_property
    def _points(self) -> IntArray:
        """Rows of the positions, then of the stops before and after."""
        return np.concatenate([self.rows, self.done[-1:], self.left[:1]]).astype(np.int64)

    @cached_property
    def table(self) -> LegTable:
        return leg_table(self._legs(), robot_of(self.problem.settings))

    @cached_property
    def times(self) -> LineTimes:
        settings, candidates = self.problem.settings, self.problem.candidates
        scan = np.full(len(self._points), NO_HEADING, dtype=np.int64)
        if len(candidates.heading):
            headings = candidates.heading[candidates.kept[self._points]].tolist()
            scan[:] = [self.table.heading(heading) for heading in headings]
        return LineTimes(
            table=self.table,
            positions=len(self.rows),
            pause=round((settings.settle + settings.scan_time) * MICROSECONDS),
            scan=frozen(scan, np.int64),
            start_heading=self.come,
        )

    def _legs(self) -> Legs:
        """Paths between the points, over those nodes that these paths may use."""
        (xy, edges), whole = self.pieces, self.problem.placed_rows
        points = np.searchsorted(whole, self._points)
        line = np.concatenate([self.done[-1:], self.own, self.left[:1]])
        at = xy[np.searchsorted(whole, line)]
        limit = max(FARTHEST * float(self.legs.mean()), float(self.legs.max())) * (1 + 1e-9)
        near = np.all((xy >= at.min(axis=0) - limit) & (xy <= at.max(axis=0) + limit), axis=1)
        near[points] = True
        near[: len(whole)] &= np.isin(np.arange(len(whole)), points)
        nodes = np.concatenate([points, np.setdiff1d(np.flatnonzero(near), points)])
        number = np.full(len(xy), -1, dtype=np.int64)
        number[nodes] = np.arange(len(nodes))
        kept = number[edges]
        kept = kept[(kept >= 0).all(axis=1)]
        paths = shortest_paths(xy[nodes], kept, len(points), trees=True, limit=limit)
        return Legs(variant("graph", "exact", GRAPHS), paths, xy[points])
