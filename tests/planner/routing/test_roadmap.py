"""The exact roadmap against a graph over every corner, and what its reduction may not change."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
import shapely

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.shapes import local_origin, snapped, to_shape
from stopgo.planner.routing import roadmap, tangents
from stopgo.planner.routing.paths import Paths
from stopgo.planner.routing.roadmap import Corners, outward_corners, paths_between
from stopgo.planner.space.navigable import navigable
from tests.faults.sizes import some
from tests.planner.worlds import PAPER, box, column, element, hall, shared, two_rooms, wall

SETTINGS = Settings(robot_radius=0.3, edge=0.3)


@pytest.fixture(autouse=True)
def _pieces_found_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Find the pieces between corners again for each search, as tests compare ways to find them."""
    monkeypatch.setattr(roadmap, "corner_pieces", vars(roadmap.corner_pieces)["__wrapped__"])


def random_floor(seed: int) -> FloorPlan:
    """A hall of 9 × 7 m with up to seven things in it, some of them touching."""
    random = np.random.default_rng(seed)
    things = []
    for k, (x, y, w, h) in enumerate(random.uniform((1, 1, 0.2, 0.2), (7, 5.5, 1.5, 1.2), (5, 4)).round(1)):
        things.append(wall(f"w{k}", box(x, y, x + w, y + h)))
    things += [column(f"c{k}", *random.uniform((1, 1), (8, 6)).round(1)) for k in range(2)]
    return hall(9, 7, *things)


def free_points(space: NavigableSpace, count: int, seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    area = to_shape(space.drive_area, np.zeros(2)).buffer(-0.01)
    largest = max(shapely.get_parts(area), key=shapely.area)
    points = random.uniform((0, 0), (9, 7), (400, 2))
    return points[shapely.contains_xy(largest, *points.T)][:count]


def shortest(space: NavigableSpace, points: np.ndarray) -> np.ndarray:
    """Lengths between points over all pairs of points and corners that the drive area covers."""
    area = snapped(to_shape(space.drive_area, local_origin(space.floor)))
    wide = area.buffer(2e-6)  # edges along its own edge are in it, despite float noise
    shapely.prepare(wide)
    local = points - local_origin(space.floor)
    nodes = np.concatenate([local, np.unique(shapely.get_coordinates(area), axis=0)])
    i, j = np.triu_indices(len(nodes), 1)
    lines = shapely.linestrings(np.stack([nodes[i], nodes[j]], axis=1))
    seen = shapely.covers(wide, lines)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(nodes)))
    edges = zip(i[seen], j[seen], shapely.length(lines[seen]), strict=True)
    graph.add_weighted_edges_from((int(a), int(b), float(w)) for a, b, w in edges)
    from_each = [nx.single_source_dijkstra_path_length(graph, k) for k in range(len(points))]
    return np.array([[found.get(k, np.inf) for k in range(len(points))] for found in from_each])


@pytest.mark.parametrize("seed", some(range(8), every=2))
def test_paths_are_as_short_as_over_every_corner(seed: int) -> None:
    space = replace(navigable(random_floor(seed), SETTINGS), gaps=np.empty((0, 2, 2)))
    points = free_points(space, 6, seed)
    found = paths_between(space, points)
    assert np.allclose(found.lengths, shortest(space, points), atol=1e-4)  # slits below 2 µm apart
    for a in range(len(points)):
        for b in range(len(points)):
            line = found.path(a, b)
            assert np.allclose(line[[0, -1]], points[[a, b]])
            assert np.isclose(np.hypot(*np.diff(line, axis=0).T).sum(), found.lengths[a, b])


