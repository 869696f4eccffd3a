"""Floors of any size: synthetic offices by seed, and copies of a real floor joined by corridors."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import ceil, sqrt

import numpy as np

from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.floor import Element, FloorPlan, Opening, Room
from stopgo.mission.geometry import FloatArray, Polygon, bounds, frozen
from stopgo.mission.settings.element_kinds import KINDS

WALL = 0.2
DOOR = 0.9
CORRIDOR = 2.2
DEPTH = 6.0
"""Depth of a room from its corridor, m."""

COLUMN_SIDES = 50
"""Corners of a round column."""


def office(width: float, height: float, *, seed: int) -> FloorPlan:
    """A floor of about width × height metres; bands of rooms, corridor, rooms, joined by a spine."""
    random = np.random.Generator(np.random.PCG64(seed))
    bands = max(1, round(height / (2 * DEPTH + CORRIDOR)))
    band = height / bands
    elements, rooms, openings = [], [], []
    for k in range(bands):
        _band(k * band, band, width, random, elements, rooms, openings)
    _outer(width, height, elements)
    return FloorPlan(
        name=f"office {width:.0f} x {height:.0f} m, seed {seed}",
        source=FloorSource("office.dxf", f"{seed:064x}"),
        outline=(_box(0, 0, width, height),),
        rooms=tuple(rooms),
        openings=tuple(openings),
        elements=tuple(elements),
    )


def _band(low, band, width, random, elements, rooms, openings) -> None:
    """Two rows of rooms along a corridor; the spine at the left joins the corridors."""
    below, above = low + (band - CORRIDOR) / 2, low + (band + CORRIDOR) / 2
    left = CORRIDOR
    edges = _edges(left, width, random)
    _add_wall(elements, _box(left, low - WALL / 2, width, low + WALL / 2))
    for wall_y, room_low, room_high in ((below, low, below), (above, above, low + band)):
        doors = []
        for a, b in pairwise(edges):
            door = float(random.uniform(a + 0.6, b - 0.6 - DOOR))
            doors.append(door)
            openings.append(_door(f"door-{len(openings)}", door, wall_y))
            rooms.append(_room(len(rooms), a, b, room_low, room_high))
            _add_columns(elements, a, b, room_low, room_high, random)
            _add_wall(elements, _box(b - WALL / 2, room_low, b + WALL / 2, room_high))
        _wall_with_doors(elements, edges[0], edges[-1], wall_y, doors)
    rooms.append(_room(len(rooms), WALL / 2, width, below, above))


def _edges(left: float, right: float, random) -> list[float]:
    """Positions of the walls between rooms 3.5 to 7 m wide."""
    edges = [left]
    while right - edges[-1] > 10.5:
        edges.append(edges[-1] + float(random.uniform(3.5, 7.0)))
    return [*edges, right]


def _box(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return Polygon.of([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _room(number: int, x0: float, x1: float, y0: float, y1: float) -> Room:
    half = WALL / 2
    return Room(f"room-{number}", "", (_box(x0 + half, y0 + half, x1 - half, y1 - half),))


def _door(name: str, x: float, y: float) -> Opening:
    return Opening(name, "door", frozen([(x, y), (x + DOOR, y)]))


def _add_wall(elements, box: Polygon) -> None:
    _add(elements, "walls", box)


def _add(elements, kind: str, box: Polygon) -> None:
    known = KINDS[kind]
    flags = {"occludes": known.occludes, "obstacle": known.obstacle, "target": known.target}
    elements.append(Element(f"{kind}-{len(elements)}", kind, (box,), **flags))


def _add_columns(elements, x0, x1, y0, y1, random) -> None:
    for _ in range(int(random.integers(0, 3))):
        x, y = random.uniform(x0 + 1.2, x1 - 1.6), random.uniform(y0 + 1.8, y1 - 2.2)
        _add(elements, "columns", _box(x, y, x + 0.4, y + 0.4))


def _wall_with_doors(elements, left, right, y, doors) -> None:
    starts = [left, *(door + DOOR for door in doors)]
    for a, b in zip(starts, [*doors, right], strict=True):
        _add_wall(elements, _box(a, y - WALL / 2, b, y + WALL / 2))


def _outer(width: float, height: float, elements) -> None:
    half = WALL / 2
    for box in (
        _box(0, -half, width, half),
        _box(0, height - half, width, height + half),
        _box(-half, 0, half, height),
        _box(width - half, 0, width + half, height),
    ):
        _add_wall(elements, box)


def hall(side: float = 150.0, columns: int = 17) -> FloorPlan:
    """A square hall with rows of round columns, 0.8 m wide."""
    elements: list[Element] = []
    _outer(side, side, elements)
    turn = np.arange(COLUMN_SIDES) * (2 * np.pi / COLUMN_SIDES)
    ring = 0.4 * np.column_stack([np.cos(turn), np.sin(turn)])
    middles = (np.arange(columns) + 0.5) * side / columns
    for x in middles:
        for y in middles:
            _add(elements, "columns", Polygon.of(ring + np.array([x, y])))
    return FloorPlan(
        name=f"hall of {columns**2} columns",
        source=FloorSource("hall.dxf", "0" * 64),
        outline=(_box(0, 0, side, side),),
        rooms=(Room("room-0", "HALL", (_box(0, 0, side, side),)),),
        openings=(),
        elements=tuple(elements),
    )


def copies(floor: FloorPlan, count: int) -> FloorPlan:
    """A floor `count` times in a square, joined by corridors west of and below the copies.

    The floor needs a door in its west side, such as layered/office-l1. A copy has names, and no GlobalIds,
    of its own.
    """
    low_x, low_y, high_x, high_y = bounds([part.exterior for part in floor.outline])
    pitch = np.array([high_x - low_x + CORRIDOR, high_y - low_y + CORRIDOR])
    columns = ceil(sqrt(count))
    shifts = [pitch * divmod(k, columns)[::-1] for k in range(count)]
    top = low_y + pitch[1] * divmod(count - 1, columns)[0] + high_y - low_y
    west = [low_x + pitch[0] * k for k in range(min(columns, count))]
    corridors = [_box(x - CORRIDOR, low_y, x, top) for x in west]
    return replace(
        floor,
        name=f"{floor.name}, {count} times",
        outline=(
            *(moved for shift in shifts for moved in _moved(floor.outline, shift)),
            *corridors,
            _box(low_x - CORRIDOR, low_y - CORRIDOR, west[-1], low_y),
        ),
        rooms=tuple(
            replace(
                room,
                id=f"{k}-{room.id}",
                name=f"{room.name}-{k}",
                polygons=_moved(room.polygons, shift),
                global_id=None,
            )
            for k, shift in enumerate(shifts)
            for room in floor.rooms
        ),
        openings=tuple(
            replace(opening, id=f"{k}-{opening.id}", line=frozen(opening.line + shift), global_id=None)
            for k, shift in enumerate(shifts)
            for opening in floor.openings
        ),
        elements=tuple(
            _copy(element, k, shift) for k, shift in enumerate(shifts) for element in floor.elements
        ),
        findings=(),
    )


def _copy(element: Element, k: int, shift: FloatArray) -> Element:
    """Copy `k` of an element."""
    return replace(
        element,
        id=f"{k}-{element.id}",
        solids=_moved(element.solids, shift),
        lines=tuple(frozen(line + shift) for line in element.lines),
        global_id=None,
    )


def _moved(polygons: tuple[Polygon, ...], shift: FloatArray) -> tuple[Polygon, ...]:
    return tuple(Polygon.of(one.exterior + shift, [hole + shift for hole in one.holes]) for one in polygons)
