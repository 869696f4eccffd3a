"""Area that stops see by a model's solids: furniture, lintels and ceilings hide what lies behind them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.ifc import loading
from tests.planner.floors.ifc.conftest import Read, in_process
from tests.planner.floors.ifc.house import House, two_rooms


def planned(path: Path, *more: str) -> dict:
    out = path.parent / "plan"
    few = ["--range", "8", "--no-refine", "--no-sheets"]
    assert main(["plan", str(path), "--storey", "EG", "-o", str(out), *few, *more]) == 0
    return json.loads((out / "coverage.json").read_text())["surface"]


def share(surface: dict, kind: str = "walls") -> float:
    area = surface["kinds"][kind]
    return area["seen_m2"] / area["total_m2"]


def with_box(house: House, name: str, box: tuple[float, ...], ifc_class: str = "IfcFurniture") -> House:
    house.box(ifc_class, name, box, house.model.by_type("IfcBuildingStorey")[0])
    return house


@pytest.fixture(scope="module")
def boarded(models: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """Model of two rooms with a low board before a wall, and the surface of its plan; they are only read."""
    path = with_box(two_rooms(), "board", (4.2, 3.3, 0, 9.5, 3.5, 1.0)).write(
        tmp_path_factory.mktemp("boarded") / "house.ifc"
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loading, "_run", in_process)
        return path, planned(path, "--no-register")


def test_bare_rooms_are_seen_over_their_whole_height(read: Read, tmp_path: Path) -> None:
    read(two_rooms())
    assert share(planned(tmp_path / "house.ifc")) > 0.97


def test_a_low_board_before_a_wall_hides_its_foot(boarded: tuple[Path, dict]) -> None:
    covered = share(boarded[1])
    assert 0.80 < covered < 0.97


def test_a_hung_ceiling_hides_the_walls_above_it(read: Read, tmp_path: Path) -> None:
    read(two_rooms())
    bare = planned(tmp_path / "house.ifc", "--coverage", "1")
    read(with_box(two_rooms(), "ceiling", (0, 0, 2.0, 20, 20, 2.05), "IfcCovering"))
    hung = planned(tmp_path / "house.ifc", "--coverage", "1")
    assert hung["kinds"]["walls"]["total_m2"] == pytest.approx(bare["kinds"]["walls"]["total_m2"], rel=0.05)
    assert share(bare) - share(hung) > 0.15


def test_the_sides_between_two_beams_are_not_seen(read: Read, tmp_path: Path) -> None:
    def seen(between: float) -> float:
        house = with_box(two_rooms(), "beam", (1.0, 1.0, 2.3, 3.0, 1.2, 2.5), "IfcBeam")
        beside = (1.0, 1.2 + between, 2.3, 3.0, 1.4 + between, 2.5)
        read(with_box(house, "beside", beside, "IfcBeam"))
        coarse = ["--grid", "1", "--d-dis", "0.1"]
        surface = planned(tmp_path / "house.ifc", "--no-register", "--coverage", "1", *coarse)
        return surface["kinds"]["beams"]["seen_m2"]

    apart = seen(0.6)
    for gap in (0.0, 0.03):
        assert seen(gap) < apart - 0.9 * 2 * 0.2 * 2.0 + 0.01, gap


def test_beams_above_a_ceiling_are_no_targets(read: Read, tmp_path: Path) -> None:
    house = with_box(two_rooms(), "beam", (1.0, 1.0, 2.3, 3.0, 1.2, 2.5), "IfcBeam")
    read(house)
    options = FloorOptions(storey="EG")
    assert any(item.kind == "beams" for item in read_floor(tmp_path / "house.ifc", options).elements)
    read(with_box(house, "ceiling", (0, 0, 2.1, 20, 20, 2.15), "IfcCovering"))
    floor = read_floor(tmp_path / "house.ifc", options)
    assert not any(item.kind == "beams" for item in floor.elements)
    (told,) = [item.message for item in floor.findings if item.code == "hidden_beams"]
    assert "of beams: they are no targets" in told


def test_elements_have_the_heights_of_their_bodies(boarded: tuple[Path, dict]) -> None:
    floor = read_floor(boarded[0], FloorOptions(storey="EG"))
    heights = {item.heights for item in floor.elements if item.kind == "other"}
    assert heights == {(0.0, 1.0)}


def test_leaves_and_panes_stop_no_ray_of_a_model(read: Read, tmp_path: Path) -> None:
    read(two_rooms())
    solids = read_floor(tmp_path / "house.ifc", FloorOptions(storey="EG")).solids
    assert solids is not None
    assert np.isfinite(solids.triangles).all()
    assert solids.triangles[..., 2].min() >= -3.0


def test_a_drawing_has_no_solids(tmp_path: Path) -> None:
    from floor_drawings import new_drawing, rectangle

    drawing = new_drawing()
    rectangle(drawing.modelspace(), "A-WALL", 0, 0, 6, 5)
    drawing.saveas(tmp_path / "plan.dxf")
    assert read_floor(tmp_path / "plan.dxf").solids is None


@pytest.mark.usefixtures("no_pairs")
def test_a_proof_at_the_models_solids_agrees_with_the_plan(
    boarded: tuple[Path, dict], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("embreex")
    mission, floor = copied(boarded[0], tmp_path)
    step = ["--angular-step", "0.5", "--json"]
    main(["prove", mission, "--floor", floor, "--solids", "model", *step])
    proof = json.loads(capsys.readouterr().out)
    (walls,) = [item for item in proof["areas"] if item["kind"] == "walls"]
    assert walls["claimed"] == pytest.approx(walls["shown"], abs=0.02)
    assert proof["simulation"]["solids"] == "model"


def copied(model: Path, into: Path) -> tuple[str, str]:
    """A copy of a model's plan, for a proof to write beside it; the mission's path and the model's."""
    shutil.copytree(model.parent / "plan", into / "plan")
    return str(into / "plan" / "mission.json"), str(model)


