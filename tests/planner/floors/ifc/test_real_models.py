"""Real models next to the layered drawings made of them: the same rooms, doors and walls."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.rings import to_shapely
from tests.faults.sizes import FULL

DATA = Path(__file__).parents[5] / "shared" / "data"
PAIRS = {
    "fzk-haus": ("Erdgeschoss", "fzk-haus-eg"),
    "office": ("Level 1", "office-l1"),
    "duplex": ("Level 1", "duplex-l1"),
}


@pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not there")
@pytest.mark.parametrize("name", PAIRS if FULL else ["fzk-haus"])
def test_a_model_has_the_rooms_walls_and_doors_of_its_layered_drawing(name: str, models: Path) -> None:
    storey, drawing = PAIRS[name]
    made = read_floor(DATA / "ifc" / f"{name}.ifc", FloorOptions(storey=storey))
    truth = read_floor(DATA / "layered" / f"{drawing}.dxf")
    assert _room_areas(made) == pytest.approx(_room_areas(truth), abs=0.02)
    hides = any(finding.code == "hidden_beams" for finding in made.findings)
    for kind in ("walls", "columns") if hides else ("walls", "columns", "beams"):
        assert _area(made, kind) == pytest.approx(_area(truth, kind), rel=0.01)
    assert not hides or _area(made, "beams") < _area(truth, "beams"), "the drawing knows no ceilings"
    assert _doors(made) == _doors(truth)


def _room_areas(floor: FloorPlan) -> dict[str | None, float]:
    return {room.global_id: room.area for room in floor.rooms}


def _area(floor: FloorPlan, kind: str) -> float:
    return sum(to_shapely(part).area for item in floor.elements if item.kind == kind for part in item.solids)


def _doors(floor: FloorPlan) -> set[str | None]:
    return {item.global_id for item in floor.openings if item.kind == "door"}
