"""The paper's grids: legs with clearance, joined at doors, never shorter than the exact paths."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from stopgo.mission.errors import NegativeResult
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.planner.routing import route
from stopgo.planner.routing.assemble import check_legs
from stopgo.planner.routing.grid_graph import RESOLUTIONS, grid_paths, paths_on_grids
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.space.navigable import navigable
from tests.planner.checks import obstacles_of
from tests.planner.routing.test_routing import floor_with_things, free_points, selection_at, space_with_things
from tests.planner.worlds import box, column, door, floor_of, hall, room, shell, two_rooms, wall

GRID = Settings(graph="grid")


def room_in_room() -> FloorPlan:
    """A cell of 3 × 3 m with a door to the right, in the middle of a room of 10 × 8 m."""
    outer = box(0, 0, 10, 8)
    return floor_of(
        outer,
        rooms=(room("outer", outer), room("cell", box(3, 3, 6, 6))),
        openings=(door("d", (6.05, 4), (6.05, 5)),),
        elements=(
            shell(0, 0, 10, 8),
            wall(
                "cell",
                Polygon.of(
                    [
                        (6.1, 4),
                        (6, 4),
                        (6, 3),
                        (3, 3),
                        (3, 6),
                        (6, 6),
                        (6, 5),
                        (6.1, 5),
                        (6.1, 6.1),
                        (2.9, 6.1),
                        (2.9, 2.9),
                        (6.1, 2.9),
                    ]
                ),
            ),
        ),
    )


@pytest.mark.parametrize("floor", [floor_with_things(), two_rooms(0.9), hall(7, 5, column("c", 3, 2))])
def test_a_path_over_grids_is_in_the_clear_and_never_shorter_than_the_exact_one(floor: FloorPlan) -> None:
    space = navigable(floor, GRID)
    points = np.array([(0.6, 0.6), (3.2, 3.3), (0.6, 3.4), (5.2, 3.3), (5.4, 1.5)])
    exact, ways = paths_between(space, points), grid_paths(space, points)
    assert np.isfinite(ways.lengths).all()
    assert np.all(ways.lengths >= exact.lengths - 1e-9)
    assert np.allclose(ways.lengths, ways.lengths.T)
    things = shapely.union_all(obstacles_of(floor))
    for a in range(5):
        for b in range(5):
            line = ways.path(a, b)
            assert np.allclose(line[0], points[a]) and np.allclose(line[-1], points[b])
            assert np.isclose(np.hypot(*np.diff(line, axis=0).T).sum(), ways.lengths[a, b])
            shape = shapely.LineString(line) if len(line) > 1 else shapely.Point(line[0])
            assert shape.distance(things) >= 0.35 - 1e-6


def test_in_an_open_room_a_path_is_straight_and_diagonal_steps() -> None:
    # Nodes stand at whole metres; from (1, 1) to (5, 3) it is two diagonals and two straight steps.
    space = navigable(hall(6, 4), GRID)
    ways = grid_paths(space, np.array([(1.0, 1.0), (5.0, 3.0)]))
    assert ways.lengths[0, 1] == pytest.approx(2 + 2 * np.sqrt(2))


def test_a_room_in_a_room_is_entered_by_its_own_door() -> None:
    space = navigable(room_in_room(), GRID)
    points = np.array([(4.5, 4.5), (1.0, 4.5), (9.0, 7.0)])
    ways = grid_paths(space, points)
    assert np.isfinite(ways.lengths).all()
    line = shapely.LineString(ways.path(0, 1))
    assert line.intersects(shapely.LineString([(6.05, 4), (6.05, 5)]))
    assert ways.lengths[0, 1] > 1.6 + 3 + 6


def test_the_grid_is_refined_until_a_stop_has_a_node_near() -> None:
    floor, point = hall(6, 4), np.array([(1.45, 1.45), (4.0, 2.0)])
    for near in (0.7, 0.4, 0.1):
        space = navigable(floor, Settings(graph="grid", max_err_dist=near))
        ways = grid_paths(space, point)
        first = ways.path(0, 1)[1]
        assert np.hypot(*(first - point[0])) <= near


def test_the_grid_is_refined_until_it_is_dense_enough() -> None:
    points = np.array([(1.0, 1.0), (4.0, 2.0)])
    nodes = [
        len(grid_paths(navigable(hall(6, 4), Settings(graph="grid", den_grid_min=least)), points).xy)
        for least in (0.5, 2.0, 10.0)
    ]
    free = (6 - 0.7) * (4 - 0.7)
    for count, least in zip(nodes, (0.5, 2.0, 10.0), strict=True):
        assert count >= least * free
    assert nodes == sorted(set(nodes))


def test_where_the_finest_grid_fails_the_message_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    # A passage 3 m deep and 0.9 m wide, drawn as one room's: no node of 1 m stands in it.
    monkeypatch.setattr("stopgo.planner.routing.grid_graph.RESOLUTIONS", RESOLUTIONS[:1])
    space = navigable(two_rooms(0.9, thick=3.0, at=1.7, with_door=False), GRID)
    points = np.array([(1.0, 1.0), (7.0, 3.0)])
    with pytest.raises(NegativeResult, match=r"does not connect the stop at .*--graph exact"):
        grid_paths(space, points)
    assert np.isinf(paths_on_grids(space, points, resolutions=(1.0,)).lengths[0, 1])
    assert np.isfinite(paths_between(space, points).lengths).all()


def test_an_opening_just_as_wide_as_the_robot_joins_grids() -> None:
    space = navigable(two_rooms(0.7), GRID)
    assert np.isfinite(grid_paths(space, np.array([(1.0, 1.0), (7.0, 3.0)])).lengths).all()


@pytest.mark.parametrize("settings", [GRID, Settings(graph="grid", start=(0.6, 0.6, 0.0), router="aco")])
def test_a_route_over_grids_ends_its_legs_at_the_stops(settings: Settings) -> None:
    xy = free_points(6, 3)
    found = route(selection_at(space_with_things(settings), xy))
    check_legs(found)
    for leg, stop in zip(found.approaches, found.xy, strict=True):
        assert np.allclose(leg[-1], stop, atol=1e-9)
    assert found.bound <= found.length
    assert "--graph grid" in found.method
