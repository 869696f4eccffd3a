"""Route -> the covering tour problem: positions, times of paths, coverage demands, required stops.

Four numberings
---------------
Rows: candidates, as in `Visibility` and `Cover` (0 to `whole.rows` - 1). `offered`, `stays`, `done` and
`rows` hold row numbers; `whole` and `cover` are numbered by rows.

Positions: candidates that may become stops in the search. Position k is row `rows[k]`. `rows` is ascending
and holds the offered rows nearest to the chosen ones (at most `MOST_POSITIONS`), all chosen rows, and all
required rows. The cover of `task`, and `task.stays` and `task.rank`, are numbered by positions.

Points: with P positions and E ends,
- 0 to P - 1 are the positions;
- P to P + E - 1 are the ends: the start if it is given, then the end if it is given, then for a closed
  route without a start a second copy of the stop where it begins (`begin`);
- P + E is `free`, a virtual point: it takes no time to drive from it or to it.
`legs` and its lengths are over the P + E real points; `times` is over all P + E + 1 points. The points of
the time bound (`bound_problem`) are numbered apart: all offered and required rows, then start and end.

Lines: a route is a list of points (`line`). Its first and last entries are fixed, all others are positions:
- open: from the start, or `free`, to the end, or `free`;
- closed with a start: from the start back to the same point;
- closed without a start: from position `begin` to its copy, the last of the ends. `begin` stays.

Invariants
----------
- `cover` is what required and scanned rows leave of `whole`. In `task` the stop `begin` is taken off too.
- Required rows are positions of every line. Rows in `done` count as seen and are never on a line.
- A heading is an angle counted in microseconds of turning (`LegTable`); `NO_HEADING` is -1.
- `joins` takes and gives row numbers here, and position numbers in `LineTask`.
- The cached properties are computed once, in any order: they depend only on the fields.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import shapely

from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, Route, Visibility
from stopgo.planner.covering_tour.least_time_bound import RouteRequirements
from stopgo.planner.covering_tour.search import LineTask
from stopgo.planner.covering_tour.time_graph import straight_graph, time_graph
from stopgo.planner.covering_tour.timed_line import LineTimes, PointLine
from stopgo.planner.covering_tour.zones import Zones
from stopgo.planner.overlap import links_of
from stopgo.planner.routing import legs_between, rank_at_door
from stopgo.planner.routing.leg_table import MICROSECONDS, NO_HEADING, LegTable, leg_table
from stopgo.planner.routing.legs import Legs, SomeLegs
from stopgo.planner.selection import METHODS, cover_problem, offered_for_follow_up, remaining_cover
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.selection.connected_selection import ConnectedCover
from stopgo.planner.selection.cover import Cover

MOST_POSITIONS = 1500
"""Most candidates that may become stops: those nearest to the chosen ones."""


ConnectionTest = Callable[[IntArray], BoolArray]
"""Returns, for some rows, True for each row with which they are connected as required (all rows,)."""


@dataclass(frozen=True, eq=False)
class TourProblem:
    """The problem of one route; rows, positions, points and lines are numbered as the module explains."""

    route: Route
    whole: Cover
    """The whole covering problem, over all rows."""
    cover: Cover
    """The covering problem that remains after the rows `stays` and `done`, over all rows."""
    offered: IntArray
    """All rows that a stop may be at."""
    rows: IntArray
    """Row of each position, ascending (positions,)."""
    stays: IntArray
    """Required rows: a stop must be at each."""
    done: IntArray
    """Rows scanned before: they count as seen and are no stops."""
    joins: ConnectionTest
    joins_among: Callable[[IntArray, IntArray], ConnectionTest]
    """Returns the test for some rows, by their index in these, together with other rows that all stay."""

    @property
    def candidates(self) -> Candidates:
        return self.route.candidates

    @property
    def settings(self) -> Settings:
        return self.route.settings

    @property
    def closed(self) -> bool:
        return self.route.tour == "closed"

    @cached_property
    def begin(self) -> int | None:
        """The position where a closed route without a start begins, which must stay; else None."""
        return self._order[0] if self.closed and self.settings.start is None else None

    @cached_property
    def _order(self) -> PointLine:
        """The route's stops, as positions."""
        chosen = self.route.selection.chosen[self.route.order]
        return [int(k) for k in np.searchsorted(self.rows, chosen)]

    @cached_property
    def _ends(self) -> FloatArray:
        """Start and end if they are given, then the copy of `begin` if there is one (ends, 2)."""
        found = [] if self.settings.start is None else [self.settings.start[:2]]
        found += [] if self.settings.end is None else [self.settings.end]
        found += [] if self.begin is None else [tuple(self._xy[self.begin].tolist())]
        return np.array(found).reshape(-1, 2)

    @cached_property
    def _xy(self) -> FloatArray:
        found: FloatArray = self.candidates.xy[self.candidates.kept[self.rows]].reshape(-1, 2)
        return found

    @property
    def begins_at_door(self) -> bool:
        """True if the route begins at the stop nearest an exterior door, where there is one."""
        return self.settings.start is None and self.begin is None

    @cached_property
    def placed_rows(self) -> IntArray:
        """All these rows and those of stops, which may only connect scans, ascending."""
        return np.union1d(self.all_rows, self.rows).astype(np.int64)

    @cached_property
    def all_rows(self) -> IntArray:
        """All rows that are offered or required, ascending: the points of the time bound."""
        return np.union1d(self.offered, self.stays).astype(np.int64)

    @cached_property
    def legs(self) -> Legs:
        return legs_between(self.route.space, np.concatenate([self._xy, self._ends]), trees=True)

    def legs_of(self, rows: IntArray) -> SomeLegs:
        """The paths between the stops at some rows, the start and the end, in this order."""
        ends = len(self._ends) - (self.begin is not None)
        return SomeLegs(
            self.legs, np.append(np.searchsorted(self.rows, rows), len(self.rows) + np.arange(ends))
        )

    @cached_property
    def line(self) -> PointLine:
        """The route as a line."""
        positions, free = len(self.rows), len(self.rows) + len(self._ends)
        start = positions if self.settings.start is not None else free
        end = free - 1 if self.settings.end is not None or self.begin is not None else free
        if self.closed and self.begin is None:
            end = start
        order = self._order
        return [order[0], *order[1:], end] if self.begin is not None else [start, *order, end]

    def stops_of(self, line: PointLine) -> PointLine:
        """The stops of a line, as positions."""
        return [point for point in line if point < len(self.rows)]

    @cached_property
    def times(self) -> LineTimes:
        settings, candidates, positions = self.settings, self.candidates, len(self.rows)
        table = leg_table(self.legs, robot_of(settings))
        scan = np.full(positions + len(self._ends) + 1, NO_HEADING, dtype=np.int64)
        if len(candidates.heading):
            headings = candidates.heading[candidates.kept[self.rows]].tolist()
            scan[:positions] = [table.heading(heading) for heading in headings]
        start_heading = NO_HEADING
        stands = scan.copy()
        if settings.start is not None:
            start_heading = table.heading(math.radians(settings.start[2]))
            stands[positions] = start_heading
        return LineTimes(
            table=_with_free(table, self.legs.lengths, stands),
            positions=positions,
            pause=round((settings.settle + settings.scan_time) * MICROSECONDS),
            scan=frozen(scan, np.int64),
            start_heading=start_heading,
        )

    @cached_property
    def staying(self) -> IntArray:
        """Rows that must stay: those required, and the one where a closed route without a start begins."""
        return self.stays if self.begin is None else np.append(self.stays, self.rows[self.begin])

    @cached_property
    def left_to_see(self) -> Cover:
        """The covering problem that these rows leave, over all rows."""
        return self.cover if self.begin is None else self.cover.after(self.rows[[self.begin]])

    @cached_property
    def task(self) -> LineTask:
        rank = rank_at_door(self.candidates, self.rows)[0] if self.begins_at_door else None
        return LineTask(
            cover=of_rows(self.left_to_see, self.rows),
            stays=np.isin(self.rows, self.staying),
            rank=rank,
            joins=lambda positions: self.joins(self.rows[positions])[self.rows],
        )

    def bound_problem(self, rows: IntArray, known_s: float) -> RouteRequirements:
        """The problem of the time bound over all candidates; `rows` are a plan's stops in its order."""
        settings, robot = self.settings, robot_of(self.settings)
        all_rows = self.all_rows
        cover, points = of_rows(self.cover, all_rows), len(all_rows)
        given = self._ends[: len(self._ends) - (self.begin is not None)]
        xy = np.concatenate([self.candidates.xy[self.candidates.kept[all_rows]], given])
        required = np.searchsorted(all_rows, self.stays)
        zones = Zones.of(cover, xy[:points], required)
        exact = settings.graph == "exact"
        graph = time_graph(self.route.space, xy, robot) if exact else straight_graph(xy, robot)
        start = points if settings.start is not None else None
        end = points + (start is not None) if settings.end is not None else None
        stops = np.searchsorted(all_rows, rows).tolist()
        back = stops[:1] if start is None else [start]
        line = [*([] if start is None else [start]), *stops, *(back if self.closed else [])]
        return RouteRequirements(
            graph=graph,
            cover=cover,
            zones=zones,
            start=start,
            end=end,
            closed=self.closed,
            stops=self._fewest,
            found=len(rows),
            known_s=known_s,
            pause_s=settings.settle + settings.scan_time,
            directions=graph.directions_along([*line, *([] if end is None else [end])], points),
        )

    @cached_property
    def _fewest(self) -> int:
        """Lower bound on the number of stops; the bound of a third-party selector does not count."""
        selection = self.route.selection
        if self.settings.selector in METHODS:
            return selection.bound
        return len(self.stays) + lower_bound(self.cover, found=len(selection.chosen) - len(self.stays))


