"""Passable openings and gaps: decided by exact distances, for walls of any shape."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, OpeningState
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.space.gaps import Site
from stopgo.planner.space.navigable import navigable
from tests.faults.sizes import some
from tests.planner.worlds import (
    box,
    column,
    corners,
    door,
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

LEFT, RIGHT = (1.0, 2.0), (7.0, 2.0)
DOOR = 0.7


def way(floor: FloorPlan, settings: Settings | None = None, *, degrees: float = 0.0) -> float:
    """Length of the way from the left room to the right one; infinite where there is none."""
    space = navigable(moved(floor, turned(degrees)), settings or Settings())
    return length_in(space, turned(degrees)(np.array([LEFT, RIGHT])))


def length_in(space: NavigableSpace, points: np.ndarray) -> float:
    return float(paths_between(space, points).lengths[0, 1])


def state(floor: FloorPlan, settings: Settings | None = None) -> OpeningState:
    (found,) = navigable(floor, settings or Settings()).openings
    return found


WALLS = list(product((0.02, 0.1, 0.24, 0.6), (0.6, 2.0, 3.213), (0.0, 17.0, 30.0, 45.0, 90.0)))
"""Thickness of a wall, position of its opening, and angle."""


@pytest.mark.parametrize(("thick", "at", "degrees"), some(WALLS, every=4))
def test_an_opening_as_wide_as_the_robot_is_passed(thick: float, at: float, degrees: float) -> None:
    floor = two_rooms(0.700, thick=thick, at=at)
    assert 5.999 <= way(floor, degrees=degrees) < 9.0
    assert way(two_rooms(0.699, thick=thick, at=at), degrees=degrees) == np.inf


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("gap", [0.701, 0.705, 0.71, 0.75, 0.9, 1.5])
def test_a_wider_opening_is_passed(gap: float, degrees: float) -> None:
    assert 5.999 <= way(two_rooms(gap, at=1.0), degrees=degrees) < 7.0


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_straight_opening_is_driven_straight(degrees: float) -> None:
    assert way(two_rooms(0.700), degrees=degrees) == pytest.approx(6.0, abs=1e-4)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0])
@pytest.mark.parametrize("radius", [0.2, 0.35, 0.45])
def test_the_robots_radius_decides_between_columns_without_a_door(radius: float, degrees: float) -> None:
    def columns(gap: float) -> FloorPlan:
        south, north = 2.0 - gap / 2, 2.0 + gap / 2
        row = (
            element("s", "columns", box(3.9, 0, 4.1, south)),
            element("n", "columns", box(3.9, north, 4.1, 4)),
        )
        return hall(8, 4, *row)

    settings = Settings(robot_radius=radius)
    assert way(columns(2 * radius), settings, degrees=degrees) == pytest.approx(6.0, abs=1e-4)
    assert way(columns(2 * radius - 0.001), settings, degrees=degrees) == np.inf


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0])
def test_a_gap_between_the_corners_of_two_columns_is_measured_aslant(degrees: float) -> None:
    def aslant(gap: float) -> FloorPlan:
        # The corners are gap · (0.6, 0.8) apart.
        x, y = 4.0 + 0.6 * gap, 1.5 + 0.8 * gap
        row = (wall("s", box(3.0, 0, 4.0, 1.5)), wall("n", box(x, y, x + 1, 4)))
        return hall(8, 4, *row)

    assert way(aslant(0.700), degrees=degrees) < 7.0
    assert way(aslant(0.699), degrees=degrees) == np.inf


@pytest.mark.parametrize("degrees", [0.0, 45.0])
def test_a_corridor_as_wide_as_the_robot_is_driven_through(degrees: float) -> None:
    def corridor(width: float) -> FloorPlan:
        south, north = 2.0 - width / 2, 2.0 + width / 2
        return hall(8, 4, wall("s", box(2, 0, 6, south)), wall("n", box(2, north, 6, 4)))

    assert way(corridor(0.700), degrees=degrees) == pytest.approx(6.0, abs=1e-4)
    assert way(corridor(0.699), degrees=degrees) == np.inf


def test_a_bent_corridor_as_wide_as_the_robot_is_driven_through() -> None:
    # Two tight doors 3 m apart whose middles are 2 m apart: the way bends between them.
    walls = (
        *(wall("a1", box(2.9, 0, 3.1, 0.65)), wall("a2", box(2.9, 1.35, 3.1, 4))),
        *(wall("b1", box(5.9, 0, 6.1, 2.65)), wall("b2", box(5.9, 3.35, 6.1, 4))),
    )
    assert 6.5 < way(hall(8, 4, *walls)) < 8.0


def test_a_round_column_next_to_a_wall_leaves_what_it_leaves() -> None:
    angles = np.arange(0, 2 * np.pi, np.pi / 16)

    def beside(gap: float) -> FloorPlan:
        ring = np.c_[4 + 0.5 * np.cos(angles), gap + 0.5 + 0.5 * np.sin(angles)]
        disc = element("disc", "columns", Polygon.of(ring))
        return hall(8, 4, disc, wall("n", box(3.9, gap + 0.5, 4.1, 4)))

    assert way(beside(0.700)) < 8.0
    assert way(beside(0.699)) == np.inf


# ---- doors ----


def test_a_narrow_door_is_named_with_its_width() -> None:
    space = navigable(two_rooms(0.65), Settings())
    assert not space.openings[0].passable
    (finding,) = space.findings
    assert finding.code == "narrow_opening"
    for word in ("d", "0.650", "0.700", "left", "right"):
        assert word in finding.message
    assert finding.element == "d"
    assert finding.at == (4.0, 2.0)


@pytest.mark.parametrize(("gap", "passable"), [(0.700, True), (0.699, False), (0.9, True)])
def test_a_door_is_passable_from_door_access_on(gap: float, passable: bool) -> None:
    assert state(two_rooms(gap)).passable is passable


def test_a_door_too_narrow_for_door_access_stops_a_small_robot_too() -> None:
    floor, small = two_rooms(0.65), Settings(robot_radius=0.2)
    assert not state(floor, small).passable
    assert way(floor, small) == np.inf
    assert way(floor, Settings(robot_radius=0.2, door_access=0.6)) == pytest.approx(6.0, abs=1e-4)


def test_a_wide_door_is_not_passable_for_a_wider_robot() -> None:
    floor, big = two_rooms(0.9), Settings(robot_radius=0.46)
    found = state(floor, big)
    assert not found.passable
    assert "0.900" in found.why
    assert "0.920" in found.why
    assert way(floor, big) == np.inf


def test_a_column_in_front_of_a_door_is_named_with_the_gap_it_leaves() -> None:
    # The column leaves 0.6 m to the wall beside the door.
    post = element("post", "columns", box(4.7, 1.2, 5.1, 2.8))
    space = navigable(two_rooms(0.9, more=(post,)), Settings())
    (finding,) = space.findings
    assert finding.code == "blocked_opening"
    assert finding.element == "d"
    assert "post" in finding.message
    assert "0.600" in finding.message
    assert not space.openings[0].passable


def test_a_column_in_front_of_a_door_with_just_room_enough_does_not_block_it() -> None:
    post = element("post", "columns", box(4.8, 1.2, 5.2, 2.8))
    assert state(two_rooms(0.9, more=(post,))).passable
    nearer = element("post", "columns", box(4.799, 1.2, 5.2, 2.8))
    assert not state(two_rooms(0.9, more=(nearer,))).passable


def test_a_column_in_the_door_line_leaves_the_wider_piece() -> None:
    # A door of 1.2 m with a post of 0.2 m: 0.3 m on one side and 0.7 m on the other.
    post = element("post", "columns", box(3.95, 1.7, 4.05, 1.9))
    found = state(two_rooms(1.2, more=(post,)))
    assert found.clear_width == pytest.approx(0.7)
    assert found.passable


def terrace(until: float, *, kind: str = "door", more: Iterable[Element] = ()) -> FloorPlan:
    """A room with a door in the wall at 3.9 to 4.1, and floor in no room behind it, as far as x = `until`."""
    return floor_of(
        box(0, 0, until, 4),
        rooms=(room("left", box(0, 0, 3.9, 4)),),
        openings=(door("out", (4, 1.5), (4, 2.5), kind=kind),),
        elements=(
            shell(0, 0, 8, 4),
            wall("s", box(3.9, 0, 4.1, 1.5)),
            wall("n", box(3.9, 2.5, 4.1, 4)),
            *more,
        ),
    )


@pytest.mark.parametrize("until", [3.9, 4.1, 4.5])
@pytest.mark.parametrize("with_rooms", [True, False])
def test_a_door_with_no_floor_beyond_it_is_exterior(until: float, with_rooms: bool) -> None:
    floor = terrace(until)
    found = state(floor if with_rooms else replace(floor, rooms=()))
    assert not found.passable
    assert found.why == "exterior: no floor on one side"


@pytest.mark.parametrize("kind", ["door", "passage"])
def test_an_opening_to_floor_in_no_room_is_driven_through(kind: str) -> None:
    floor = terrace(8.0, kind=kind)
    assert state(floor).passable
    assert way(floor) < 6.5


def test_a_door_to_floor_in_no_room_may_be_blocked() -> None:
    # A planter before the door leaves 0.6 m between itself and the wall.
    floor = terrace(8.0, more=(element("planter", "other", box(4.7, 1.2, 5.2, 2.8)),))
    found = state(floor)
    assert not found.passable
    assert "0.600 m between" in found.why
    assert "planter" in found.why


def test_a_door_next_to_a_gap_in_the_same_wall_leaves_the_gap_open() -> None:
    # A narrow door at y = 1 and a plain gap of 0.8 m at y = 3: the robot takes the gap.
    walls = (
        wall("s", box(3.9, 0, 4.1, 0.7)),
        wall("m", box(3.9, 1.3, 4.1, 2.6)),
        wall("n", box(3.9, 3.4, 4.1, 4)),
    )
    floor = hall(8, 4, *walls, openings=(door("d", (4, 0.7), (4, 1.3)),))
    assert not state(floor).passable
    assert 5.999 < way(floor) < 7.0


@pytest.mark.parametrize("thick", [0.1, 0.3, 0.5])
def test_the_floor_may_stop_under_the_walls(thick: float) -> None:
    # Rooms as separate pieces of floor: the door makes the threshold between them.
    floor = two_rooms(0.9, thick=thick)
    floor = replace(floor, outline=(box(0, 0, 4 - thick / 2, 4), box(4 + thick / 2, 0, 8, 4)))
    assert state(floor).passable
    assert way(floor) == pytest.approx(6.0, abs=1e-3)


@pytest.mark.parametrize("gap", [0.7, 0.9])
def test_a_threshold_is_as_wide_as_its_door(gap: float) -> None:
    floor = two_rooms(gap)
    floor = replace(floor, outline=(box(0, 0, 3.9, 4), box(4.1, 0, 8, 4)))
    assert way(floor) == pytest.approx(6.0, abs=1e-3)


@pytest.mark.parametrize("kind", ["windows", "railings", "stairs", "columns", "walls"])
def test_obstacles_of_every_kind_block_driving(kind: str) -> None:
    assert way(hall(8, 4, element("across", kind, box(3.9, 0, 4.1, 4)))) == np.inf


def test_beams_do_not_block_driving() -> None:
    assert way(hall(8, 4, element("above", "beams", box(3.9, 0, 4.1, 4)))) == pytest.approx(6.0, abs=1e-4)


def test_a_railing_drawn_as_a_line_blocks_driving() -> None:
    assert way(hall(8, 4, element("rail", "railings", lines=[[(4, 0), (4, 4)]]))) == np.inf


def overshooting(clear: float, *, by: float = 0.4) -> FloorPlan:
    """An open passage whose line runs on along and into the walls next to it."""
    floor = two_rooms(clear)
    line = door("p", (4, 2 - clear / 2 - by), (4, 2 + clear / 2 + by), kind="passage")
    return replace(floor, openings=(line,))


def test_a_passage_is_its_line_minus_the_walls() -> None:
    found = state(overshooting(1.3))
    assert found.clear_width == pytest.approx(1.3)
    assert found.passable
    assert found.rooms in {(0, 1), (1, 0)}


@pytest.mark.parametrize(("clear", "passable"), [(0.700, True), (0.699, False)])
def test_a_passage_is_passable_from_door_access_on(clear: float, passable: bool) -> None:
    assert state(overshooting(clear)).passable is passable


def test_the_door_of_an_inner_room_joins_it_to_the_outer_one() -> None:
    inner, outer = box(3, 1, 5, 3), box(0, 0, 8, 4)
    cell = (
        wall("w", box(2.9, 0.9, 3.0, 3.1)), wall("e", box(5.0, 0.9, 5.1, 3.1)),
        wall("n", box(3.0, 3.0, 5.0, 3.1)),
        wall("s1", box(3.0, 0.9, 3.6, 1.0)), wall("s2", box(4.4, 0.9, 5.0, 1.0)),
    )  # fmt: skip
    floor = hall(8, 4, *cell, rooms=(room("outer", outer), room("inner", inner)))
    floor = replace(floor, openings=(door("d", (3.6, 0.95), (4.4, 0.95)),))
    space = navigable(floor, Settings())
    assert space.openings[0].passable
    assert set(space.openings[0].rooms) == {0, 1}
    areas = {part.name: sum(polygon.area for polygon in part.area) for part in space.rooms}
    assert areas == {"outer": pytest.approx(32 - 4), "inner": pytest.approx(4)}
    assert length_in(space, np.array([(1.0, 2.0), (4.0, 2.0)])) < 6.0


def test_small_columns_do_not_cut_the_floor_into_parts() -> None:
    posts = [column(f"c{k}", 1.5 + k % 6, 1.0 + k // 6, 0.1) for k in range(18)]
    assert way(hall(8, 4, *posts)) < 7.0


def test_columns_closer_than_the_robot_are_a_wall() -> None:
    posts = [column(f"c{k}", 4.0, 0.25 + 0.5 * k, 0.1) for k in range(8)]
    assert way(hall(8, 4, *posts)) == np.inf


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_floor_edge_is_kept_away_from(degrees: float) -> None:
    # No walls: a bridge of floor 0.7 m wide between two slabs, edge 0.35 m on each side.
    def bridge(width: float) -> FloorPlan:
        low, high = 2 - width / 2, 2 + width / 2
        outline = [
            (0, 0),
            (3, 0),
            (3, low),
            (5, low),
            (5, 0),
            (8, 0),
            (8, 4),
            (5, 4),
            (5, high),
            (3, high),
            (3, 4),
            (0, 4),
        ]
        return floor_of(Polygon.of(outline), elements=(column("c", 1, 0.5),))

    assert way(bridge(0.700), degrees=degrees) == pytest.approx(6.0, abs=1e-4)
    assert way(bridge(0.699), degrees=degrees) == np.inf
    assert way(bridge(0.3), Settings(edge=0.1), degrees=degrees) == pytest.approx(6.0, abs=1e-4)


def test_a_hole_is_kept_away_from() -> None:
    def pierced(gap: float) -> FloorPlan:
        return floor_of(box(0, 0, 8, 4, corners(3, gap, 5, 4 - gap)), elements=(column("c", 1, 0.5),))

    assert 5.999 < way(pierced(0.700)) < 9.0
    assert way(pierced(0.699)) == np.inf


def test_a_shift_of_a_million_metres_changes_nothing() -> None:
    for gap, passable in ((0.700, True), (0.699, False)):
        floor = moved(two_rooms(gap), shifted(1e6, -1e6))
        space = navigable(floor, Settings())
        there = length_in(space, shifted(1e6, -1e6)(np.array([LEFT, RIGHT])))
        assert np.isfinite(there) == passable == space.openings[0].passable


def test_two_doors_in_series_are_both_passable() -> None:
    # An airlock 1 m deep with doors exactly as wide as the robot.
    walls = (
        *(wall("a1", box(3.4, 0, 3.5, 1.65)), wall("a2", box(3.4, 2.35, 3.5, 4))),
        *(wall("b1", box(4.5, 0, 4.6, 1.65)), wall("b2", box(4.5, 2.35, 4.6, 4))),
    )
    floor = hall(
        8, 4, *walls,
        rooms=(room("l", box(0, 0, 3.4, 4)), room("lock", box(3.5, 0, 4.5, 4)), room("r", box(4.6, 0, 8, 4))),
        openings=(door("a", (3.45, 1.65), (3.45, 2.35)), door("b", (4.55, 1.65), (4.55, 2.35))),
    )  # fmt: skip
    space = navigable(floor, Settings())
    assert [item.passable for item in space.openings] == [True, True]
    assert way(floor) == pytest.approx(6.0, abs=1e-4)


def test_gaps_that_a_third_wall_closes_are_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    # Columns as far apart as the robot is wide; with an edge of 5 m the floor's edge is too near them.
    floor = hall(20, 20, column("a", 3, 10), column("b", 4.1, 10))
    tried: list[object] = []
    monkeypatch.setattr(Site, "allows", lambda site, a, b: bool(tried.append(b)))
    navigable(floor, Settings(edge=5.0))
    assert not tried
    navigable(floor, Settings())
    assert tried


def test_a_floor_without_drive_area_has_no_crossings() -> None:
    space = navigable(hall(20, 20, column("a", 3, 10), column("b", 4.1, 10)), Settings(edge=50.0))
    assert (space.drive_area, len(space.gaps)) == ((), 0)
