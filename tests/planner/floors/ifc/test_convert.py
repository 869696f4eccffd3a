"""A storey as a layered drawing is the same floor; every storey of a model is planned into its own folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import stopgo.planner.commands.storeys
from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.planner.commands.storeys import Planned, folder_names, plan_storeys
from stopgo.planner.floors import read_floor, survey_floor
from stopgo.planner.floors.survey import FloorChoice
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import two_rooms


def parts(floor: FloorPlan) -> list[Any]:
    def rings(polygons: tuple[Polygon, ...]) -> list[Any]:
        return [[ring.tolist() for ring in polygon.rings] for polygon in polygons]

    return [
        rings(floor.outline),
        [(room.id, room.name, room.global_id, rings(room.polygons)) for room in floor.rooms],
        [(item.id, item.kind, item.global_id, item.line.tolist()) for item in floor.openings],
        [(item.id, item.kind, item.global_id, rings(item.solids)) for item in floor.elements],
    ]


@pytest.fixture
def house_file(read: Read, tmp_path: Path) -> Path:
    read(two_rooms())
    return tmp_path / "house.ifc"


def test_the_drawing_of_a_storey_is_the_same_floor(
    house_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], read: Read
) -> None:
    out = tmp_path / "eg.dxf"
    assert main(["convert", str(house_file), "--storey", "EG", "-o", str(out)]) == 0
    assert "eg.dxf: house EG, 36 m², 2 rooms" in capsys.readouterr().out
    assert parts(read_floor(out)) == parts(read(two_rooms_again(house_file)))
    first = out.read_bytes()
    assert main(["convert", str(house_file), "--storey", "EG", "-o", str(out)]) == 0
    assert out.read_bytes() == first


def two_rooms_again(path: Path) -> Any:
    """Argument of `read` for a house: the file that exists already, unchanged."""

    class Written:
        def write(self, _: Path) -> Path:
            return path

    return Written()


def test_what_is_no_dxf_is_not_written(house_file: Path, tmp_path: Path) -> None:
    assert main(["convert", str(house_file), "-o", str(tmp_path / "eg.svg")]) == 2
    assert not (tmp_path / "eg.svg").exists()


class InThisProcess:
    """A pool that is none."""

    def __init__(self, *_: object, **__: object) -> None: ...

    def shutdown(self, **_: object) -> None: ...

    map = staticmethod(map)


def test_every_storey_that_people_walk_on_is_planned_into_its_folder(
    house_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopgo.planner.commands.storeys, "ProcessPoolExecutor", InThisProcess)
    asked: list[tuple[Path, str | None]] = []

    def plan_one(floor: Path, folder: Path, settings: Settings) -> Planned:
        asked.append((folder, settings.storey))
        return 1, "no candidate", []

    assert plan_storeys(house_file, tmp_path, Settings(), plan_one, as_json=False) == 1
    assert asked == [(tmp_path / "EG", "EG")]  # OG is a roof
    assert "no candidate" in capsys.readouterr().out
    with pytest.raises(InputError, match="--all-storeys and a storey are both given"):
        plan_storeys(house_file, tmp_path, Settings(storey="EG"), plan_one, as_json=False)


def test_a_floor_with_doors_that_is_left_out_ends_in_a_no(
    house_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    storeys = stopgo.planner.commands.storeys
    monkeypatch.setattr(storeys, "ProcessPoolExecutor", InThisProcess)
    survey = survey_floor(house_file)
    low = FloorChoice("UG", "--storey UG", -1.2, aside=True, reason="nobody walks there", has_rooms=True)

    def plan_one(floor: Path, folder: Path, settings: Settings) -> Planned:
        return 0, "planned", []

    assert plan_storeys(house_file, tmp_path, Settings(), plan_one, as_json=False) == 0  # a roof is no floor
    assert "left out: OG (36 m²): nothing above it" in capsys.readouterr().out
    found = replace(survey, floors=(low, *survey.floors))
    monkeypatch.setattr(storeys, "survey_floor", lambda *_: found)
    assert plan_storeys(house_file, tmp_path, Settings(), plan_one, as_json=False) == 1
    assert "left out: UG: nobody walks there; --storey UG" in capsys.readouterr().out
    monkeypatch.setattr(storeys, "survey_floor", lambda *_: replace(survey, floors=(low,)))
    with pytest.raises(
        InputError, match=r"no storey that is planned without --storey \(UG: nobody walks there\)"
    ):
        plan_storeys(house_file, tmp_path, Settings(), plan_one, as_json=False)


def test_folders_have_names_that_any_file_system_takes_and_no_two_the_same() -> None:
    names = folder_names(["Level 1", "level/1", "../..", "Étage", "a" * 300])
    assert names == ["Level-1", "level-1-2", "storey-3", "Étage", "a" * 60]