def problem_of(route: Route, done: IntArray | None = None) -> TourProblem:
    """The covering tour problem of a route's selection; rows `done` were scanned before."""
    visibility, chosen = route.visibility, np.unique(route.selection.chosen)
    stays: IntArray = np.empty(0, dtype=np.int64)
    joins: ConnectionTest = partial(_any_rows, visibility.rows)
    among: Callable[[IntArray, IntArray], ConnectionTest] = _any_among
    registers = visibility.settings.registers
    if done is not None:
        whole, cover = remaining_cover(visibility, done)
        if registers:
            cover, joins, among = _joined(
                visibility, whole, done, chosen, offered_for_follow_up(visibility, done)
            )
    else:
        whole, stays, cover = cover_problem(visibility)
        if registers:
            cover, joins, among = _joined(visibility, whole, stays, chosen, np.arange(whole.rows))
    offered = np.flatnonzero(np.diff(cover.sees.indptr)).astype(np.int64)
    nearest = nearest_rows(visibility.candidates, offered, chosen, most=MOST_POSITIONS)
    return TourProblem(
        route=route,
        whole=whole,
        cover=cover,
        offered=offered,
        rows=frozen(np.union1d(nearest, np.union1d(chosen, stays)), np.int64),
        stays=stays,
        done=np.empty(0, np.int64) if done is None else done,
        joins=joins,
        joins_among=among,
    )


