"""Synthetic office floors of any size, by seed: rooms on both sides of corridors, doors, columns."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stopgo.mission.floor import Element, FloorPlan, Opening, Room
from stopgo.mission.floor_source import FloorSource
from stopgo.mission.geometry import Polygon, frozen
from stopgo.mission.settings.element_kinds import KINDS

WALL = 0.2
DOOR = 0.9
CORRIDOR = 2.2
DEPTH = 6.0
"""Depth of a room from its corridor, m."""


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
