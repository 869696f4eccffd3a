"""Small floors for the planner's tests: boxes, walls with gaps, columns, doors; and ways to move a floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stopgo.mission.document import Mission
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.floor import Element, FloorPlan, Opening, Room
from stopgo.mission.geometry import FloatArray, Polygon, frozen
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner import plan
from stopgo.planner.floors import read_floor

SHARED = Path(__file__).parents[3] / "shared" / "data"
"""Real floors that are not part of the project; tests that use them skip where they are absent."""
PAPER = tuple(
    f"paper/synthetic_case{case}_{stage}.dxf" for case in (1, 2) for stage in ("rooms", "structural")
)
LAYERED = ("layered/duplex-l1.dxf", "layered/fzk-haus-eg.dxf", "layered/office-l1.dxf")
FLOORS = (*LAYERED, *PAPER)


@cache
def shared(name: str) -> FloorPlan:
    """A real floor, read once for all tests of a process."""
    if not (SHARED / name).exists():
        pytest.skip(f"{SHARED / name} is not there")
    return read_floor(SHARED / name)


Points = Iterable[tuple[float, float]]
Move = Callable[[FloatArray], FloatArray]


def box(x0: float, y0: float, x1: float, y1: float, *holes: Points) -> Polygon:
    """The rectangle from (x0, y0) to (x1, y1), minus holes."""
    return Polygon.of([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], [list(hole) for hole in holes])


def corners(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    """The corners of a rectangle, as a hole of another shape."""
    return [(x0, y0), (x0, y1), (x1, y1), (x1, y0)]


def element(id: str, kind: str, *solids: Polygon, lines: Iterable[Points] = ()) -> Element:
    """An element with the defaults of its kind."""
    known = KINDS[kind]
    return Element(
        id=id,
        kind=kind,
        solids=tuple(solids),
        lines=tuple(frozen(list(line)) for line in lines),
        occludes=known.occludes,
        obstacle=known.obstacle,
        target=known.target,
    )


def wall(id: str, *solids: Polygon) -> Element:
    return element(id, "walls", *solids)


def column(id: str, x: float, y: float, side: float = 0.4) -> Element:
    """A square column round (x, y)."""
    half = side / 2
    return element(id, "columns", box(x - half, y - half, x + half, y + half))


def shell(x0: float, y0: float, x1: float, y1: float, *, thick: float = 0.2, id: str = "shell") -> Element:
    """Walls all round the rectangle, outside it."""
    outer = box(x0 - thick, y0 - thick, x1 + thick, y1 + thick, corners(x0, y0, x1, y1))
    return wall(id, outer)


def room(id: str, *polygons: Polygon, name: str = "") -> Room:
    return Room(id=id, name=name or id, polygons=tuple(polygons))


def door(id: str, a: tuple[float, float], b: tuple[float, float], *, kind: str = "door") -> Opening:
    return Opening(id=id, kind=kind, line=frozen([a, b]))


def floor_of(
    *outline: Polygon,
    rooms: Iterable[Room] = (),
    openings: Iterable[Opening] = (),
    elements: Iterable[Element] = (),
    name: str = "test",
) -> FloorPlan:
    return FloorPlan(
        name=name,
        source=FloorSource("test.dxf", "0" * 64),
        outline=tuple(outline),
        rooms=tuple(rooms),
        openings=tuple(openings),
        elements=tuple(elements),
    )


def hall(width: float = 6.0, depth: float = 4.0, *more: Element, **parts: Any) -> FloorPlan:
    """One walled room from (0, 0) to (width, depth), with whatever else stands in it."""
    inside = box(0, 0, width, depth)
    parts.setdefault("rooms", (room("hall", inside),))
    return floor_of(inside, elements=(shell(0, 0, width, depth), *more), **parts)


def two_rooms(
    gap: float, *, thick: float = 0.2, at: float = 2.0, with_door: bool = True, more: Iterable[Element] = ()
) -> FloorPlan:
    """Rooms of 4 × 4 m left and right of a wall with a gap whose middle is at y = `at`.

    The wall's middle is at x = 4; the floor runs through under it.
    """
    left, right = 4 - thick / 2, 4 + thick / 2
    low, high = at - gap / 2, at + gap / 2
    openings = (door("d", (4, low), (4, high)),) if with_door else ()
    return floor_of(
        box(0, 0, 8, 4),
        rooms=(room("left", box(0, 0, left, 4)), room("right", box(right, 0, 8, 4))),
        openings=openings,
        elements=(
            shell(0, 0, 8, 4),
            wall("south", box(left, 0, right, low)),
            wall("north", box(left, high, right, 4)),
            *more,
        ),
    )


def moved(floor: FloorPlan, move: Move) -> FloorPlan:
    """The floor with every point moved; rings keep their turning sense."""

    def polygon(shape: Polygon) -> Polygon:
        return Polygon.of(move(shape.exterior), [move(hole) for hole in shape.holes])

    return replace(
        floor,
        outline=tuple(polygon(shape) for shape in floor.outline),
        rooms=tuple(replace(r, polygons=tuple(map(polygon, r.polygons))) for r in floor.rooms),
        openings=tuple(replace(o, line=frozen(move(o.line))) for o in floor.openings),
        elements=tuple(
            replace(e, solids=tuple(map(polygon, e.solids)), lines=tuple(frozen(move(x)) for x in e.lines))
            for e in floor.elements
        ),
    )


def turned(degrees: float) -> Move:
    """Rotation round the origin."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return lambda xy: np.asarray(xy) @ np.array([[c, s], [-s, c]])


def shifted(x: float, y: float) -> Move:
    return lambda xy: np.asarray(xy) + np.array([x, y])


def mirrored(xy: FloatArray) -> FloatArray:
    """Left and right exchanged."""
    return np.asarray(xy) * np.array([-1.0, 1.0])


def planned(floor: FloorPlan, settings: Settings | None = None) -> tuple[Mission, dict[type, Any]]:
    """The mission and every noun on the way to it."""
    nouns: dict[type, Any] = {}

    def observe(noun: Any) -> None:
        nouns[type(noun)] = noun

    return plan(floor, settings or Settings(), observe=observe).mission, nouns


@cache
def mission_of_hall() -> Mission:
    """The mission of a hall of 6 m by 4 m, planned once."""
    return planned(hall(6, 4))[0]


def changed(settings: Settings) -> list[str]:
    """The settings that are not the default."""
    values = {key: getattr(settings, key) for key in PARAMETERS}
    return [f"{key}={value}" for key, value in values.items() if value != getattr(Settings(), key)]
