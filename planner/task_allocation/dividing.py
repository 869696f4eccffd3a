"""Route -> division: its stops allocated to robots or tours, a route for each, and a proven lower bound."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.geometry import IntArray, frozen, polyline_length
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.stages import Route, Selection
from stopgo.mission.stages.division import DividedRoute
from stopgo.planner.routing import Ends, check_position, tour_bound
from stopgo.planner.routing.assemble import assemble
from stopgo.planner.selection import coverage_steps
from stopgo.planner.selection.cover import Cover, cover_of
from stopgo.planner.selection.demands import demands_of
from stopgo.planner.task_allocation.exchange import Tours, filled, shorter, shorter_longest
from stopgo.planner.task_allocation.least_times import least_makespan, least_tours
from stopgo.planner.task_allocation.tour_times import Tour, TourTimes, tour_times
from stopgo.planner.task_allocation.vehicles import vehicle_tours

TURNING = (0.2, 0.4, 0.7, 1.0)
"""Fractions of half a turn added to each path in the search, tried in order until tours meet their limit."""
SPARE_S = 1e-3
"""Seconds that a tour stays below its limit, since missions are rounded to micrometres."""
WIDER = (1.02, 1.05, 1.1, 1.2, 1.4, 2.0, 4.0, 16.0)
"""Multiples of the bound used as time limit in the search for a fleet's tours."""
SEARCH_UP_TO = 500
"""Stops up to which tours of a fleet are searched; of more a search this short finds none that are better."""
HALVINGS = 4
"""Bisections between a time limit with tours and one without."""
METHOD = "PyVRP, then moves and exchanges by the schedule's times"


def divided(route: Route) -> DividedRoute:
    """The stops of a route divided into tours, as the settings require.

    Raises
    ------
    NegativeResult
        If a stop is too far for a tour of its own within the time.
    InputError
        If there are more robots than stops, or the robot does not fit at a start.
    """
    settings = route.settings
    return _fleet(route, settings) if settings.robots is not None else _shifts(route, settings)


def division_cost(divided: DividedRoute) -> tuple[float, float]:
    """Cost of a division: the longest tour (s), or the number of tours; then the total time (s)."""
    times = [schedule(assemble(route)).total_s for route in divided.routes]
    return (max(times) if divided.kind == "robot" else float(len(times))), sum(times)


def _fleet(route: Route, settings: Settings) -> DividedRoute:
    selection, robots = route.selection, settings.robots or 1
    if robots > len(selection.chosen):
        raise InputError(
            f"--robots {robots}: more than the plan's {len(selection.chosen)} stops; "
            f"give at most --robots {len(selection.chosen)}"
        )
    starts = settings.starts
    for start in starts[1:]:
        check_position(selection.candidates, "start", start)
    closed = settings.tour != "open"
    clock = tour_times(
        selection,
        np.array([start[:2] for start in starts]),
        tuple(math.radians(start[2]) for start in starts),
        closed=closed,
    )
    numbers = list(range(robots)) if len(starts) > 1 else [0] * robots
    bound = least_makespan(clock, np.array(numbers))
    tours = _balanced(clock, numbers, bound, route, seed=settings.seed)
    if len(starts) == 1:
        rank = {stop: k for k, stop in enumerate(route.order.tolist())}
        tours = tuple(sorted(tours, key=lambda tour: min(rank[stop] for stop in tour)))
    return DividedRoute("robot", _routes(route, clock, tours, numbers), None, bound, METHOD)


def _balanced(clock: TourTimes, numbers: list[int], bound: float, route: Route, *, seed: int) -> Tours:
    """Tours, one from each of the starts `numbers`, with the shortest longest tour found."""
    best = shorter_longest(clock, _cut(clock, route, numbers), numbers)
    if clock.stops > SEARCH_UP_TO:
        return best
    low, high = bound, _longest(clock, best, numbers)
    for factor in WIDER:
        if bound * factor >= high:
            break
        found = _fleet_tours(clock, numbers, bound * factor, seed=seed)
        if found is not None:
            best = min(best, found, key=lambda tours: _longest(clock, tours, numbers))
            high = min(high, bound * factor, _longest(clock, best, numbers))
            break
        low = bound * factor
    for _ in range(HALVINGS):
        if low >= high:
            break
        middle = (low + high) / 2
        found = _fleet_tours(clock, numbers, middle, seed=seed)
        if found is None:
            low = middle
            continue
        best = min(best, found, key=lambda tours: _longest(clock, tours, numbers))
        high = min(middle, _longest(clock, best, numbers))
    return best


def _longest(clock: TourTimes, tours: Tours, numbers: list[int]) -> float:
    return max(clock.seconds(tour, k) for tour, k in zip(tours, numbers, strict=True))


def _cut(clock: TourTimes, route: Route, numbers: list[int]) -> Tours:
    """The route's stops in equal stretches, each for the start that reaches it first."""
    stretches = [tuple(stretch.tolist()) for stretch in np.array_split(route.order, len(numbers))]
    likely, tours = clock.likely, []
    for number in numbers:
        nearest = min(stretches, key=lambda stretch: min(likely[clock.stops + number, list(stretch)]))
        stretches.remove(nearest)
        tours.append(nearest)
    return tuple(tours)


