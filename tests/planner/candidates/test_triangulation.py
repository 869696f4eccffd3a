"""Triangulation candidates: counted on paper, unchanged by the drawing's angle, unharmed by bad rooms."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import DROP_REASONS, KEPT, SLIVER, TOO_SMALL, Candidates
from stopgo.planner.candidates import candidates
from stopgo.planner.candidates.triangulation import (
    LEAST_ANGLE,
    DrawnBoundary,
    delaunay,
    distinct,
    is_round,
    seeds_of,
    triangle_reasons,
    triangulated,
    voronoi_points,
)
from stopgo.planner.geometry.shapes import segments_of
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.stop_feasibility import StopFeasibility
from tests.faults.sizes import size
from tests.planner.worlds import (
    SHARED,
    box,
    column,
    element,
    floor_of,
    hall,
    moved,
    room,
    shell,
    shifted,
    turned,
    two_rooms,
    wall,
)


def placed(floor: FloorPlan, **given: object) -> Candidates:
    return candidates(navigable(floor, Settings(candidates="triangulation", register=False, **given)))  # type: ignore[arg-type]


def round_column(x: float, y: float, radius: float = 0.3) -> Polygon:
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return Polygon.of(np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1))


def test_the_least_angle_is_the_paper_s() -> None:
    assert math.degrees(LEAST_ANGLE) == pytest.approx(9.594, abs=5e-4)


def test_a_square_has_its_middle_and_four_triangles() -> None:
    """Corners (0, 0) to (6, 6): one Voronoi point (3, 3), and triangles with middles 1 m from the sides."""
    square = shapely.box(0, 0, 6, 6)
    corners = np.array([[0.0, 0], [6, 0], [6, 6], [0, 6]])
    points, reason = triangulated(corners, square, l_min=1.0)
    found = {(round(x, 3), round(y, 3)) for x, y in points[reason == KEPT]}
    assert found == {(3, 3), (3, 1), (5, 3), (3, 5), (1, 3)}


def test_long_segments_are_split_evenly() -> None:
    nothing = DrawnBoundary(shapely.linestrings(np.empty((0, 2, 2))), np.empty((0, 2)))
    seeds = distinct(seeds_of(shapely.box(0, 0, 5, 2), nothing, d_max=2.0))
    assert sorted(x for x, y in seeds if y == 0) == pytest.approx([0, 1.667, 3.333, 5])
    assert sorted(y for x, y in seeds if x == 0) == pytest.approx([0, 2])


def test_triangles_are_dropped_by_side_and_by_angle() -> None:
    fair = [[0, 0], [3, 0], [0, 3]]
    small = [[0, 0], [0.9, 0], [0, 3]]
    sliver = [[0, 0], [20, 0], [10, 1.6]]  # its angle at the ends is 9.09°
    thick = [[0, 0], [20, 0], [10, 1.7]]  # 9.65°
    reasons = triangle_reasons(np.array([fair, small, sliver, thick], dtype=float), l_min=1.0)
    assert reasons.tolist() == [KEPT, TOO_SMALL, SLIVER, KEPT]


def test_dropped_triangles_say_why() -> None:
    found = placed(hall(8, 6, column("c", 4, 3)))
    assert {DROP_REASONS[k] for k in found.reason} >= {"kept", "triangle too small"}


def test_without_rooms_seeds_are_contour_and_column_centres() -> None:
    floor = floor_of(box(0, 0, 8, 6), elements=[column("a", 3, 3), column("b", 5, 3)])
    place = StopFeasibility(navigable(floor, Settings(edge=0)))
    seeds = distinct(seeds_of(place.rooms[0], DrawnBoundary.of(place), d_max=100))
    assert np.round(seeds, 6).tolist() == [[0, 0], [0, 6], [3, 3], [5, 3], [8, 0], [8, 6]]


def test_with_rooms_seeds_are_corners_and_centres_of_round_elements() -> None:
    floor = hall(8, 6, column("square", 2, 3), element("round", "columns", round_column(6, 3)))
    place = StopFeasibility(navigable(floor, Settings()))
    seeds = distinct(seeds_of(place.rooms[0], DrawnBoundary.of(place), d_max=100))
    inside = [p for p in seeds if 0.5 < p[0] < 7.5]
    local = [(round(x - 0.2, 3), round(y - 0.2, 3)) for x, y in inside]
    assert local == [(1.8, 2.8), (1.8, 3.2), (2.2, 2.8), (2.2, 3.2), (6, 3)]


def test_squares_are_not_round_and_polygons_of_circles_are() -> None:
    assert is_round(shapely.Polygon(round_column(1, 1).exterior))
    assert not is_round(shapely.box(0, 0, 1, 1))


def test_every_kept_candidate_keeps_its_distance() -> None:
    floor = hall(9, 7, column("a", 3, 3), column("b", 6, 4))
    found = placed(floor)
    solids = shapely.union_all([shapely.Polygon(c.exterior) for e in floor.elements[1:] for c in e.solids])
    walls = shapely.box(0, 0, 9, 7).exterior
    points = shapely.points(found.xy[found.kept])
    assert len(points) > 5
    assert shapely.distance(points, solids).min() >= 0.7 - 1e-6
    assert shapely.distance(points, walls).min() >= 0.7 - 1e-6


def test_a_sparse_room_is_triangulated_again_until_it_is_dense() -> None:
    floor = hall(20, 20)
    few, many = placed(floor, d_max=100.0, dens_min=0.0), placed(floor, d_max=100.0, dens_min=0.1)
    assert len(few.kept) == 5
    assert len(many.kept) >= 0.1 * 400


def test_density_stops_where_nothing_is_gained() -> None:
    assert 0 < len(placed(hall(3, 3), dens_min=1000.0).kept) < 1000


def test_both_rooms_get_candidates() -> None:
    found = placed(two_rooms(1.0))
    assert set(found.room[found.kept].tolist()) == {0, 1}


@pytest.mark.parametrize("degrees", [17.0, 30.0, 45.0, 90.0])
def test_candidates_turn_with_the_drawing(degrees: float) -> None:
    """The number may change where four seeds on one circle let Delaunay choose; it stays close."""
    floor = hall(9.1, 7.3, column("a", 3, 3), column("b", 6.3, 4.1))
    straight, askew = placed(floor), placed(moved(floor, turned(degrees)))
    assert len(askew.kept) == pytest.approx(len(straight.kept), abs=1)


def test_a_shift_of_a_million_metres_changes_nothing() -> None:
    floor = hall(9, 7, column("a", 3, 3), column("b", 6.3, 4.1))
    here, far = placed(floor), placed(moved(floor, shifted(1e6, -2e6)))
    assert np.allclose(far.xy - here.xy, [1e6, -2e6], atol=1e-4)
    assert far.reason.tolist() == here.reason.tolist()


def test_the_order_of_elements_changes_nothing() -> None:
    parts = [column("a", 3, 3), column("b", 6, 4), wall("w", box(4, 0, 4.2, 2))]
    one, other = placed(hall(9, 7, *parts)), placed(hall(9, 7, *parts[::-1]))
    assert np.array_equal(one.xy, other.xy)
    assert np.array_equal(one.reason, other.reason)


@pytest.mark.parametrize(
    "outline",
    [
        pytest.param(box(0, 0, 40, 1e-3), id="a sliver"),
        pytest.param(box(0, 0, 0.02, 0.02), id="smaller than a coin"),
        pytest.param(Polygon.of([(0, 0), (5, 0), (2, 4)]), id="three corners"),
        pytest.param(round_column(0, 0, 4.0), id="all on one circle"),
        pytest.param(Polygon.of([(0, 0), (4, 0), (4, 4), (2, 4), (2, 4.0001), (0, 4)]), id="a hair"),
    ],
)
def test_anomalous_rooms_do_no_harm(outline: Polygon) -> None:
    """The anomalous room is next to a good one, so that there is something to plan."""
    beside = box(50, 0, 62, 9)
    floor = floor_of(
        outline,
        beside,
        rooms=[room("odd", outline), room("good", beside)],
        elements=[shell(50, 0, 62, 9), column("c", 54, 3)],
    )
    found = placed(floor, edge=0.0)
    assert 1 in found.room[found.kept]


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 2)),
        np.array([[1.0, 2.0]]),
        np.array([[0.0, 0.0], [1.0, 1.0]]),
        np.array([[float(k), 2.0 * k] for k in range(20)]),
    ],
)
def test_points_on_a_line_have_no_triangles(points: np.ndarray) -> None:
    assert delaunay(points).shape == (0, 3)
    assert voronoi_points(points).shape == (0, 2)


@settings(deadline=None, max_examples=size(short=20, full=60))
@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), min_size=0, max_size=25))
def test_any_seeds_are_triangulated(points: list[tuple[int, int]]) -> None:
    """Many cocircular and collinear seeds: no crash, and every Voronoi point in the room."""
    square = shapely.box(0, 0, 3, 3)
    seeds = np.array(points, dtype=float).reshape(-1, 2) / 10
    found, reason = triangulated(seeds, square, l_min=0.3)
    assert len(found) == len(reason)
    assert np.isfinite(found).all()
    assert (shapely.distance(shapely.points(found), square) < 1e-6).all()


@pytest.mark.skipif(not SHARED.exists(), reason="the paper's floors are not there")
@pytest.mark.parametrize(
    ("name", "paper", "ours"),
    [
        ("case1_structural", (131, 80), (113, 91)),
        ("case2_structural", (65, 35), (61, 48)),
        ("case1_rooms", (368, 229), (445, 236)),
        ("case2_rooms", (233, 138), (273, 131)),
    ],
)
def test_counts_stay_near_the_paper_s(name: str, paper: tuple[int, int], ours: tuple[int, int]) -> None:
    """Table 3, generated and left; ours are recorded so that a change is noticed."""
    from stopgo.planner.floors import read_floor

    floor = read_floor(SHARED / "paper" / f"synthetic_{name}.dxf")
    closed = {"doors": "closed", "robot_radius": 0.34} if "rooms" in name else {"edge": 0.0}
    told = [DROP_REASONS[k] for k in placed(floor, **closed).reason]
    left = told.count("kept")
    assert (left + told.count("closer than d_sec to an element"), left) == pytest.approx(ours, abs=3)
    assert all(0.7 < mine / theirs < 1.4 for mine, theirs in zip(ours, paper, strict=True))


def test_rooms_are_split_along_their_own_contour_only() -> None:
    """Walls between two rooms belong to both, and far walls to neither."""
    place = StopFeasibility(navigable(two_rooms(1.0), Settings()))
    seeds = seeds_of(place.rooms[0], DrawnBoundary.of(place), d_max=1.0)
    around = shapely.LineString(segments_of(place.rooms[0]).reshape(-1, 2))
    assert shapely.distance(shapely.points(seeds), around).max() < 2e-3
