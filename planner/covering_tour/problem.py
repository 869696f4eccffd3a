"""Route -> what a search for a quicker one needs: places, times of ways, what must be seen, what stays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.document.schedule import straight_times
from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, Route, Visibility
from stopgo.planner.covering_tour.least_time_bound import RouteAsked
from stopgo.planner.covering_tour.leg_table import MICROSECONDS, NO_HEADING, LegTable, leg_table
from stopgo.planner.covering_tour.search import LineTask
from stopgo.planner.covering_tour.timed_line import LineTimes, PointLine
from stopgo.planner.covering_tour.zones import Zone, zones_of
from stopgo.planner.overlap import links_of
from stopgo.planner.routing import legs_between, rank_at_door
from stopgo.planner.routing.legs import Legs
from stopgo.planner.selection import METHODS, cover_problem, offered_for_follow_up, remaining_cover
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.selection.connected_selection import ConnectedCover
from stopgo.planner.selection.cover import Cover

MOST_PLACES = 1500
"""Candidates that may become stops: those nearest to the stops there are."""
MOST_BOUNDED = 5000
"""Candidates up to which the bound tells of the way at all."""


Together = Callable[[IntArray], bool]
"""Whether the scans of some rows hang together as they must."""


@dataclass(frozen=True, eq=False)
class TourProblem:
    """Places are numbered as in `rows`; points are the places, then start and end, then `free`."""

    route: Route
    whole: Cover
    """All that is asked for, over all rows."""
    cover: Cover
    """What is left of it after what stays and what is done, over all rows."""
    offered: IntArray
    """All rows that a stop may be at."""
    rows: IntArray
    """Of those, the rows of places, and rows that stay (places,)."""
    stays: IntArray
    """Rows that are stops in any case."""
    done: IntArray
    """Rows that see what they see, and are no stops."""
    together: Together

    @property
    def candidates(self) -> Candidates:
        return self.route.selection.visibility.candidates

    @property
    def settings(self) -> Settings:
        return self.candidates.space.settings

    @property
    def closed(self) -> bool:
        return self.route.tour == "closed"

    @cached_property
    def begin(self) -> int | None:
        """The stop that a closed route without a start begins at, which stays."""
        return self._order[0] if self.closed and self.settings.start is None else None

    @cached_property
    def _order(self) -> PointLine:
        """The route's stops, as places."""
        chosen = self.route.selection.chosen[self.route.order]
        return [int(k) for k in np.searchsorted(self.rows, chosen)]

    @cached_property
    def _ends(self) -> FloatArray:
        """Start and end where they are given; and where the route begins and ends itself, that place."""
        found = [] if self.settings.start is None else [self.settings.start[:2]]
        found += [] if self.settings.end is None else [self.settings.end]
        found += [] if self.begin is None else [tuple(self._xy[self.begin].tolist())]
        return np.array(found).reshape(-1, 2)

    @cached_property
    def _xy(self) -> FloatArray:
        found: FloatArray = self.candidates.xy[self.candidates.kept[self.rows]].reshape(-1, 2)
        return found

    @cached_property
    def legs(self) -> Legs:
        return legs_between(self.candidates.space, np.concatenate([self._xy, self._ends]))

    @cached_property
    def line(self) -> PointLine:
        """The route as a line."""
        places, free = len(self.rows), len(self.rows) + len(self._ends)
        start = places if self.settings.start is not None else free
        end = free - 1 if self.settings.end is not None or self.begin is not None else free
        if self.closed and self.begin is None:
            end = start
        order = self._order
        return [order[0], *order[1:], end] if self.begin is not None else [start, *order, end]

    def stops_of(self, line: PointLine) -> PointLine:
        """The stops of a line, as places."""
        return [point for point in line if point < len(self.rows)]

    @cached_property
    def times(self) -> LineTimes:
        settings, candidates, places = self.settings, self.candidates, len(self.rows)
        table = leg_table(self.legs, robot_of(settings))
        scan = np.full(places + len(self._ends) + 1, NO_HEADING, dtype=np.int64)
        if len(candidates.heading):
            headings = candidates.heading[candidates.kept[self.rows]].tolist()
            scan[:places] = [table.heading(heading) for heading in headings]
        start_heading = NO_HEADING
        stands = scan.copy()
        if settings.start is not None:
            start_heading = table.heading(math.radians(settings.start[2]))
            stands[places] = start_heading
        return LineTimes(
            table=_with_free(table, self.legs.lengths, stands),
            places=places,
            pause=round((settings.settle + settings.scan_time) * MICROSECONDS),
            scan=frozen(scan, np.int64),
            start_heading=start_heading,
        )

    @cached_property
    def task(self) -> LineTask:
        stays = np.isin(self.rows, self.stays)
        if self.begin is not None:
            stays[self.begin] = True
        cover = self.cover if self.begin is None else self.cover.after(self.rows[[self.begin]])
        rank = rank_at_door(self.candidates, self.rows)[0] if self.settings.start is None else None
        return LineTask(
            cover=_of_rows(cover, self.rows),
            stays=stays,
            rank=None if self.begin is not None else rank,
            together=lambda places: self.together(self.rows[places]),
        )

    @cached_property
    def asked(self) -> RouteAsked:
        """The same problem for its bound, over all candidates; where there are too many, the stops alone."""
        settings = self.settings
        rows = np.union1d(self.offered, self.stays).astype(np.int64)
        if len(rows) > MOST_BOUNDED:
            return self._stops_alone
        start = len(rows) if settings.start is not None else None
        end = len(rows) + (start is not None) if settings.end is not None else None
        lengths, seconds = self._ways_over(rows)
        among = np.arange(len(rows))
        own = [Zone(np.flatnonzero(rows == row), 0.0) for row in self.stays]
        return RouteAsked(
            lengths=lengths,
            seconds=seconds,
            offered=among,
            zones=[*own, *zones_of(_of_rows(self.cover, rows), lengths[: len(rows), : len(rows)])],
            start=start,
            end=end,
            closed=self.closed,
            stops=self._fewest,
            pause_s=settings.settle + settings.scan_time,
            robot=robot_of(settings),
        )

    @cached_property
    def _fewest(self) -> int:
        """How many stops there are at least; what another's selector says of it is not taken for proved."""
        selection = self.route.selection
        if self.settings.selector in METHODS:
            return selection.bound
        return len(self.stays) + lower_bound(self.cover, found=len(selection.chosen) - len(self.stays))

    @property
    def _stops_alone(self) -> RouteAsked:
        """The problem as if all places were one."""
        settings, none = self.settings, np.zeros((1, 1))
        return RouteAsked(
            lengths=none,
            seconds=none,
            offered=np.arange(1),
            zones=[],
            start=None,
            end=None,
            closed=False,
            stops=self._fewest,
            pause_s=settings.settle + settings.scan_time,
            robot=robot_of(settings),
        )

    def _ways_over(self, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Metres and seconds between rows, start and end; of very many rows as the crow flies."""
        given = len(self._ends) - (self.begin is not None)
        if len(rows) == len(self.rows):
            points = len(rows) + given
            seconds = self.times.table.spent[:points, :points] / MICROSECONDS
            return self.legs.lengths[:points, :points], seconds
        xy = np.concatenate([self.candidates.xy[self.candidates.kept[rows]], self._ends[:given]])
        lengths = np.hypot(*(np.subtract.outer(axis, axis) for axis in xy.T))
        robot = robot_of(self.settings)
        return lengths, straight_times(lengths, speed=robot.speed, acceleration=robot.acceleration)


def problem_of(route: Route, done: IntArray | None = None) -> TourProblem:
    """What is to be seen and what must stay, as the selection of the route has it."""
    visibility, chosen = route.selection.visibility, np.unique(route.selection.chosen)
    stays: IntArray = np.empty(0, dtype=np.int64)
    together: Together = _any_rows
    joins = visibility.candidates.space.settings.least_overlap > 0
    if done is not None:
        whole, cover = remaining_cover(visibility, done)
        if joins:
            cover, together = _joined(
                visibility, whole, done, chosen, offered_for_follow_up(visibility, done)
            )
    else:
        whole, stays, cover = cover_problem(visibility)
        if joins:
            cover, together = _joined(visibility, whole, stays, chosen, np.arange(whole.rows))
    offered = np.flatnonzero(np.diff(cover.sees.indptr)).astype(np.int64)
    nearest = _nearest(visibility.candidates, offered, chosen)
    return TourProblem(
        route=route,
        whole=whole,
        cover=cover,
        offered=offered,
        rows=frozen(np.union1d(nearest, np.union1d(chosen, stays)), np.int64),
        stays=stays,
        done=np.empty(0, np.int64) if done is None else done,
        together=together,
    )


def _any_rows(rows: IntArray) -> bool:
    return True


def _joined(
    visibility: Visibility, whole: Cover, fixed: IntArray, chosen: IntArray, offered: IntArray
) -> tuple[Cover, Together]:
    """What is left to see where scans must register, and whether rows hang together as the chosen ones do.

    Rows `fixed` stay or were scanned before; they hang together with the others.
    """
    cover = whole.with_one_of_each([np.array([row]) for row in fixed])
    task = ConnectedCover(cover, links_of(visibility.candidates), offered)
    most = task.parts(np.union1d(chosen, fixed))
    left = whole.after(fixed).offering(np.sort(np.concatenate(task.regions)))
    return left, lambda rows: task.parts(np.union1d(rows, fixed)) <= most


def _nearest(candidates: Candidates, offered: IntArray, chosen: IntArray) -> IntArray:
    """Of the rows offered, as many as may be places: those nearest to a chosen one."""
    if len(offered) <= MOST_PLACES:
        return offered
    xy = candidates.xy[candidates.kept]
    away = np.min([np.hypot(*(xy[offered] - xy[row]).T) for row in chosen], axis=0)
    return np.sort(offered[np.argsort(np.round(away, 6), kind="stable")[:MOST_PLACES]])


def _of_rows(cover: Cover, rows: IntArray) -> Cover:
    """The problem over these rows alone, numbered anew."""
    return Cover(cover.sees[rows], cover.worth, cover.needed, cover.views)


def _with_free(table: LegTable, lengths: FloatArray, stands: IntArray) -> LegTable:
    """With a last point that nothing is driven from or to; where nothing is driven, headings stay."""
    leaving, arriving = (
        np.pad(angles, (0, 1), constant_values=NO_HEADING) for angles in (table.leaving, table.arriving)
    )
    here, there = np.nonzero(lengths == 0)
    leaving[here, there] = arriving[here, there] = stands[here]
    return LegTable(
        spent=frozen(np.pad(table.spent, (0, 1)), np.int64),
        leaving=frozen(leaving, np.int64),
        arriving=frozen(arriving, np.int64),
        whole_turn=table.whole_turn,
    )
