"""Positions where stops may be, rooms that get one, and reports of rooms that get none."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stopgo.mission.errors import NegativeResult
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import DROP_REASONS, KEPT, Candidates
from stopgo.planner.appraisal.unreached import unreached
from stopgo.planner.candidates import STRATEGIES, candidates
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.stop_feasibility import StopFeasibility
from tests.planner.worlds import (
    box,
    column,
    corners,
    door,
    element,
    floor_of,
    hall,
    moved,
    planned,
    room,
    shell,
    turned,
    two_rooms,
    wall,
)


def reason_at(floor: FloorPlan, x: float, y: float, settings: Settings | None = None) -> str:
    """Reason why a stop may not be at a point of the first room, or `kept`."""
    place = StopFeasibility(navigable(floor, settings or Settings()))
    return DROP_REASONS[int(place.reasons(np.array([[x, y]]), np.array([0]))[0])]


def kept(floor: FloorPlan, settings: Settings | None = None) -> np.ndarray:
    found = candidates(navigable(floor, settings or Settings()))
    return found.xy[found.kept]


@pytest.mark.parametrize(
    ("x", "reason"),
    [
        (0.7, "kept"),
        (0.699, "closer than d_sec to an element"),
        (3.0, "kept"),
        (5.3, "kept"),
        (5.301, "closer than d_sec to an element"),
        (-0.1, "outside the room"),
    ],
)
def test_d_sec_is_a_closed_condition(x: float, reason: str) -> None:
    assert reason_at(hall(6, 4), x, 2.0) == reason


@pytest.mark.parametrize("degrees", [17.0, 30.0, 45.0])
def test_d_sec_is_a_closed_condition_at_any_angle(degrees: float) -> None:
    for x, reason in ((0.7, "kept"), (0.699, "closer than d_sec to an element")):
        point = turned(degrees)(np.array([[x, 2.0]]))[0]
        assert reason_at(moved(hall(6, 4), turned(degrees)), *point) == reason


@pytest.mark.parametrize(
    ("y", "reason"),
    [(0.35, "kept"), (0.349, "closer than the edge distance to a floor edge"), (-0.01, "outside the room")],
)
def test_the_edge_distance_is_a_closed_condition(y: float, reason: str) -> None:
    floor = floor_of(box(0, 0, 6, 4), elements=(column("c", 1, 3),))
    assert reason_at(floor, 4.0, y) == reason


def test_a_hole_is_no_place_for_a_stop() -> None:
    floor = floor_of(box(0, 0, 8, 4, corners(3, 1, 5, 3)), elements=(column("c", 1, 3),))
    assert reason_at(floor, 4.0, 2.0) in ("in a hole", "outside the room")
    assert reason_at(floor, 2.65, 2.0) == "kept"
    assert reason_at(floor, 2.66, 2.0) == "closer than the edge distance to a floor edge"


@pytest.mark.parametrize("kind", ["walls", "columns", "stairs", "windows", "railings"])
def test_stops_keep_d_sec_from_every_kind_of_obstacle(kind: str) -> None:
    floor = hall(6, 4, element("it", kind, box(2.8, 1.8, 3.2, 2.2)))
    assert reason_at(floor, 2.1, 2.0) == "kept"
    assert reason_at(floor, 2.2, 2.0) == "closer than d_sec to an element"
    assert reason_at(floor, 3.0, 2.0) == "closer than d_sec to an element"


def test_a_stop_may_stand_under_a_beam() -> None:
    assert reason_at(hall(6, 4, element("b", "beams", box(0, 1.9, 6, 2.1))), 3.0, 2.0) == "kept"


def test_a_robot_wider_than_d_sec_keeps_its_radius() -> None:
    wide = Settings(d_sec=0.3, robot_radius=0.5)
    assert reason_at(hall(6, 4), 0.5, 2.0, wide) == "kept"
    assert reason_at(hall(6, 4), 0.45, 2.0, wide) == "closer than d_sec to an element"


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("width", [1.4, 1.45, 1.9, 2.4])
def test_a_narrow_corridor_gets_a_candidate(width: float, degrees: float) -> None:
    assert len(kept(moved(hall(6, width), turned(degrees)))) >= 1


def test_a_corridor_narrower_than_twice_d_sec_gets_none() -> None:
    with pytest.raises(NegativeResult, match="no candidate"):
        kept(hall(6, 1.398))


@pytest.mark.parametrize("side", [1.4, 1.41, 1.6])
def test_a_small_room_gets_a_candidate_in_its_middle(side: float) -> None:
    found = kept(hall(side, side))
    assert len(found) >= 1
    assert np.hypot(*(found - side / 2).T).min() <= side / 2 - 0.7 + 1e-6


def closet(depth: float) -> tuple[Element, ...]:
    """Walls round a closet of 1.5 m × `depth` in the south-east corner, with a door of 0.7 m."""
    return (
        wall("a", box(6.4, 0, 6.5, depth)),
        wall("b", box(6.5, depth, 7.1, depth + 0.1)),
        wall("c", box(7.8, depth, 8, depth + 0.1)),
    )


def test_a_small_room_next_to_a_large_one_gets_a_candidate() -> None:
    floor = two_rooms(0.9)
    cell = (
        wall("a", box(6.4, 0, 6.5, 1.5)),
        wall("b", box(6.5, 1.5, 7.1, 1.6)),
        wall("c", box(7.8, 1.5, 8, 1.6)),
    )
    small = room("small", box(6.5, 0, 8, 1.5))
    floor = replace(
        floor,
        rooms=(*floor.rooms, small),
        openings=(*floor.openings, door("e", (7.1, 1.55), (7.8, 1.55))),
        elements=(*floor.elements, *cell),
    )
    found = candidates(navigable(floor, Settings()))
    inside = found.kept[found.room[found.kept] == 2]
    assert len(inside) >= 1


@pytest.mark.parametrize("name", sorted(STRATEGIES))
@pytest.mark.parametrize("degrees", [0.0, 17.0])
def test_every_strategy_keeps_its_candidates_clear_and_reachable(name: str, degrees: float) -> None:
    stair = element("s", "stairs", box(5, 0, 6, 1))
    floor = moved(two_rooms(0.8, more=(column("c", 2, 1), column("k", 6, 3), stair)), turned(degrees))
    settings = Settings(candidates=name, register=False)  # no doorways, which keep the radius only
    found = candidates(navigable(floor, settings))
    assert len(found.kept) >= 2
    check_candidates(found)
    assert {int(k) for k in found.room[found.kept]} == {0, 1}


def check_candidates(found: Candidates) -> None:
    place = StopFeasibility(found.space)
    again = place.reasons(found.xy, found.room)
    assert np.all(again[found.kept] == KEPT)
    assert np.all((found.reason != KEPT) | (found.part == found.chosen_part))
    lengths = paths_between(found.space, found.xy[found.kept]).lengths
    assert np.isfinite(lengths).all()
    assert len(np.unique(np.round(found.xy[found.kept], 6), axis=0)) == len(found.kept)


def test_grid_candidates_are_at_most_the_spacing_apart() -> None:
    xy = kept(hall(7.3, 5.2), Settings(grid=1.0))
    for axis in (0, 1):
        steps = np.diff(np.unique(np.round(xy[:, axis], 9)))
        assert steps.max() <= 1.0 + 1e-9
        assert np.allclose(steps, steps[0])


def test_the_grid_follows_a_turned_room() -> None:
    straight, aslant = kept(hall(7, 5)), kept(moved(hall(7, 5), turned(30)))
    back = turned(-30)(aslant)
    assert sorted(map(tuple, np.round(back, 5).tolist())) == sorted(
        map(tuple, np.round(straight, 5).tolist())
    )


# ---- parts, and rooms left out ----


def told_of(floor: FloorPlan, settings: Settings | None = None) -> dict[str, str]:
    found = candidates(navigable(floor, settings or Settings()))
    return {item.room: item.why for item in unreached(found)}


def test_nothing_is_left_out_of_a_connected_floor() -> None:
    assert told_of(two_rooms(0.9)) == {}


def test_a_room_behind_a_narrow_door_is_reported_with_the_door() -> None:
    told = told_of(two_rooms(0.6))
    assert len(told) == 1
    (why,) = told.values()
    assert "another part" in why
    assert "door d" in why
    assert "0.600" in why


def slabs(gap: float, **parts: Any) -> FloorPlan:
    """Slabs west of x = 4 and east of x = 4 + gap, in walls all round."""
    return floor_of(box(0, 0, 4, 4), box(4 + gap, 0, 8, 4), elements=(shell(0, 0, 8, 4),), **parts)


ROOMS = {"rooms": (room("left", box(0, 0, 4, 4)), room("right", box(4, 0, 8, 4)))}


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("parts", [{}, ROOMS, {"rooms": ROOMS["rooms"][:1]}], ids=["none", "two", "one"])
@pytest.mark.parametrize("gap", [0.03, 0.5])
def test_a_gap_in_the_floor_is_named_with_width_and_place(gap: float, parts: Any, degrees: float) -> None:
    told = told_of(moved(slabs(gap, **parts), turned(degrees)))
    ((_, why),) = told.items()
    assert f"a gap of {gap:.3f} m in the floor" in why
    x, y = map(float, re.findall(r"at \((-?[\d.]+), (-?[\d.]+)\)", why)[0])
    place = turned(-degrees)(np.array([x, y]))
    assert place[0] == pytest.approx(4 + gap / 2, abs=0.02)
    assert 0 < place[1] < 4


def test_a_gap_that_ends_within_the_floor_is_named() -> None:
    slot = [(4.06, 4), (4.06, 0.3), (4, 0.3), (4, 4)]  # the slabs are one in the south, beside the wall
    slab = Polygon.of([(0, 0), (8, 0), (8, 4), *slot, (0, 4)])
    why = told_of(floor_of(slab, elements=(shell(0, 0, 8, 4),), **ROOMS))
    assert "a gap of 0.060 m in the floor at (4.03," in next(iter(why.values()))


def test_a_strip_between_two_gaps_is_reported_with_one_of_them() -> None:
    strip = (box(0, 0, 4, 4), box(4.1, 0, 4.7, 4), box(4.8, 0, 8, 4))
    floor = floor_of(
        *strip,
        rooms=(*ROOMS["rooms"][:1], room("strip", strip[1]), room("right", strip[2])),
        elements=(shell(0, 0, 8, 4),),
    )
    told = told_of(floor)
    assert told["strip"].startswith(
        "no position 0.35 m from the floor's edges (a gap of 0.100 m in the floor at"
    )


def test_each_of_three_slabs_is_reported_with_its_gap() -> None:
    three = (box(0, 0, 4, 4), box(4.1, 0, 7, 4), box(7.2, 0, 9, 4))
    told = told_of(floor_of(*three, elements=(shell(0, 0, 9, 4),)))
    assert "a gap of 0.100 m in the floor at (4.05," in told["floor 2"]
    assert "a gap of 0.200 m in the floor at (7.10," in told["floor 3"]


def test_a_wall_between_slabs_is_no_gap() -> None:
    floor = slabs(0.1, **ROOMS)
    told = told_of(replace(floor, elements=(*floor.elements, wall("w", box(4, 0, 4.1, 4)))))
    assert "gap" not in next(iter(told.values()))


def test_a_room_too_small_for_d_sec_is_reported() -> None:
    cell = (
        wall("a", box(6.4, 0, 6.5, 1.2)),
        wall("b", box(6.5, 1.2, 7.1, 1.3)),
        wall("c", box(7.8, 1.2, 8, 1.3)),
    )
    floor = two_rooms(0.9)
    floor = replace(
        floor, rooms=(*floor.rooms, room("closet", box(6.5, 0, 8, 1.2))), elements=(*floor.elements, *cell)
    )
    told = told_of(floor)
    assert set(told) == {"closet"}
    assert "0.7 m" in told["closet"]


def test_the_larger_part_is_planned_without_a_start() -> None:
    floor = two_rooms(0.6)
    low = replace(floor, elements=(*floor.elements, wall("fill", box(4.1, 2.5, 8, 4))))
    mission, _ = planned(low)
    assert all(stop.x < 4 for stop in mission.stops)


@pytest.mark.parametrize("kind", ["door", "passage"])
def test_floor_in_no_room_is_planned_as_a_room_without_a_name(kind: str) -> None:
    floor = floor_of(
        box(0, 0, 8, 4),
        rooms=(room("left", box(0, 0, 3.9, 4)),),
        openings=(door("p", (4, 1.5), (4, 2.5), kind=kind),),
        elements=(shell(0, 0, 8, 4), wall("s", box(3.9, 0, 4.1, 1.5)), wall("n", box(3.9, 2.5, 4.1, 4))),
    )
    mission, _ = planned(floor, Settings(range=3.0, coverage=1.0))
    assert {stop.x < 4 for stop in mission.stops} == {True, False}


def test_floor_in_no_room_behind_a_narrow_door_is_reported_with_the_door() -> None:
    floor = two_rooms(0.6)
    told = told_of(replace(floor, rooms=floor.rooms[:1]))
    assert told["unnamed 1"].startswith("in another part of the floor (door d: 0.600 m clear")


def test_a_start_as_near_to_a_wall_as_the_robot_fits_is_taken() -> None:
    mission, _ = planned(hall(6, 4), Settings(start=(0.35, 0.35, 0.0)))
    assert (mission.start.x, mission.start.y) == (0.35, 0.35)


@pytest.mark.parametrize("degrees", [0.0, 7.0, 17.0, 45.0])
def test_every_candidate_on_a_floor_edge_has_a_path(degrees: float) -> None:
    floor = moved(floor_of(box(0, 0, 8, 4), elements=(column("c", 4, 2, 0.6),)), turned(degrees))
    check_candidates(candidates(navigable(floor, Settings(edge=0.0))))


@pytest.mark.parametrize("degrees", [0.0, 17.0])
def test_candidates_as_near_as_the_robot_fits_are_reachable(degrees: float) -> None:
    floor = moved(hall(2.8, 2.1), turned(degrees))
    found = candidates(navigable(floor, Settings(d_sec=0.35, grid=0.35)))
    assert len(found.kept) == 7 * 5
    check_candidates(found)
