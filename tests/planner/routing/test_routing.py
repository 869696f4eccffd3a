"""Paths compared with an independent visibility graph, and tours with every permutation."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise, permutations

import networkx as nx
import numpy as np
import pytest
import shapely

from stopgo.mission.errors import StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import KEPT, Candidates, NavigableSpace, Route, Selection
from stopgo.planner.routing import ROUTERS, route
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility.exact_sight import exact
from tests.faults.sizes import some
from tests.planner.checks import obstacles_of, shape_of
from tests.planner.worlds import box, column, element, hall, planned, two_rooms, wall

RADIUS = 0.35


def selection_at(space: NavigableSpace, xy: np.ndarray) -> Selection:
    """A selection of exactly these positions."""
    zeros = frozen(np.zeros(len(xy)), np.int64)
    found = Candidates(
        space=space,
        xy=frozen(xy),
        room=zeros,
        reason=frozen(zeros + KEPT, np.int64),
        part=zeros,
        strategy="given",
    )
    steps = frozen(np.linspace(0.5, 1, len(xy)))
    return Selection(exact(found), frozen(np.arange(len(xy)), np.int64), steps, 0.9, 1, "given")


# ---- ways ----


def geodesics(floor: FloorPlan, points: np.ndarray, radius: float) -> dict[int, dict[int, float]]:
    """Shortest paths between points that keep `radius` from everything, by a graph over all corners."""
    blocked = shapely.union_all([shape.buffer(radius, quad_segs=16) for shape in obstacles_of(floor)])
    ground = shapely.union_all([shape_of(polygon) for polygon in floor.outline])
    free = ground.difference(blocked)
    nodes = np.concatenate([points, shapely.get_coordinates(free)])
    wide = free.buffer(1e-7)
    shapely.prepare(wide)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    i, j = np.triu_indices(len(nodes), 1)
    lines = shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1))
    ok = shapely.covers(wide, lines)
    graph.add_weighted_edges_from(zip(i[ok], j[ok], shapely.length(lines[ok]), strict=True))
    return {k: nx.single_source_dijkstra_path_length(graph, k) for k in range(len(points))}


@pytest.mark.parametrize("seed", some(range(6), every=2))
def test_a_path_is_as_long_as_the_shortest(seed: int) -> None:
    random = np.random.default_rng(seed)
    blocks = [
        wall(f"w{k}", box(x, y, x + w, y + h))
        for k, (x, y, w, h) in enumerate(
            np.round(random.uniform([1, 1, 0.2, 0.2], [8, 5, 1.5, 1.5], (5, 4)), 2)
        )
    ]
    floor = hall(10, 7, *blocks)
    points = np.array([(0.5, 0.5), (9.5, 6.5), (0.5, 6.5), (9.5, 0.5)])
    ways = paths_between(navigable(floor, Settings(robot_radius=RADIUS)), points)
    shortest = geodesics(floor, points, RADIUS)  # corners cut by 16 chords a quarter
    longest = geodesics(floor, points, RADIUS * 1.0205)
    for a, b in combinations(range(len(points)), 2):
        assert shortest[a][b] - 1e-6 <= ways.lengths[a, b] <= longest[a][b] + 1e-3
        line = ways.path(a, b)
        assert np.allclose(line[[0, -1]], points[[a, b]], atol=1e-9)
        assert np.isclose(np.hypot(*np.diff(line, axis=0).T).sum(), ways.lengths[a, b])


def test_a_path_in_the_open_is_straight() -> None:
    ways = paths_between(navigable(hall(6, 4), Settings()), np.array([(1.0, 1.0), (5.0, 3.0)]))
    assert ways.lengths[0, 1] == pytest.approx(np.hypot(4, 2))
    assert len(ways.path(0, 1)) == 2


def test_a_path_round_one_corner_is_two_tangents_and_an_arc() -> None:
    # Round the corner (3, 2) of a wall: up on its left, then to the right above it.
    floor = hall(6, 6, wall("w", box(3, 0, 6, 2)))
    start, end = np.array([2.0, 0.5]), np.array([5.5, 3.0])
    corner = np.array([3.0, 2.0])
    d1, d2 = np.hypot(*(start - corner)), np.hypot(*(end - corner))
    reach = 2 * np.pi - np.arccos(np.dot(start - corner, end - corner) / d1 / d2)
    arc = reach - np.arccos(RADIUS / d1) - np.arccos(RADIUS / d2)
    true = np.sqrt(d1**2 - RADIUS**2) + np.sqrt(d2**2 - RADIUS**2) + RADIUS * arc
    found = paths_between(navigable(floor, Settings()), np.array([start, end])).lengths[0, 1]
    assert true - 1e-9 <= found <= true + 0.02 * RADIUS


def test_paths_are_symmetric_and_keep_the_triangle_inequality() -> None:
    points = np.array([(0.6, 0.6), (3.3, 3.4), (4.6, 2.0), (7.4, 0.5), (7.4, 3.5), (4.6, 0.5)])
    lengths = paths_between(navigable(floor_with_things(), Settings()), points).lengths
    assert np.isfinite(lengths).all()
    assert np.allclose(lengths, lengths.T)
    assert np.all(lengths[:, None, :] <= lengths[:, :, None] + lengths[None, :, :] + 1e-9)
    assert np.all(lengths >= np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0)) - 1e-9)


def test_a_point_twice_is_at_no_distance_from_itself() -> None:
    points = np.array([(1.0, 1.0), (1.0, 1.0), (5.0, 3.0)])
    ways = paths_between(navigable(hall(6, 4), Settings()), points)
    assert ways.lengths[0, 1] == pytest.approx(0, abs=1e-9)
    assert len(ways.path(0, 1)) >= 1


# ---- tours ----

TOURS = {
    "open": Settings(),
    "closed": Settings(tour="closed"),
    "start": Settings(start=(0.6, 0.6, 90.0)),
    "start, open": Settings(start=(0.6, 0.6, 90.0), tour="open"),
    "end": Settings(end=(7.4, 3.4)),
    "start and end": Settings(start=(0.6, 0.6, 0.0), end=(7.4, 3.4)),
    "start at the end": Settings(start=(7.4, 3.4, 0.0), end=(7.4, 3.4)),
}


def floor_with_things() -> FloorPlan:
    return two_rooms(
        0.8, more=(column("c", 2, 1), column("k", 6, 3), element("s", "stairs", box(5, 0, 6, 1)))
    )


def free_points(count: int, seed: int) -> np.ndarray:
    """Positions clear of everything in `floor_with_things`."""
    random = np.random.default_rng(seed)
    blocked = shapely.union_all([shape.buffer(0.4) for shape in obstacles_of(floor_with_things())])
    points: list[np.ndarray] = []
    while len(points) < count:
        point = np.round(random.uniform((0.4, 0.4), (7.6, 3.6)), 3)
        if not blocked.intersects(shapely.Point(point)):
            points.append(point)
    return np.array(points)


@cache
def space_with_things(settings: Settings) -> NavigableSpace:
    return navigable(floor_with_things(), settings)


@cache
def shortest_of_all(kind: str, count: int, seed: int) -> float:
    """Length of the best route to so many free points by trying every order."""
    settings, xy = TOURS[kind], free_points(count, seed)
    points = [*xy]
    first = last = None
    if settings.start is not None:
        first = len(points)
        points.append(np.array(settings.start[:2]))
    if settings.end is not None:
        last = len(points)
        points.append(np.array(settings.end))
    closed = settings.tour == "closed" or (settings.tour is None and first is not None and last is None)
    lengths = paths_between(space_with_things(settings), np.array(points)).lengths
    paths = np.array(list(permutations(range(len(xy)))))
    begin, end = ([] if stop is None else [np.full((len(paths), 1), stop)] for stop in (first, last))
    paths = np.concatenate([*begin, paths, *end], axis=1)
    if closed:
        paths = np.concatenate([paths, paths[:, :1]], axis=1)
    return float(lengths[paths[:, :-1], paths[:, 1:]].sum(axis=1).min())


def check_route(found: Route, xy: np.ndarray, settings: Settings) -> None:
    assert sorted(found.order.tolist()) == list(range(len(xy)))
    assert np.allclose(found.approaches[0][0], found.start[:2])
    for leg, stop in zip(found.approaches, found.xy, strict=True):
        assert np.allclose(leg[-1], stop)
    for leg, following in pairwise(found.approaches):
        assert np.allclose(leg[-1], following[0], atol=1e-9)
    if settings.start is not None:
        assert np.allclose(found.start[:2], settings.start[:2])
        assert found.start[2] == pytest.approx(np.radians(settings.start[2]))
    if settings.end is not None:
        assert found.return_leg is not None
        assert np.allclose(found.return_leg[-1], settings.end)


@pytest.mark.parametrize("name", sorted(ROUTERS))
@pytest.mark.parametrize("kind", TOURS)
def test_every_router_lies_between_its_bound_and_the_worst(kind: str, name: str) -> None:
    settings = replace(TOURS[kind], router=name)
    for seed, count in enumerate(some((1, 2, 3, 4, 5, 6, 7), every=2)):
        xy = free_points(count, seed)
        found = route(selection_at(space_with_things(settings), xy))
        check_route(found, xy, settings)
        optimum = shortest_of_all(kind, count, seed)
        assert found.bound <= optimum + 1e-6
        assert optimum - 1e-6 <= found.length
        if name == "default":
            assert found.length == pytest.approx(optimum, abs=1e-6), (seed, count)
            assert found.bound == pytest.approx(optimum, abs=1e-6), (seed, count)


def test_a_route_does_not_depend_on_the_order_of_its_stops() -> None:
    xy = free_points(7, 11)
    for settings in TOURS.values():
        lengths = {
            round(route(selection_at(space_with_things(settings), xy[turn])).length, 6)
            for turn in (np.arange(7), np.arange(7)[::-1], np.array([3, 1, 6, 0, 5, 2, 4]))
        }
        assert len(lengths) == 1


def test_a_single_stop_with_a_start_is_driven_to_and_back() -> None:
    space = navigable(hall(6, 4), Settings(start=(1.0, 3.0, 0.0)))
    found = route(selection_at(space, np.array([(5.0, 3.0)])))
    assert found.length == pytest.approx(8.0)
    assert found.return_leg is not None


def test_a_stop_where_the_robot_starts_needs_no_driving() -> None:
    space = navigable(hall(6, 4), Settings(start=(1.0, 3.0, 0.0)))
    found = route(selection_at(space, np.array([(1.0, 3.0)])))
    assert found.length == pytest.approx(0.0, abs=1e-9)


# ---- where a route begins and ends ----


@pytest.mark.parametrize(
    "place",
    [(4.0, 3.9), (0.1, 2.0), (-3.0, 2.0), (100.0, 100.0)],
    ids=["in a wall", "at a wall", "off", "far off"],
)
def test_a_start_where_the_robot_does_not_fit_is_refused(place: tuple[float, float]) -> None:
    with pytest.raises(StopgoError, match=r"--start .*does not fit"):
        planned(two_rooms(0.8), Settings(start=(*place, 0.0)))


@pytest.mark.parametrize("place", [(4.0, 3.9), (-3.0, 2.0)])
def test_an_end_where_the_robot_does_not_fit_is_refused(place: tuple[float, float]) -> None:
    with pytest.raises(StopgoError, match=r"end = .*does not fit"):
        planned(two_rooms(0.8), Settings(end=place))


def test_an_end_in_another_part_is_refused() -> None:
    with pytest.raises(StopgoError, match=r"end = .*another part"):
        planned(two_rooms(0.5), Settings(start=(1, 1, 0), end=(7, 1)))


def test_the_part_that_holds_the_start_is_planned() -> None:
    floor = two_rooms(0.5)
    for x in (1.0, 7.0):
        mission, _ = planned(floor, Settings(start=(x, 2.0, 0.0)))
        assert all((stop.x < 4) == (x < 4) for stop in mission.stops)


def test_without_a_start_the_route_begins_at_the_widest_exterior_door() -> None:

    from tests.planner.worlds import door

    floor = two_rooms(0.9)
    doors = (*floor.openings, door("east", (8.1, 1), (8.1, 2)), door("west", (-0.1, 1), (-0.1, 1.8)))
    walls = tuple(e for e in floor.elements if e.id != "shell")
    mission, _ = planned(replace(floor, openings=doors, elements=walls), Settings(range=2.0))
    assert "east" in mission.start.reason
    first = mission.stops[0]
    assert first.x == max(stop.x for stop in mission.stops)
