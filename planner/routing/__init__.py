"""Selection -> route: the order of the stops, and the ways between them.

A router is a function `(lengths, seed) -> order` over a symmetric matrix of lengths, point 0 first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mission.errors import AnswerIsNo, InputError
from mission.geometry import FloatArray, IntArray, frozen
from mission.planning import NavigableSpace, Route, Selection
from planner.connected import parts_of
from planner.routing.bound import tour_bound
from planner.routing.roadmap import Ways, ways_between
from planner.routing.tour import path_length, shortest_tour
from planner.shapes import local_origin, to_shape

Router = Callable[..., IntArray]
ROUTERS: dict[str, Router] = {"default": shortest_tour}
NAMES = {"default": "2-opt, Or-opt, iterated"}


@dataclass(frozen=True)
class Ends:
    """Where the route begins and ends, as indices into the points (stops first)."""

    first: int | None
    last: int | None
    closed: bool
    reason: str


def route(selection: Selection) -> Route:
    """The shortest tour found over the chosen stops, closed or open, with a proven bound."""
    space = selection.visibility.candidates.space
    settings = space.settings
    if settings.router not in ROUTERS:
        raise InputError(f"router = {settings.router}: unknown; known: {', '.join(ROUTERS)}")
    stops = len(selection.chosen)
    points, ends = _points_and_ends(selection)
    ways = ways_between(space, points)
    if not np.isfinite(ways.lengths).all():
        raise AnswerIsNo(f"{space.floor.name}: the route's end is not connected with its stops")
    lengths = tour_matrix(ways.lengths, ends)
    order = ROUTERS[settings.router](lengths, seed=settings.seed)
    bound = tour_bound(lengths, best=path_length(lengths, order)) - _offset(lengths, ways.lengths)
    sequence = _sequence(order, ends, len(points))
    return _assembled(selection, points, ways, sequence, ends, stops, max(0.0, bound))


def _points_and_ends(selection: Selection) -> tuple[FloatArray, Ends]:
    """The stops, then the start and the end where they are given."""
    settings = selection.visibility.candidates.space.settings
    points, first, last = [*selection.xy], None, None
    if settings.start is not None:
        first = len(points)
        points.append(np.array(settings.start[:2]))
    if settings.end is not None:
        _check_end(selection)
        last = len(points)
        points.append(np.array(settings.end))
    closed = settings.tour == "closed" or (
        settings.tour is None and settings.start is not None and last is None
    )
    if first is not None:
        return np.array(points), Ends(first, last, closed, "given by --start")
    nearest, reason = _stop_at_door(selection)
    return np.array(points), Ends(nearest, last, closed, reason)


def _check_end(selection: Selection) -> None:
    candidates = selection.visibility.candidates
    space, end = candidates.space, candidates.space.settings.end
    assert end is not None
    origin = local_origin(space.floor)
    parts = parts_of(to_shape(space.drive_area, origin), space.gaps - origin)
    found = int(parts.part_at(np.array([end]) - origin)[0])
    if found != candidates.chosen_part:
        why = "the robot does not fit there" if found < 0 else "it is in another part of the floor"
        raise InputError(f"end = {end[0]:g},{end[1]:g}: {why}; choose a place clear of walls and floor edges")


def _stop_at_door(selection: Selection) -> tuple[int | None, str]:
    """The stop nearest the widest exterior door of the planned rooms, if there is one."""
    candidates = selection.visibility.candidates
    space = candidates.space
    doors = [item for item in space.openings if item.why.startswith("exterior")]
    entered = {space.rooms[k].room for k in candidates.room[candidates.kept]} - {None}
    doors = [item for item in doors if not space.floor.rooms or entered & set(item.rooms)]
    if not doors:
        return None, "the tour's best end"
    widest = max(doors, key=lambda item: (round(item.clear_width, 6), item.opening.id))
    middle = widest.opening.line.mean(axis=0)
    away = np.round(np.hypot(*(selection.xy - middle).T), 6)
    return int(np.argmin(away)), f"the stop nearest the widest exterior door, {widest.opening.id}"


def tour_matrix(lengths: FloatArray, ends: Ends) -> FloatArray:
    """Lengths for a closed tour; an open path gets one more point between its last and its first.

    That point is as far as everything together from all but the ends, which makes it join them.
    """
    if ends.closed:
        return lengths
    n = len(lengths)
    far = float(lengths.sum()) + 1.0
    extra = np.zeros(n) if ends.first is None and ends.last is None else np.full(n, far)
    if ends.first is not None and ends.last is None:
        extra[:] = far
        extra[ends.first] = 0.0
    elif ends.last is not None:
        extra[ends.last] = 0.0
        if ends.first is not None:
            extra[ends.first] = 0.0
    return np.block([[lengths, extra[:, None]], [extra[None, :], np.zeros((1, 1))]])


def _offset(matrix: FloatArray, lengths: FloatArray) -> float:
    """What the extra point adds to every sensible tour: one far edge if only one end is fixed."""
    if len(matrix) == len(lengths):
        return 0.0
    extra = matrix[-1, :-1]
    return float(extra.max()) if np.count_nonzero(extra == 0.0) == 1 and len(extra) > 1 else 0.0


def _sequence(order: IntArray, ends: Ends, points: int) -> list[int]:
    """Points in the order of driving: from the first end, without the extra point."""
    tour = [int(k) for k in order]
    if points in tour:
        at = tour.index(points)
        path = tour[at + 1 :] + tour[:at]
        backwards = path[-1] == ends.first or path[0] == ends.last
        free = ends.first is None and ends.last is None
        return path[::-1] if backwards or (free and path[-1] < path[0]) else path
    if ends.first is not None:
        at = tour.index(ends.first)
        return tour[at:] + tour[:at]
    return tour


def _assembled(
    selection: Selection,
    points: FloatArray,
    ways: Ways,
    sequence: list[int],
    ends: Ends,
    stops: int,
    bound: float,
) -> Route:
    space = selection.visibility.candidates.space
    visited = [k for k in sequence if k < stops]
    places = [sequence[0], *visited[1 if sequence[0] < stops else 0 :]]
    approaches = [ways.way(a, b) for a, b in itertools.pairwise(places)]
    if sequence[0] < stops:
        approaches.insert(0, frozen(points[sequence[:1]]))
    back = places[0] if ends.closed else (ends.last if ends.last is not None else None)
    return_leg = ways.way(places[-1], back) if back is not None and len(places) > 1 else None
    return Route(
        selection=selection,
        order=frozen(visited, np.int64),
        start=(float(points[sequence[0]][0]), float(points[sequence[0]][1]), _heading(space, approaches)),
        start_reason=ends.reason,
        approaches=tuple(approaches),
        return_leg=return_leg,
        tour="closed" if ends.closed else "open",
        bound=bound,
        method=NAMES[space.settings.router],
    )


def _heading(space: NavigableSpace, approaches: list[FloatArray]) -> float:
    """Heading at the start in radians: as given, else along the first leg."""
    if space.settings.start is not None:
        return math.radians(space.settings.start[2])
    for leg in approaches:
        if len(leg) > 1:
            return float(np.arctan2(*(leg[1] - leg[0])[::-1]))
    return 0.0


__all__ = ["ROUTERS", "Router", "route", "tour_matrix"]