def _fleet_tours(clock: TourTimes, numbers: list[int], limit_s: float, *, seed: int) -> Tours | None:
    found = vehicle_tours(
        np.maximum(clock.turned_s, 0.0),
        stops=clock.stops, depots=[clock.stops + k for k in numbers], pause_s=clock.pause_s,
        limit_s=limit_s, closed=clock.closed, seed=seed,
    )  # fmt: skip
    if found is None:
        return None
    left, tours = list(found), []
    for number in numbers:
        own = next((item for item in left if item[0] == clock.stops + number), None)
        if own is not None:
            left.remove(own)
        tours.append(() if own is None else own[1])
    return shorter_longest(clock, filled(clock, tuple(tours), numbers), numbers)


def _shifts(route: Route, settings: Settings) -> DividedRoute:
    assert settings.tour_limit is not None
    key, limit_s = settings.tour_limit
    clock = tour_times(route.selection, np.array([route.start[:2]]), (route.start[2],), closed=True)
    _check_reach(clock, route, key, limit_s)
    bound = least_tours(clock, limit_s)
    tours = _fewest(clock, route, bound, limit_s - SPARE_S, seed=settings.seed)
    rank = {stop: k for k, stop in enumerate(route.order.tolist())}
    tours = tuple(sorted(tours, key=lambda tour: min(rank[stop] for stop in tour)))
    routes = _routes(route, clock, tours, [0] * len(tours))
    return DividedRoute("tour", routes, limit_s, float(bound), METHOD)


def _check_reach(clock: TourTimes, route: Route, key: str, limit_s: float) -> None:
    for number, stop in enumerate(route.order.tolist(), 1):
        needed = clock.seconds((stop,))
        if needed > limit_s - SPARE_S:
            x, y = route.selection.xy[stop]
            raise NegativeResult(
                f"{PARAMETERS[key].flag} {limit_s:g} s: stop {number} at ({x:.2f}, {y:.2f}) needs "
                f"{math.ceil(needed)} s there and back alone; give more time or a closer start"
            )


def _fewest(clock: TourTimes, route: Route, bound: int, limit_s: float, *, seed: int) -> Tours:
    """The fewest tours found within the time."""
    best = _cut_in_time(clock, route, limit_s)
    low, high = bound, len(best)
    while low < high:
        count = (low + high) // 2
        found = _tours_in_time(clock, count, limit_s, seed=seed)
        if found is None:
            low = count + 1
        else:
            best, high = found, count
    return best


def _tours_in_time(clock: TourTimes, count: int, limit_s: float, *, seed: int) -> Tours | None:
    """So many tours or fewer within the time, if any are found."""
    for turning in TURNING:
        found = vehicle_tours(
            clock.estimate(turning),
            stops=clock.stops, depots=[clock.stops] * count, pause_s=clock.pause_s,
            limit_s=limit_s, closed=True, seed=seed,
        )  # fmt: skip
        if found is None:
            return None  # more time for turning finds none either
        tours = shorter_longest(clock, tuple(tour for _, tour in found), [0] * len(found))
        if _longest(clock, tours, [0] * len(tours)) <= limit_s:
            return tours
    return None


def _cut_in_time(clock: TourTimes, route: Route, limit_s: float) -> Tours:
    """The route's stops in stretches, each as long as the time allows."""
    tours: list[Tour] = []
    for stop in route.order.tolist():
        longer = shorter(clock, (*tours[-1], stop), 0) if tours else (stop,)
        if tours and clock.seconds(longer) <= limit_s:
            tours[-1] = longer
        else:
            tours.append((stop,))
    return tuple(tours)


def _routes(whole: Route, clock: TourTimes, tours: Tours, starts: list[int]) -> tuple[Route, ...]:
    """The route of each tour from its start, over the selection of its own stops."""
    cover = cover_of(whole.visibility, demands_of(whole.visibility))
    parts = (_selected(whole.selection, cover, tour) for tour in tours)
    each = zip(parts, tours, starts, strict=True)
    return tuple(_route(whole, *part, clock, tour, start) for part, tour, start in each)


def _route(
    whole: Route, selection: Selection, order: IntArray, clock: TourTimes, tour: Tour, start: int
) -> Route:
    line = [clock.stops + start, *tour]
    legs = [clock.legs.path(a, b) for a, b in pairwise([*line, *line[: int(clock.closed)]])]
    approaches, back = legs[: len(tour)], legs[-1] if clock.closed and len(legs[-1]) > 1 else None
    x, y = clock.points[clock.stops + start].tolist()
    lengths = clock.lengths[np.ix_(line, line)]
    least = tour_bound(lengths, list(range(len(line))), Ends(0, None, clock.closed, ""))
    return Route(
        selection=selection,
        order=order,
        start=(x, y, clock.start_heading[start]),
        start_reason=whole.start_reason,
        approaches=tuple(approaches),
        return_leg=back,
        tour="closed" if clock.closed else "open",
        bound=min(least, sum(map(polyline_length, legs))),
        method=METHOD,
    )


def _selected(whole: Selection, cover: Cover, tour: Tour) -> tuple[Selection, IntArray]:
    """The selection of a tour's stops in the order of choice, and the index in it of each stop."""
    stops = sorted(tour)
    chosen = whole.chosen[stops]
    steps = coverage_steps(cover, chosen)
    part = replace(
        whole, chosen=frozen(chosen, np.int64), coverage_steps=frozen(steps), required=0.0, bound=0,
        method=f"{whole.method}, allocated",
    )  # fmt: skip
    return part, frozen([stops.index(stop) for stop in tour], np.int64)