def _any_rows(count: int, rows: IntArray) -> BoolArray:
    return np.ones(count, dtype=bool)


def _any_among(rows: IntArray, others: IntArray) -> ConnectionTest:
    return partial(_any_rows, len(rows))


def _joined(
    visibility: Visibility, whole: Cover, fixed: IntArray, chosen: IntArray, offered: IntArray
) -> tuple[Cover, ConnectionTest, Callable[[IntArray, IntArray], ConnectionTest]]:
    """The remaining covering problem where scans must register, and the tests for connection.

    Rows `fixed` are required or were scanned before. Rows pass the test if, together with `fixed`, they
    are connected at least as well as the chosen rows.
    """
    cover = whole.with_one_of_each([np.array([row]) for row in fixed])
    task = ConnectedCover(cover, links_of(visibility.candidates), offered)
    most = task.parts(np.union1d(chosen, fixed))
    left = whole.after(fixed).offering(np.sort(np.concatenate(task.regions)))

    def among(rows: IntArray, others: IntArray) -> ConnectionTest:
        parts = task.among(rows, np.setdiff1d(np.union1d(others, fixed), rows).astype(np.int64))
        return lambda chosen: parts(chosen) <= most

    return left, lambda rows: task.parts_with_each(np.union1d(rows, fixed)) <= most, among


def nearest_rows(candidates: Candidates, offered: IntArray, chosen: IntArray, *, most: int) -> IntArray:
    """The offered rows nearest to the chosen ones, so many at most."""
    if len(offered) <= most:
        return offered
    xy = candidates.xy[candidates.kept]
    _, away = shapely.STRtree(shapely.points(xy[chosen])).query_nearest(
        shapely.points(xy[offered]), return_distance=True, all_matches=False
    )
    return np.sort(offered[np.argsort(np.round(away, 6), kind="stable")[:most]])


def of_rows(cover: Cover, rows: IntArray) -> Cover:
    """The problem over these rows alone, renumbered."""
    return Cover(cover.sees[rows], cover.worth, cover.needed, cover.views)


def _with_free(table: LegTable, lengths: FloatArray, stands: IntArray) -> LegTable:
    """The table with the point `free` added; between points at the same position headings stay."""
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
