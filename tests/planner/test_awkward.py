"""Floors that nobody would draw on purpose: planned well or refused in one line, never a crash."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, NegativeResult, StopgoError
from stopgo.mission.floor import Element, FloorPlan, Opening
from stopgo.mission.geometry import Polygon, frozen
from stopgo.mission.settings import Settings
from tests.faults.sizes import size, some
from tests.planner.checks import check_plan
from tests.planner.worlds import (
    box,
    changed,
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
    shifted,
    turned,
    two_rooms,
    wall,
)


def well_planned(floor: FloorPlan, options: Settings | None = None, *, brute: bool = True) -> Mission:
    mission, nouns = planned(floor, options)
    check_plan(mission, nouns, options or Settings(), brute=brute)
    return mission


def refused(
    floor: FloorPlan, options: Settings | None = None, *, kind: type[StopgoError] = StopgoError
) -> str:
    with pytest.raises(kind) as error:
        planned(floor, options)
    assert "\n" not in str(error.value)
    return str(error.value)


# ---- shapes ----


def sliver(length: float = 3.0, width: float = 1e-5) -> Polygon:
    return box(1.0, 1.0, 1.0 + length, 1.0 + width)


# Rings of no area, rings that cross themselves and doors of no length are mended or dropped by the reader:
# see test_command.

BOW_TIE = Polygon(frozen([(4, 1), (5, 2), (5, 1), (4, 2)]))
"""Built directly: its rings cross, so it has no turning sense."""

ODD_ELEMENTS: dict[str, Element] = {
    "sliver": wall("odd", sliver()),
    "sliver thinner than the grid": wall("odd", sliver(width=1e-7)),
    "bow-tie": wall("odd", BOW_TIE),
    "spike": wall("odd", Polygon.of([(3, 1), (4, 1), (4, 2), (4, 3.2), (4, 2), (3, 2)])),
    "repeated points": wall("odd", Polygon.of([(3, 1), (3, 1), (4, 1), (4, 1), (4, 2), (3, 2), (3, 2)])),
    "a line of no length": element("odd", "walls", lines=[[(3, 1), (3, 1)]]),
    "a line there and back": element("odd", "walls", lines=[[(3, 1), (4, 2), (3, 1)]]),
    "a line that crosses itself": element("odd", "walls", lines=[[(3, 1), (4, 2), (4, 1), (3, 2)]]),
    "a closed line": element("odd", "walls", lines=[[(3, 1), (4, 1), (4, 2), (3, 1)]]),
    "a hole touching the outline": wall("odd", box(3, 1, 4, 2, [(3, 1), (3.2, 1.5), (3.4, 1.5)])),
    "a hole outside": wall("odd", box(3, 1, 4, 2, corners(5, 1, 5.5, 2))),
    "hole equal to the outline": wall("odd", box(3, 1, 4, 2, corners(3, 1, 4, 2))),
    "no geometry": Element("odd", "walls", occludes=True, obstacle=True, target=True),
    "a railing of no length": element("odd", "railings", lines=[[(3, 1), (3, 1)]]),
    "a beam of no length": element("odd", "beams", lines=[[(3, 1), (3, 1)]]),
    "a beam through a wall": element("odd", "beams", box(-1, 1, 9, 1.2)),
    "the room's wall again": shell(0, 0, 8, 5, id="odd"),
    "the room's wall a hair off": shell(1e-6, 1e-6, 8 + 1e-6, 5 + 1e-6, id="odd"),
    "a wall outside the floor": wall("odd", box(20, 20, 21, 21)),
    "walls that touch in a corner": wall("odd", box(3, 1, 4, 2), box(4, 2, 5, 3)),
    "walls a tenth of the grid apart": wall("odd", box(3, 1, 4, 2), box(4 + 1e-6, 1, 5, 2)),
    "walls that cross": wall("odd", box(2, 2, 5, 2.2), box(3, 1, 3.2, 4)),
}


@pytest.mark.parametrize("name", some(list(ODD_ELEMENTS), every=2))
def test_an_anomalous_element_is_planned_around(name: str) -> None:
    well_planned(hall(8, 5, ODD_ELEMENTS[name]))


ODD_OPENINGS: dict[str, Opening] = {
    "a door on a solid wall": door("odd", (4, 3.2), (4, 3.9)),
    "a door outside everything": door("odd", (50, 50), (51, 50)),
    "a door in the middle of a room": door("odd", (2, 1), (2, 2)),
    "a door across two rooms": door("odd", (1, 2), (7, 2)),
    "a passage along a wall": door("odd", (0, 0), (8, 0), kind="passage"),
    "a passage on the floor's edge": door("odd", (8, 1), (8, 3), kind="passage"),
    "the same door again": door("odd", (4, 1.5), (4, 2.5)),
    "a huge door": door("odd", (4, -100), (4, 100)),
    "a hair of a door": door("odd", (4, 2), (4, 2 + 1e-6)),
}


@pytest.mark.parametrize("name", some(list(ODD_OPENINGS), every=2))
def test_an_anomalous_opening_is_planned_around(name: str) -> None:
    floor = two_rooms(1.0)
    floor = replace(floor, openings=(*floor.openings, ODD_OPENINGS[name]))
    assert len(well_planned(floor).stops) >= 1


@pytest.mark.parametrize("name", some([*ODD_OPENINGS][1:] + [*ODD_OPENINGS][:1], every=2))
def test_an_anomalous_opening_alone_is_planned_around(name: str) -> None:
    well_planned(replace(two_rooms(1.0), openings=(ODD_OPENINGS[name],)))


ODD_ROOMS: dict[str, tuple[Polygon, ...]] = {
    "a sliver": (sliver(),),
    "two that touch in a corner": (box(5, 1, 6, 2), box(6, 2, 7, 3)),
    "two that overlap": (box(5, 0, 7, 4), box(6, 0, 8, 4)),
    "the floor again": (box(0, 0, 8, 4),),
    "outside the floor": (box(100, 100, 110, 110),),
    "larger than the floor": (box(-50, -50, 50, 50),),
    "within a wall": (box(3.92, 3, 4.08, 4),),
}


@pytest.mark.parametrize("name", some(list(ODD_ROOMS), every=2))
def test_an_anomalous_room_is_planned_around(name: str) -> None:
    floor = two_rooms(1.0)
    rooms = (*floor.rooms, *(room(f"odd {k}", shape) for k, shape in enumerate(ODD_ROOMS[name])))
    well_planned(replace(floor, rooms=rooms))


@pytest.mark.parametrize("name", some([*ODD_ROOMS][1:] + [*ODD_ROOMS][:1], every=2))
def test_anomalous_rooms_alone_are_planned_or_refused(name: str) -> None:
    rooms = tuple(room(f"odd {k}", shape) for k, shape in enumerate(ODD_ROOMS[name]))
    try:
        well_planned(replace(two_rooms(1.0), rooms=rooms))
    except StopgoError as error:
        assert "\n" not in str(error)


ODD_OUTLINES: dict[str, tuple[Polygon, ...]] = {
    "twice": (box(0, 0, 8, 4), box(0, 0, 8, 4)),
    "overlapping": (box(0, 0, 5, 4), box(3, 0, 8, 4)),
    "touching along an edge": (box(0, 0, 4, 4), box(4, 0, 8, 4)),
    "a hair apart": (box(0, 0, 4, 4), box(4 + 1e-6, 0, 8, 4)),
    "sliver beside it": (box(0, 0, 8, 4), box(9, 0, 9 + 1e-6, 4)),
    "a hole of no area": (box(0, 0, 8, 4, [(1, 1), (2, 1), (1.5, 1)]),),
    "five holes": (box(0, 0, 8, 4, *(corners(0.2 + 1.5 * k, 0.2, 0.5 + 1.5 * k, 0.5) for k in range(5))),),
    "a hole through a wall": (box(0, 0, 8, 4, corners(3, 3, 5, 3.5)),),
    "larger than the walls": (box(-5, -5, 15, 10),),
}


@pytest.mark.parametrize("name", some(list(ODD_OUTLINES), every=2))
def test_an_anomalous_outline_is_planned_around(name: str) -> None:
    well_planned(replace(two_rooms(1.0), outline=ODD_OUTLINES[name]))


def test_rooms_that_touch_in_a_corner_are_two_parts() -> None:
    floor = floor_of(
        box(0, 0, 3, 3), box(3, 3, 6, 6),
        rooms=(room("a", box(0, 0, 3, 3)), room("b", box(3, 3, 6, 6))),
        elements=(shell(0, 0, 3, 3, id="a"), shell(3, 3, 6, 6, id="b")),
    )  # fmt: skip
    well_planned(floor)


def test_a_floor_with_a_room_on_no_floor_is_planned() -> None:
    well_planned(replace(two_rooms(1.0), outline=(box(0, 0, 3.9, 4),)))


def test_a_floor_without_rooms_is_planned() -> None:
    assert well_planned(replace(two_rooms(1.0), rooms=())).stops


def test_a_floor_without_walls_is_planned_for_its_columns() -> None:
    well_planned(floor_of(box(0, 0, 8, 8), elements=(column("c", 4, 4),)))


def test_only_beams_can_be_scanned() -> None:
    beams = (element("b", "beams", box(1, 2, 7, 2.2)), element("l", "beams", lines=[[(1, 1), (7, 1)]]))
    well_planned(hall(8, 4, *beams), Settings(targets=("beams",)))


# ---- places and sizes ----


@pytest.mark.parametrize("by", some([(1e6, 1e6), (-1e6, 5e5), (500000.123, 4649776.22)], every=2))
def test_a_floor_far_from_the_origin_is_planned_as_here(by: tuple[float, float]) -> None:
    here, there = well_planned(two_rooms(0.7)), well_planned(moved(two_rooms(0.7), shifted(*by)))
    assert len(here.stops) == len(there.stops)
    for one, other in zip(here.stops, there.stops, strict=True):
        assert np.allclose((one.x + by[0], one.y + by[1]), (other.x, other.y), atol=1e-5)


def test_a_floor_far_from_its_zero_is_not_placed_on_the_earth() -> None:
    floor = moved(hall(6, 4), shifted(2_600_000.0, 1_200_000.0))
    said = refused(floor, Settings(origin=(47.0, 8.0, 400.0, 0.0)), kind=InputError)
    assert "2864 km from the drawing's 0,0" in said


def test_a_floor_of_half_a_metre_has_no_candidate() -> None:
    assert "no candidate" in refused(hall(0.5, 0.5), kind=NegativeResult)


def test_a_floor_of_half_a_metre_is_planned_for_a_small_robot() -> None:
    tiny = Settings(d_sec=0.1, robot_radius=0.1, edge=0.0)
    assert len(well_planned(hall(0.5, 0.5), tiny).stops) == 1


def test_a_floor_of_ten_kilometres_is_refused() -> None:
    assert "units" in refused(hall(10_000, 10), kind=InputError)


def test_a_floor_without_elements_has_no_target() -> None:
    assert "no target" in refused(floor_of(box(0, 0, 5, 5)), kind=NegativeResult)


def test_a_floor_without_area_is_refused() -> None:
    refused(floor_of(elements=(column("c", 1, 1),)))


def test_a_floor_full_of_wall_has_no_candidate() -> None:
    refused(hall(5, 5, wall("all", box(0, 0, 5, 5))))


@pytest.mark.parametrize(
    "options",
    [
        Settings(range=0.1),
        Settings(range=1e5),
        Settings(coverage=1.0),
        Settings(coverage=1e-9),
        Settings(d_dis=1000.0),
        Settings(d_dis=0.001, grid=2.0),
        Settings(grid=1e5),
        Settings(grid=0.05, d_dis=0.2),
        Settings(d_sec=0.0, edge=0.0, robot_radius=0.001),
        Settings(d_sec=100.0),
        Settings(edge=100.0),
        Settings(door_access=1e6),
        Settings(robot_radius=1e5),
        Settings(robot_radius=1e-6, door_access=1e-6),
        Settings(speed=1e-6, settle=1e6),
        Settings(d_sec=0.0, edge=0.0, range=0.5, robot_radius=0.3),
    ],
    ids=lambda options: ", ".join(changed(options)),
)
def test_extreme_parameters_are_planned_or_refused(options: Settings) -> None:
    floor = two_rooms(0.9) if options.grid > 0.05 else hall(2.5, 2.5)
    try:
        well_planned(floor, options)
    except StopgoError as error:
        assert "\n" not in str(error)


def test_hundreds_of_columns_are_planned() -> None:
    columns = [column(f"c{k}", 1.0 + (k % 50) * 1.5, 1.0 + (k // 50) * 1.5, 0.3) for k in range(200)]
    well_planned(
        hall(76, 7, *columns),
        Settings(coverage=0.3, grid=3.0, d_dis=0.3, d_sec=0.4, register=False),
        brute=False,
    )


# ---- floors at random ----

metres = st.integers(0, 40).map(lambda k: k / 4)
sizes = st.integers(1, 12).map(lambda k: k / 4)
points = st.tuples(metres, metres)


@st.composite
def boxes(draw: st.DrawFn) -> Polygon:
    (x, y), w, h = draw(points), draw(sizes), draw(sizes)
    return box(x, y, x + w, y + h)


@st.composite
def floors(draw: st.DrawFn) -> FloorPlan:
    """Boxes, columns, lines, doors and rooms anywhere on a quarter-metre lattice, at any angle."""
    kinds = st.sampled_from(["walls", "columns", "beams", "stairs", "windows", "railings"])
    solids = draw(st.lists(st.tuples(kinds, boxes()), max_size=8))
    lines = draw(st.lists(st.tuples(kinds, st.lists(points, min_size=2, max_size=4)), max_size=3))
    parts = [element(f"e{k}", kind, shape) for k, (kind, shape) in enumerate(solids)]
    parts += [element(f"l{k}", kind, lines=[line]) for k, (kind, line) in enumerate(lines)]
    rooms = draw(st.lists(boxes(), max_size=4))
    doors = draw(st.lists(st.tuples(points, points, st.sampled_from(["door", "passage"])), max_size=4))
    floor = floor_of(
        *draw(st.lists(boxes(), max_size=2)),
        box(0, 0, 10, draw(st.sampled_from([4.0, 10.0]))),
        rooms=[room(f"r{k}", shape) for k, shape in enumerate(rooms)],
        openings=[door(f"d{k}", a, b, kind=kind) for k, (a, b, kind) in enumerate(doors)],
        elements=[*parts, column("always", 5, 3)],
    )
    return moved(floor, turned(draw(st.sampled_from([0.0, 0.0, 17.0, 45.0]))))


@st.composite
def options(draw: st.DrawFn) -> Settings:
    return Settings(
        d_dis=draw(st.sampled_from([0.2, 0.5])),
        d_sec=draw(st.sampled_from([0.0, 0.25, 0.7])),
        edge=draw(st.sampled_from([0.0, 0.25, 0.35])),
        robot_radius=draw(st.sampled_from([None, 0.125, 0.25])),
        door_access=draw(st.sampled_from([0.5, 0.7])),
        doors=draw(st.sampled_from(["open", "closed"])),
        grid=draw(st.sampled_from([1.0, 2.0])),
        coverage=draw(st.sampled_from([0.5, 0.9, 1.0])),
        tour=draw(st.sampled_from([None, "closed", "open"])),
        start=draw(st.sampled_from([None, None, (1.0, 1.0, 0.0)])),
    )


def plan_or_refuse(floor: FloorPlan, chosen: Settings) -> Any:
    try:
        return well_planned(floor, chosen)
    except StopgoError as error:
        assert "\n" not in str(error)
        assert "does not clear" not in str(error)
        return None


@settings(
    max_examples=size(short=12, full=200),
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
@given(floors(), options())
def test_a_random_floor_is_planned_well_or_refused(floor: FloorPlan, chosen: Settings) -> None:
    plan_or_refuse(floor, chosen)
