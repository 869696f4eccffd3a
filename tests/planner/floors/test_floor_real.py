"""Floors that nobody on this project drew, against counts taken from the files themselves."""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from floor_drawings import codes
from shapely import Polygon, union_all
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan, Room
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors import read_floor
from tests.faults.sizes import FULL, some

DATA = Path(__file__).parents[4] / "shared" / "data"
LATER = ("workshop-2019-10-29", "barcelona-plan", "barcelona-wrong-units", "office-l1-messy")
"""The workshop a year on; Barcelona, of which another is read; and what is read below anyhow."""
WILD = [path for path in sorted((DATA / "dxf").glob("*.dxf")) if FULL or path.stem not in LATER]

real = pytest.mark.skipif(not DATA.is_dir(), reason=f"the real inputs are not in {DATA}")

COUNTS = {
    # rooms, doors, passages, floor m², rooms m², walls m², elements
    "layered/office-l1": (59, 66, 2, 1790.0 - 8.76, 1705.2, 111.62, 383),
    "layered/fzk-haus-eg": (6, 5, 3, 120.0, 101.4, 11.67, 34),
    "layered/duplex-l1": (10, 6, 4, 180.5, 126.3, 24.03, 45),
    "paper/synthetic_case1_rooms": (11, 11, 0, 326.1, 300.7, 31.33, 57),
    "paper/synthetic_case1_structural": (0, 0, 0, 326.1, 0.0, 0.0, 168),
    "paper/synthetic_case2_rooms": (14, 14, 0, 184.65, 162.9, 24.77, 36),
    "paper/synthetic_case2_structural": (0, 0, 0, 184.65, 0.0, 0.0, 89),
}


@cache
def layered(name: str) -> FloorPlan:
    return read_floor(DATA / f"{name}.dxf")


@real
@pytest.mark.parametrize("name", COUNTS)
def test_a_layered_floor_has_what_its_file_holds(name: str) -> None:
    rooms, doors, passages, floor, inside, walls, elements = COUNTS[name]
    plan = layered(name)
    kinds = [opening.kind for opening in plan.openings]
    assert (len(plan.rooms), kinds.count("door"), kinds.count("passage")) == (rooms, doors, passages)
    assert plan.area == pytest.approx(floor, abs=0.05)
    assert sum(room.area for room in plan.rooms) == pytest.approx(inside, abs=0.05)
    solids = [solid for item in plan.elements if item.kind == "walls" for solid in item.solids]
    assert sum(solid.area for solid in solids) == pytest.approx(walls, abs=0.005)
    assert len(plan.elements) == elements
    assert set(codes(plan)) <= {"unknown_layer"}


@real
def test_the_office_has_its_names_holes_and_global_ids() -> None:
    plan = layered("layered/office-l1")
    with_holes = {room.name for room in plan.rooms for part in room.polygons if part.holes}
    assert with_holes == {"113 OPEN OFFICE", "115 TELE/COMM RM", "118 MECH RM", "140 OPEN OFFICE"}
    assert all(room.name and room.global_id for room in plan.rooms)
    assert len({room.global_id for room in plan.rooms}) == 59
    assert all(element.global_id for element in plan.elements if element.kind == "walls")


@real
@pytest.mark.parametrize("path", some(WILD, every=2), ids=lambda path: path.stem)
def test_a_drawing_from_the_wild_is_a_floor_or_one_line(path: Path) -> None:
    try:
        plan = read_floor(path)
    except InputError as error:
        assert str(path) in str(error)
        assert "\n" not in str(error)
    else:
        assert plan.outline


@real
def test_an_architects_export_has_the_rooms_of_its_model() -> None:
    """Open double lines, doors in mirrored blocks, survey coordinates; its truth is the layered office."""
    truth = layered("layered/office-l1")
    true = [room_shape(room) for room in truth.rooms]
    floor = read_floor(DATA / "dxf/office-l1-messy.dxf")
    rooms = [room_shape(room) for room in floor.rooms]
    off = lowest(truth) - lowest(floor)
    found = [translate(room, *off) for room in rooms]
    overlaps = [
        max(room.intersection(other).area / room.union(other).area for other in found) for room in true
    ]
    assert sum(overlap > 0.5 for overlap in overlaps) >= 58
    assert sum(overlap > 0.85 for overlap in overlaps) >= 52
    assert Counter(item.kind for item in floor.openings)["door"] == 66


def lowest(floor: FloorPlan) -> FloatArray:
    """The lower left corner of all walls (2,)."""
    solids = [solid.exterior for item in floor.elements if item.kind == "walls" for solid in item.solids]
    return np.concatenate(solids).min(axis=0)


def room_shape(room: Room) -> BaseGeometry:
    return union_all([Polygon(part.exterior, part.holes) for part in room.polygons])
