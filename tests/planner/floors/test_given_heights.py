"""Heights that a person gives for a drawing: what they hide is no longer claimed."""

from __future__ import annotations

import json
from pathlib import Path

import ezdxf
import pytest
from floor_drawings import new_drawing, rectangle

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.settings.given_heights import heights_by_kind
from stopgo.planner.floors import FloorOptions, read_floor


@pytest.fixture
def drawing(tmp_path: Path) -> Path:
    """Two rooms of 6 by 5 m with a door between, a cupboard before a wall, and a beam across one room."""
    made = new_drawing()
    model = made.modelspace()
    rectangle(model, "FLOOR", 0, 0, 12.2, 5)
    rectangle(model, "ROOMS", 0, 0, 6, 5)
    rectangle(model, "ROOMS", 6.2, 0, 12.2, 5)
    for x0, y0, x1, y1 in [
        *((-0.2, -0.2, 12.4, 0), (-0.2, 5, 12.4, 5.2), (-0.2, 0, 0, 5), (12.2, 0, 12.4, 5)),
        *((6, 0, 6.2, 2), (6, 3, 6.2, 5)),
    ]:
        rectangle(model, "WALLS", x0, y0, x1, y1)
    model.add_line((6.1, 2), (6.1, 3), dxfattribs={"layer": "DOORS"})
    rectangle(model, "OBJECTS", 1, 4.4, 3, 5)
    rectangle(model, "BEAMS", 8, 0, 8.3, 5)
    path = tmp_path / "plan.dxf"
    made.saveas(path)
    return path


def surface(path: Path, *heights: str) -> dict | None:
    out = path.parent / "plan"
    options = [word for entry in heights for word in ("--heights", entry)]
    few = ["--range", "9", "--no-refine"]
    assert main(["plan", str(path), "-o", str(out), *few, *options]) in (0, 1)
    return json.loads((out / "coverage.json").read_text()).get("surface")


def share(found: dict, kind: str) -> float:
    area = found["kinds"][kind]
    return area["seen_m2"] / area["total_m2"]


def test_heights_say_what_the_laser_and_the_robot_meet(drawing: Path) -> None:
    def items(**heights: tuple[float, float]) -> dict:
        floor = read_floor(drawing, FloorOptions(heights=heights))
        return {item.kind: item for item in floor.elements}

    low = items(objects=(0.0, 0.8), ceiling=(2.7, 2.7))["objects"]
    assert (low.heights, low.occludes, low.obstacle) == ((0.0, 0.8), False, True)
    tall, hung = items(objects=(0.0, 2.0))["objects"], items(objects=(1.9, 2.4))["objects"]
    assert (tall.occludes, tall.obstacle) == (True, True)
    assert (hung.occludes, hung.obstacle) == (False, False)
    assert items()["objects"].heights is None


def test_a_floor_without_given_heights_claims_nothing_by_height(drawing: Path) -> None:
    assert surface(drawing) is None
    assert read_floor(drawing).solids is None


def test_a_low_cupboard_hides_the_foot_of_its_wall(drawing: Path) -> None:
    bare = surface(drawing, "ceiling=2.7", "objects=0..0.05")
    full = surface(drawing, "ceiling=2.7", "objects=0..1.2")
    assert bare is not None and full is not None
    assert share(bare, "walls") > 0.97
    assert share(full, "walls") < share(bare, "walls") - 0.01


def test_lintels_and_the_ceiling_are_given_too(drawing: Path) -> None:
    floor = read_floor(drawing, FloorOptions(heights={"doors": (2.1, 2.1), "ceiling": (3.0, 3.0)}))
    assert floor.ceiling_m == 3.0 and floor.solids is not None
    at_door = floor.solids.triangles[abs(floor.solids.triangles[..., 0] - 6.1).max(axis=1) < 1e-6]
    assert sorted({round(float(z), 3) for z in at_door[..., 2].ravel()}) == [2.1, 3.0]
    assert any("doors 2.1 m, ceiling 3 m" in item.message for item in floor.findings)


def test_beams_that_no_ray_reaches_are_reported_and_not_counted(
    drawing: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = surface(drawing, "ceiling=2.7", "beams=2.4..2.7")
    assert bare is not None
    assert bare["hidden_m"] == pytest.approx(0.6)  # its two ends, at the walls
    assert share(bare, "beams") == 1.0
    made = ezdxf.readfile(drawing)
    rectangle(made.modelspace(), "OBJECTS", 6.25, 0.02, 12.15, 4.98)
    made.saveas(drawing)
    capsys.readouterr()
    hidden = surface(drawing, "ceiling=2.7", "beams=2.4..2.7", "objects=2..2.38")
    assert hidden is not None
    assert hidden["hidden_m"] > 9.0  # all but what a ray over the panel's edge reaches from the other room
    assert hidden["kinds"]["beams"]["total_m2"] < 1.2
    assert f"{hidden['hidden_m']:.1f} m of targets are hidden at every height" in capsys.readouterr().out


def test_a_proof_at_the_given_heights_agrees_with_the_plan(
    drawing: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("embreex")
    found = surface(drawing, "ceiling=2.7", "objects=0..1.2", "beams=2.4..2.7", "doors=2.1")
    assert found is not None
    mission = drawing.parent / "plan" / "mission.json"
    capsys.readouterr()
    # At the plan's own step: a wider one misses cells that the plan promises.
    main(["prove", str(mission), "--floor", str(drawing), "--solids", "model", "--json"])
    areas = json.loads(capsys.readouterr().out)["areas"]
    assert {item["kind"] for item in areas} == {"walls", "beams"}
    for item in areas:
        assert item["claimed"] == pytest.approx(item["shown"], abs=0.02), item


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("beam=2..3", "no such kind"),
        ("beams=3..2", "heights go upward"),
        ("beams=2.4", "write beams=LOW..HIGH"),
        ("beams=nan..3", "write beams=LOW..HIGH"),
        ("beams=-1..3", "heights go upward"),
        ("beams=1e9..2e9", "heights go upward"),
        ("ceiling=2..3", "write ceiling=2.1"),
        ("ceiling=0", "heights go upward"),
        ("", "no such kind"),
    ],
)
def test_a_height_that_is_none_is_refused(entry: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        heights_by_kind([entry])


def test_heights_above_the_ceiling_or_twice_are_refused() -> None:
    with pytest.raises(InputError, match=r"not below the ceiling at 2\.5 m"):
        heights_by_kind(["ceiling=2.5", "beams=2.5..2.8"])
    with pytest.raises(InputError, match="given twice"):
        heights_by_kind(["beams=2..3", "beams=2..3"])


def test_heights_do_not_apply_to_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "house.ifc").write_text("ISO-10303-21;\n")
    assert main(["floors", str(tmp_path / "house.ifc"), "--heights", "ceiling=2.5"]) == 2
    assert "--heights does not apply to a building model" in capsys.readouterr().err
