"""Route -> route: stops and their order chosen together, for the least time of the whole mission.

This is the covering tour problem (Gendreau, Laporte and Semet, Operations Research 1997): a tour over some
of the positions, from which enough is seen. The search begins with the fewest stops and their shortest
route. It exchanges, removes and adds stops and reverses stretches, by the time of the route. By the
mission's own schedule the result is never slower than the first route.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stopgo.mission.document.schedule import schedule
from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages import LeastTime, Route, Selection
from stopgo.planner.covering_tour.least_time_bound import least_time
from stopgo.planner.covering_tour.problem import TourProblem, problem_of
from stopgo.planner.covering_tour.route_stretches import by_stretches
from stopgo.planner.covering_tour.search import shorter_line
from stopgo.planner.routing import points_and_ends, route_along
from stopgo.planner.routing.assemble import assemble
from stopgo.planner.selection import coverage_steps
from stopgo.planner.selection.greedy import in_greedy_order

METHOD = "stops and tour together, by tabu search"
WHOLE_UP_TO = 200
"""Stops up to which a route is improved as a whole."""


def least_time_route(route: Route, *, done: IntArray | None = None) -> Route:
    """The route with its stops and their order chosen for the least time, and a lower bound on the time.

    Rows `done` were scanned before: they count as seen and are not visited.
    """
    problem = problem_of(route, done)
    found = _driven(route, problem, _stops_in_order(problem))
    two_step_s, seconds = _seconds(route), _seconds(found)
    best = found if seconds < two_step_s else route
    least_s = min(seconds, two_step_s)
    bound = least_time(problem.bound_problem(best.selection.chosen[best.order], least_s))
    return replace(best, time=LeastTime(least_s, two_step_s, len(route.order), min(least_s, bound)))


def with_known_time(two_step: Route, quicker: Route) -> Route:
    """The route of fewest stops, with the times and the bound found for the quicker one."""
    known = quicker.time
    return two_step if known is None else replace(two_step, time=replace(known, seconds=known.two_step_s))


def _stops_in_order(problem: TourProblem) -> IntArray:
    """Rows of the stops that take least time, in their order."""
    if _has_stretches(problem):
        return by_stretches(problem)
    line = shorter_line(problem.times, problem.task, problem.line)
    return problem.rows[problem.stops_of(line)]


def _has_stretches(problem: TourProblem) -> bool:
    return len(problem.route.order) > WHOLE_UP_TO and problem.settings.graph == "exact"


def _seconds(route: Route) -> float:
    """Duration of the route by its mission's schedule."""
    return schedule(assemble(route)).total_s


def _driven(route: Route, problem: TourProblem, rows: IntArray) -> Route:
    """The route that drives to the stops at rows in this order, along the paths whose times were searched."""
    selection = _selected(route.selection, problem, rows)
    index = {int(row): k for k, row in enumerate(selection.chosen)}
    points, ends = points_and_ends(selection)
    order = [index[row] for row in rows.tolist()]
    ends = replace(ends, first=order[0] if ends.first is not None and ends.first < len(order) else ends.first)
    first = [ends.first] if ends.first is not None and ends.first >= len(order) else []
    last = [ends.last] if ends.last is not None else []
    sequence = [*first, *order, *last]
    legs = None if _has_stretches(problem) else problem.legs_of(selection.chosen)
    return route_along(selection, points, sequence, ends, METHOD, legs)


def _selected(before: Selection, problem: TourProblem, rows: IntArray) -> Selection:
    """The selection of these rows, in the order of their gain in coverage."""
    stay = np.isin(rows, problem.staying)
    others = in_greedy_order(problem.left_to_see, np.sort(rows[~stay]))
    rows = np.concatenate([np.sort(rows[stay]), others]).astype(np.int64)
    steps = coverage_steps(problem.whole, np.concatenate([problem.done, rows]))[len(problem.done) :]
    fewest = ", proved fewest" if len(rows) == before.bound and "proved fewest" in before.method else ""
    method = f"{before.method.partition(', proved fewest')[0]}, then with the tour{fewest}"
    return replace(before, chosen=frozen(rows, np.int64), coverage_steps=frozen(steps), method=method)


__all__ = ["least_time_route", "with_known_time"]
