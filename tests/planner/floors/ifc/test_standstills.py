"""Finished plans against the model's own bodies: an error of the sections does not pass unseen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.planner.floors import FloorOptions, standing_bodies
from stopgo.planner.floors.ifc import storey_plan
from stopgo.planner.floors.ifc.solids import solids_on
from stopgo.planner.floors.standing_body import StandingBody
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms


def with_bed() -> House:
    """Two rooms with a bed of 2.4 × 3.4 m in the middle of the left one."""
    house = two_rooms()
    house.box(
        "IfcFurniture", "bed", (4.9, 0.9, 0, 7.3, 3.5, 0.5), house.model.by_type("IfcBuildingStorey")[0]
    )
    return house


def without_furniture(*given: object) -> list[object]:
    """The sections of a planner that overlooks furniture."""
    return [item for item in solids_on(*given) if item.product.role != "furniture"]  # type: ignore[arg-type]


def planned(path: Path, *more: str) -> int:
    few = ["--range", "6", "--no-sheets"]
    return main(["plan", str(path), "--storey", "EG", "-o", str(path.parent / "plan"), *few, *more])


def test_the_bodies_of_a_floor_are_those_in_the_robots_height(read: Read, tmp_path: Path) -> None:
    house = with_bed()
    read(house)
    names = {
        body.name.split()[-1] for body in standing_bodies(tmp_path / "house.ifc", FloorOptions(storey="EG"))
    }
    assert names == {
        f"'{name}'" for name in ("south", "north", "west", "east", "middle", "window", "column", "bed")
    }


def test_a_point_in_a_body_is_in_it(read: Read, tmp_path: Path) -> None:
    house = two_rooms()
    read(house)
    found = standing_bodies(tmp_path / "house.ifc", FloorOptions(storey="EG"))
    (column,) = [body for body in found if "column" in body.name]
    assert column.encloses(2.01, 2.17)
    assert not column.encloses(2.21, 2.17)
    assert min(face.distance(face) for face in column.faces) == 0


def test_a_point_below_an_edge_of_a_lintel_is_not_in_it() -> None:
    under = [[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]
    above = [[(0, 0), (1, 0), (1, 0.7)], [(0, 0), (1, 0.7), (1, 1)], [(0, 0), (1, 1), (0, 1)]]
    faces = [[(*xy, z) for xy in face] for z, half in ((2.0, under), (2.5, above)) for face in half]
    lintel = StandingBody("lintel", (), np.array(faces), height=1.0)
    assert not lintel.encloses(0.5, 0.35)
    assert not lintel.encloses(0.5, 0.5)


def test_a_plan_that_keeps_its_clearances_passes(
    read: Read, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    read(two_rooms())
    assert planned(tmp_path / "house.ifc") == 0
    assert "too near" not in capsys.readouterr().out
    mission = tmp_path / "plan" / "mission.json"
    assert main(["check", str(mission), "--floor", str(tmp_path / "house.ifc")]) == 0


def test_a_plan_that_overlooks_a_body_ends_with_exit_code_1_and_its_name(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    house = with_bed()
    read(house)
    guid = house.things["bed"].GlobalId
    monkeypatch.setattr(storey_plan, "solids_on", without_furniture)
    assert planned(tmp_path / "house.ifc", "--all-parts") == 1
    assert f"IfcFurniture {guid} 'bed' of the model" in capsys.readouterr().out
    mission = tmp_path / "plan" / "mission.json"
    assert main(["check", str(mission), "--floor", str(tmp_path / "house.ifc")]) == 1
    assert guid in capsys.readouterr().out
