"""Selection -> route: the order of the stops, and the paths between them.

A router is a function `(lengths, seed) -> order` over a symmetric matrix of lengths in metres. A graph is
a function `(space, points) -> Paths`; `Paths` holds the shortest paths between the points.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stopgo.mission.console.plugins import Variant, variant
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.geometry import FloatArray, IntArray, frozen, polyline_length
from stopgo.mission.stages import Candidates, NavigableSpace, Route, Selection
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.routing.colony import ant_colony
from stopgo.planner.routing.grid_graph import grid_paths
from stopgo.planner.routing.legs import Legs, SomeLegs
from stopgo.planner.routing.nearby_bound import nearby_bound
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.paths import Paths
from stopgo.planner.routing.proof import tour_proof
from stopgo.planner.routing.roadmap import nearby_paths_between, paths_between
from stopgo.planner.routing.tour import NANOMETRES, canonical, nanometres, shortest_over, shortest_tour
from stopgo.planner.space.reach import reach_of

Router = Callable[..., IntArray]
ROUTERS: dict[str, Router] = {"default": shortest_tour, "aco": ant_colony}
METHODS = {"default": "2-opt, Or-opt, iterated", "aco": "ant colony"}
Graph = Callable[[NavigableSpace, FloatArray], Paths]
GRAPHS: dict[str, Graph] = {"exact": paths_between, "grid": grid_paths}


ALL_PAIRS_UP_TO = 500
"""Points up to which the paths between all pairs are found first."""
BOUNDS_UP_TO = 2000
"""Points up to which the bound of a tour comes from lower bounds on the lengths of all pairs.