def look_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let paths pass by corners in any direction: all nodes look all round, and keep whatever they see."""

    def without_sides(space: NavigableSpace) -> Corners:
        corners = outward_corners(space)
        return replace(corners, sides=np.zeros_like(corners.sides))

    monkeypatch.setattr(roadmap, "outward_corners", without_sides)


@pytest.mark.parametrize("seed", range(8, 14))
def test_edges_that_cut_corners_are_not_missed(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    space = navigable(random_floor(seed), SETTINGS)
    points = free_points(space, 8, seed)
    reduced = paths_between(space, points)
    look_everywhere(monkeypatch)
    full = paths_between(space, points)
    assert np.array_equal(reduced.lengths, full.lengths)


def test_a_path_bends_at_outward_corners_only() -> None:
    space = navigable(random_floor(3), SETTINGS)
    points = free_points(space, 6, 1)
    ways = paths_between(space, points)
    corners = {tuple(xy) for xy in (outward_corners(space).xy + local_origin(space.floor)).round(6)}
    bends = np.concatenate([ways.path(a, b)[1:-1] for a in range(6) for b in range(6)])
    assert len(bends)
    assert {tuple(xy) for xy in bends.round(6)} <= corners


def test_an_empty_hall_has_no_corner_to_bend_at() -> None:
    assert len(outward_corners(navigable(hall(6, 4), SETTINGS)).xy) == 0


def test_points_in_rooms_that_are_not_connected_have_no_path() -> None:
    lengths = paths_between(navigable(two_rooms(0.5), SETTINGS), np.array([(1.0, 1.0), (7.0, 1.0)])).lengths
    assert np.isinf(lengths[0, 1])


def columned(across: int) -> NavigableSpace:
    """A hall with across × across round columns, one every 4 m."""
    angles = np.arange(30) * (2 * np.pi / 30)
    ring = np.c_[np.cos(angles), np.sin(angles)] * 0.3
    places = [(4.0 * i + 2, 4.0 * k + 2) for i in range(across) for k in range(across)]
    columns = [element(f"c{k}", "columns", Polygon.of(ring + xy)) for k, xy in enumerate(places)]
    return navigable(hall(4.0 * across, 4.0 * across, *columns), SETTINGS)


def test_among_round_columns_few_pairs_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    space = columned(3)
    points = np.array([(0.5, 0.5), (11.5, 11.5), (4.0, 8.0)])
    few, looked_at = counted(space, points, monkeypatch)
    look_everywhere(monkeypatch)
    full, everywhere = counted(space, points, monkeypatch)
    assert np.array_equal(few.lengths, full.lengths)
    assert looked_at < 0.15 * everywhere


def counted(space: NavigableSpace, points: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> tuple[Paths, int]:
    """The ways, and how many pairs of nodes were looked at."""
    pairs: list[int] = []
    tangent = roadmap._tangent

    def counting(edges: np.ndarray, *others: np.ndarray) -> np.ndarray:
        pairs.append(len(edges))
        return tangent(edges, *others)

    with monkeypatch.context() as context:
        context.setattr(roadmap, "_tangent", counting)
        return paths_between(space, points), sum(pairs)


def test_pieces_are_the_same_with_little_room_and_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    space = columned(2)
    points = np.array([(0.5, 0.5), (7.5, 7.5)])
    whole = paths_between(space, points)
    monkeypatch.setattr(tangents, "ROOM", -3)
    little = paths_between(space, points)
    monkeypatch.setattr(tangents, "compiled", lambda *_, **__: None)
    interpreted = paths_between(space, points)
    for other in (little, interpreted):
        assert np.array_equal(whole.lengths, other.lengths)
        assert np.array_equal(whole.graph.indices, other.graph.indices)


@pytest.mark.parametrize("name", ["layered/fzk-haus-eg.dxf", "layered/duplex-l1.dxf", *PAPER])
def test_the_reduction_keeps_every_length_on_a_real_floor(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    space = navigable(shared(name), Settings())
    area = to_shape(space.drive_area, np.zeros(2))
    points = np.array([part.representative_point().coords[0] for part in shapely.get_parts(area)])
    reduced = paths_between(space, points)
    look_everywhere(monkeypatch)
    assert np.array_equal(reduced.lengths, paths_between(space, points).lengths)