@pytest.mark.usefixtures("no_pairs")
def test_a_plan_that_claims_more_than_the_model_shows_is_not_met(
    boarded: tuple[Path, dict], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("embreex")
    mission, floor = copied(boarded[0], tmp_path)
    surface = boarded[1]
    seen = surface["kinds"]["walls"]["seen_m2"]
    coverage = tmp_path / "plan" / "coverage.json"
    text = coverage.read_text().replace(
        f'"seen_m2":{seen}', f'"seen_m2":{surface["kinds"]["walls"]["total_m2"]}'
    )
    coverage.write_text(text)
    capsys.readouterr()
    assert main(["prove", mission, "--floor", floor, "--solids", "model", "--angular-step", "1"]) == 1
    assert "area of walls: 100.0 % claimed, the model's solids show" in capsys.readouterr().out


@pytest.mark.parametrize("scanner", [[], ["--scanner-height", "1.6"]])
def test_a_leaning_wall_is_acquired_where_the_plan_promises_it(
    scanner: list[str], read: Read, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The floor is cut at 1.3 m, wherever the scanner is."""
    pytest.importorskip("embreex")
    house = two_rooms()
    bare = planned_walls(read, house, tmp_path, scanner)
    storey = house.model.by_type("IfcBuildingStorey")[0]
    house.box("IfcWall", "leaning", (0.6, 0.2, 0, 0.8, 4.2, 2.8), storey, aside=0.8)
    walls = planned_walls(read, house, tmp_path, scanner)
    assert walls["total_m2"] < bare["total_m2"] - 8, "the slope hides the west wall and has no upright area"
    capsys.readouterr()
    mission, floor = str(tmp_path / "plan" / "mission.json"), str(tmp_path / "house.ifc")
    # The plan's own step: a wider one misses cells of the slope that the plan promises.
    step = ["--angular-step", "0.1", "--json"]
    assert main(["prove", mission, "--floor", floor, "--solids", "model", *step]) == 0
    proof = json.loads(capsys.readouterr().out)
    (area,) = [item for item in proof["areas"] if item["kind"] == "walls"]
    assert area["claimed"] == pytest.approx(area["shown"], abs=0.02)
    assert area["total_m2"] == pytest.approx(area["claimed_m2"], rel=0.05)
    (promised,) = [item for item in proof["kinds"] if item["name"] == "walls"]
    assert promised["beyond"] < 1, "the far side of the wall is not acquired"
    assert promised["kept"] == pytest.approx(promised["promised"], abs=0.1)


def planned_walls(read: Read, house: House, tmp_path: Path, scanner: Sequence[str] = ()) -> dict:
    read(house)
    return planned(tmp_path / "house.ifc", "--coverage", "1", *scanner)["kinds"]["walls"]


@pytest.mark.usefixtures("no_pairs")
def test_what_lies_between_two_rays_is_not_acquired_and_not_claimed(
    read: Read, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rays 2° apart are 7 to 28 cm apart at 2 to 8 m: they miss many units of 5 cm, seen from two rooms."""
    pytest.importorskip("embreex")
    read(two_rooms())
    options = ["--angular-step", "2", "--density", "400", "--min-views", "2", "--max-incidence", "90"]
    planned(tmp_path / "house.ifc", *options)
    capsys.readouterr()
    mission, floor = str(tmp_path / "plan" / "mission.json"), str(tmp_path / "house.ifc")
    main(["prove", mission, "--floor", floor, "--solids", "model", "--json"])
    proof = json.loads(capsys.readouterr().out)
    (walls,) = [item for item in proof["areas"] if item["kind"] == "walls"]
    assert walls["shown"] < 0.95
    assert walls["claimed"] == pytest.approx(walls["shown"], abs=0.02)