At 700 to 1 400 points it is 0 to 3 % higher than that of `nearby_bound`, at about the same cost.
"""


@dataclass(frozen=True)
class Ends:
    """Start and end of the route, as indices into the points (stops first)."""

    first: int | None
    last: int | None
    closed: bool
    reason: str


def route(selection: Selection) -> Route:
    """The shortest tour found over the chosen stops, closed or open, with a proven lower bound.

    The bound holds for the paths of the graph. The paper's grid has detours, so exact paths may be
    shorter; the method says so.
    """
    space = selection.space
    settings = space.settings
    router = variant("router", settings.router, ROUTERS)
    points, ends = points_and_ends(selection)
    if len(points) > ALL_PAIRS_UP_TO and (settings.router, settings.graph) == ("default", "exact"):
        return _route_over_nearby(selection, points, ends)
    legs = legs_between(space, points)
    if not np.isfinite(legs.lengths).all():
        raise _not_connected(selection)
    sequence, bound, method = _ordered(legs.lengths, ends, router, seed=settings.seed)
    method += "" if settings.graph == "exact" else f", over the paths of --graph {settings.graph}"
    return assembled(selection, points, legs, sequence, ends, bound, method)


def _route_over_nearby(selection: Selection, points: FloatArray, ends: Ends) -> Route:
    """The route over many points, of which only near pairs have exact lengths.

    The tour is searched over upper bounds on all other lengths, so that it is no longer than it seems. Its
    own lengths are then exact.
    """
    paths = nearby_paths_between(selection.space, points)
    if not paths.connected:
        raise _not_connected(selection)
    stops, others = selection.chosen, np.arange(len(selection.chosen), len(points) + (not ends.closed))
    by_place = np.concatenate([[0], 1 + np.argsort(stops[1:]), others]).astype(np.int64)
    cost = nanometres(_most_by_place(paths, by_place, ends), in_place=True)
    order = canonical(by_place[shortest_over(cost, seed=selection.settings.seed)])
    del cost
    sequence = _sequence(order, ends, len(points))
    return _along_nearby(selection, points, sequence, ends, METHODS["default"], paths)


def _along_nearby(
    selection: Selection,
    points: FloatArray,
    sequence: list[int],
    ends: Ends,
    method: str,
    paths: NearbyPaths,
) -> Route:
    """The route over many points in a given order, whose own lengths are made exact."""
    legs = paths.learn(np.stack([sequence, np.roll(sequence, -1)], axis=1))
    if len(points) <= BOUNDS_UP_TO:
        bound = tour_bound(paths.at_least(), sequence, ends)
    else:
        bound = _bound_over_nearby(paths, float(legs.sum() if ends.closed else legs[:-1].sum()), ends)
    return assembled(selection, points, paths, sequence, ends, bound, method)


def route_along(
    selection: Selection,
    points: FloatArray,
    sequence: list[int],
    ends: Ends,
    method: str,
    legs: Legs | SomeLegs | None = None,
) -> Route:
    """The route over points (stops first) in a given order, with a lower bound on all orders.

    Its paths are `legs`, or else those of the graph through these points alone.
    """
    if legs is None and len(points) > ALL_PAIRS_UP_TO and selection.settings.graph == "exact":
        paths = nearby_paths_between(selection.space, points)
        return _along_nearby(selection, points, sequence, ends, method, paths)
    legs = legs or legs_between(selection.space, points)
    bound = tour_bound(legs.lengths, sequence, ends)
    return assembled(selection, points, legs, sequence, ends, bound, method)


def _most_by_place(paths: NearbyPaths, by_place: IntArray, ends: Ends) -> FloatArray:
    """The matrix of a tour over upper bounds: neighbours are near in memory too, which is quicker.

    It is made in one piece, as that of thousands of stops is a large part of the memory.
    """
    n = paths.points
    matrix = np.empty((len(by_place), len(by_place)))
    lengths = paths.at_most(by_place[:n], out=matrix[:n, :n])
    if not ends.closed:
        matrix[:n, n] = matrix[n, :n] = _to_extra_point(lengths, ends)[by_place[:n]]
        matrix[n, n] = 0.0
    return matrix


def _bound_over_nearby(paths: NearbyPaths, length: float, ends: Ends) -> float:
    """Lower bound in metres on a route between these ends over all points; one is as long as given."""
    if ends.closed:
        return max(0.0, nearby_bound(paths, None, best=round(length * NANOMETRES)) / NANOMETRES)
    fixed = [end for end in (ends.first, ends.last) if end is not None]
    far = float(np.ceil(3 * paths.farthest) + 1)
    last = np.full(paths.points, far if fixed else 0.0)
    last[fixed] = 0.0
    extra = far if len(fixed) == 1 else 0.0
    best = round((length + extra) * NANOMETRES)
    return max(0.0, nearby_bound(paths, last, best=best) / NANOMETRES - extra)


def _not_connected(selection: Selection) -> NegativeResult:
    return NegativeResult(f"{selection.space.floor.name}: the route's end is not connected with its stops")


def legs_between(space: NavigableSpace, points: FloatArray, *, trees: bool = False) -> Legs:
    """The paths between all pairs of points (n, 2), by the graph of the settings.

    With `trees` many paths of the exact graph are to be followed.
    """
    graph = variant("graph", space.settings.graph, GRAPHS)
    more = {"trees": trees} if graph.name == "exact" else {}
    return Legs(graph, graph.of_kind(graph.called(space, points, **more), Paths), points)


def points_and_ends(selection: Selection) -> tuple[FloatArray, Ends]:
    """The stops, then the start and the end if they are given."""
    settings = selection.settings
    points, first, last = [*selection.xy], None, None
    if settings.start is not None:
        first = len(points)
        points.append(np.array(settings.start[:2]))
    if settings.end is not None:
        check_position(selection.candidates, "end", settings.end)
        last = len(points)
        points.append(np.array(settings.end))
    closed = settings.tour == "closed" or (
        settings.tour is None and settings.start is not None and last is None
    )
    if first is not None:
        return np.array(points), Ends(first, last, closed, "given by --start")
    nearest, reason = _stop_at_door(selection)
    return np.array(points), Ends(nearest, last, closed, reason)


def check_position(candidates: Candidates, name: str, position: tuple[float, ...]) -> None:
    """Refuse a position where the robot does not fit, or in another part of the floor than the plan."""
    space = candidates.space
    x, y = position[:2]
    found = int(reach_of(space).part_at(np.array([[x, y]]) - local_origin(space.floor))[0])
    if found != candidates.chosen_part:
        problem = "the robot does not fit there" if found < 0 else "it is in another part of the floor"
        raise InputError(f"{name} = {x:g},{y:g}: {problem}; choose a position clear of walls and floor edges")


def _stop_at_door(selection: Selection) -> tuple[int | None, str]:
    """The stop nearest the widest exterior door of the planned rooms, if there is one."""
    rank, reason = rank_at_door(selection.candidates, selection.chosen)
    return (None if rank is None else int(np.argmin(rank))), reason


def rank_at_door(candidates: Candidates, rows: IntArray) -> tuple[IntArray | None, str]:
    """Ranks of these rows by distance to the widest exterior door, 0 the nearest (n,); and the reason.

    Rows in the door's room come first, because a stop behind a wall may be nearer. The ranks are None if
    there is no exterior door.
    """
    space = candidates.space
    doors = [item for item in space.openings if item.why.startswith("exterior")]
    entered = {space.rooms[k].room for k in candidates.room[candidates.kept]} - {None}
    doors = [item for item in doors if not space.floor.rooms or entered & set(item.rooms)]
    if not doors:
        return None, "the tour's best end"
    widest = max(doors, key=lambda item: (round(item.clear_width, 6), item.opening.id))
    at = candidates.kept[rows]
    away = np.round(np.hypot(*(candidates.xy[at] - widest.opening.line.mean(axis=0)).T), 6)
    behind = np.array([space.rooms[k].room in set(widest.rooms) - {None} for k in candidates.room[at]])
    rank = np.empty(len(rows), dtype=np.int64)
    rank[np.lexsort((away, ~behind))] = np.arange(len(rows))
    return rank, f"the stop nearest the widest exterior door, {widest.opening.id}"


def _ordered(
    lengths: FloatArray, ends: Ends, router: Variant[Router], *, seed: int
) -> tuple[list[int], float, str]:
    """The points in the order of driving, a lower bound on the length, and the method.

    The default router takes the proof's tour if it is shorter; other routers keep their own tour.
    """
    matrix = tour_matrix(lengths, ends)
    order = router.indices(router.called(matrix, seed=seed), "order", length=len(matrix), below=len(matrix))
    if len(set(order.tolist())) < len(order):
        raise router.wrong("route visits a point twice")
    proof = tour_proof(nanometres(matrix), order, improve=router.name == "default")
    bound = proof.bound / NANOMETRES - far_edge(lengths, ends)
    method = METHODS.get(router.name, router.name) + (", proved optimal" if proof.closed else "")
    return _sequence(proof.order, ends, len(lengths)), max(0.0, bound), method


def tour_bound(lengths: FloatArray, sequence: list[int], ends: Ends) -> float:
    """Lower bound in metres on a route between these ends over all points; `sequence` is one such route."""
    points, extra, cost = len(lengths), far_edge(lengths, ends), nanometres(tour_matrix(lengths, ends))
    del lengths  # of thousands of points this is a large part of the memory
    tour = [*sequence, *([] if len(cost) == points else [points])]
    proof = tour_proof(cost, np.array(tour, dtype=np.int64), improve=False)
    return max(0.0, proof.bound / NANOMETRES - extra)


def tour_matrix(lengths: FloatArray, ends: Ends) -> FloatArray:
    """Lengths for a closed tour; an open path gets one more point between its last and its first.

    That point is at distance 0 from each point where the path may end, and far from all others: farther than
    any exchange of two edges can gain. So a shortest tour is a shortest path.
    """
    if ends.closed:
        return lengths
    extra = _to_extra_point(lengths, ends)
    return np.block([[lengths, extra[:, None]], [extra[None, :], np.zeros((1, 1))]])


def _to_extra_point(lengths: FloatArray, ends: Ends) -> FloatArray:
    """Length from each point to the extra one (points,)."""
    fixed = [end for end in (ends.first, ends.last) if end is not None]
    extra = np.full(len(lengths), _far(lengths) if fixed else 0.0)
    extra[fixed] = 0.0
    return extra


def far_edge(lengths: FloatArray, ends: Ends) -> float:
    """Length that the extra point adds to a shortest tour: one far edge if exactly one end is fixed."""
    one_end = not ends.closed and (ends.first is None) != (ends.last is None)
    return _far(lengths) if one_end and len(lengths) > 1 else 0.0


def _far(lengths: FloatArray) -> float:
    return float(np.ceil(3 * lengths.max()) + 1)


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


def assembled(
    selection: Selection,
    points: FloatArray,
    legs: Legs | SomeLegs | NearbyPaths,
    sequence: list[int],
    ends: Ends,
    bound: float,
    method: str,
) -> Route:
    """The route over points (stops first) in a given order, with its lower bound."""
    stops = len(selection.chosen)
    visited = [k for k in sequence if k < stops]
    reached = [sequence[0], *visited[1 if sequence[0] < stops else 0 :]]
    approaches = [legs.path(a, b) for a, b in itertools.pairwise(reached)]
    if sequence[0] < stops:
        approaches.insert(0, frozen(points[sequence[:1]]))
    back = reached[0] if ends.closed else ends.last
    return_leg = None if back is None or back == reached[-1] else legs.path(reached[-1], back)
    driven = sum(polyline_length(leg) for leg in (*approaches, *([] if return_leg is None else [return_leg])))
    space = selection.space
    return Route(
        selection=selection,
        order=frozen(visited, np.int64),
        start=(float(points[sequence[0]][0]), float(points[sequence[0]][1]), _heading(space, approaches)),
        start_reason=ends.reason,
        approaches=tuple(approaches),
        return_leg=return_leg,
        tour="closed" if ends.closed else "open",
        bound=min(bound, driven),  # lengths may differ in the last digit by the order of summing
        method=method,
    )


def _heading(space: NavigableSpace, approaches: list[FloatArray]) -> float:
    """Heading at the start in radians: as given, else along the first leg."""
    if space.settings.start is not None:
        return math.radians(space.settings.start[2])
    for leg in approaches:
        if len(leg) > 1:
            return float(np.arctan2(*(leg[1] - leg[0])[::-1]))
    return 0.0


__all__ = [
    "GRAPHS",
    "ROUTERS",
    "Ends",
    "Graph",
    "Router",
    "assembled",
    "check_position",
    "legs_between",
    "points_and_ends",
    "rank_at_door",
    "route",
    "route_along",
    "tour_bound",
    "tour_matrix",
]
