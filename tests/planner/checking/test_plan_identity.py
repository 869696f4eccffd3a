"""Missions whose id, origin, frame or position on earth was changed after planning."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission, MissionAllocation
from stopgo.mission.files.mission_json import read, write
from stopgo.mission.frames.transform import SiteOrigin, Transform
from tests.planner.test_command import drawn

change = msgspec.structs.replace
ONE_OF_THREE = MissionAllocation(kind="robot", number=1, of=3)
ELSEWHERE = SiteOrigin(lat=47.0, lon=8.0, alt=400.0, heading_deg=0.0)


def with_parameter(mission: Mission, **parameters: Any) -> Mission:
    origin = mission.origin
    return change(mission, origin=change(origin, parameters={**origin.parameters, **parameters}))


def answer(
    mission: Path, floor: Path, capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[list[str], list[str]]:
    """Paths of the problems that `check` names, and its notes."""
    code = main(["check", str(mission), "--floor", str(floor), "--json", *more])
    found = json.loads(capsys.readouterr().out)
    assert code == (1 if found["problems"] else 0)
    return [problem["path"] for problem in found["problems"]], found["notes"]


@pytest.mark.parametrize(
    ("changed", "path"),
    [
        (lambda mission: change(mission, id="0" * 32), "$.id"),
        (lambda mission: with_parameter(mission, coverage=0.5), "$.id"),
        (lambda mission: with_parameter(mission, register=False), "$.id"),
        (lambda mission: change(mission, origin=change(mission.origin, stopgo="9.9")), "$.id"),
        (lambda mission: change(mission, share=ONE_OF_THREE), "$.share"),
        (lambda mission: change(mission, georeference=ELSEWHERE), "$.georeference"),
    ],
)
def test_an_identity_that_is_not_the_plans_is_named(
    made: Path, capsys: pytest.CaptureFixture[str], changed: Callable[[Mission], Mission], path: str
) -> None:
    floor = made.with_name("floor.dxf")
    assert answer(made, floor, capsys) == ([], [])
    write(changed(read(made)), made)
    assert answer(made, floor, capsys) == ([path], [])


def test_a_floor_of_another_name_is_a_note_and_one_that_coverage_contradicts_a_problem(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file may be renamed; a coverage.json that was written with the mission has the mission's floor."""
    renamed = shutil.copy(made.with_name("floor.dxf"), made.with_name("ground.dxf"))
    problems, notes = answer(made, renamed, capsys)
    assert problems == []
    assert [note.partition(": ")[0] for note in notes] == [
        "$.origin.floor is floor, this file's floor is called ground"
    ]
    mission = read(made)
    write(change(mission, origin=change(mission.origin, floor="attic")), made)
    coverage = made.with_name("coverage.json")
    written = json.loads(coverage.read_text())
    coverage.write_text(
        json.dumps({**written, "mission": {**written["mission"], "digest": read(made).digest}})
    )
    problems, _ = answer(made, made.with_name("floor.dxf"), capsys, "--coverage-file", str(coverage))
    assert problems == ["coverage $.floor"]


def test_a_place_in_a_robots_map_is_said_to_be_unchecked(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`align` writes any place, so that no floor can refute one."""
    mission = read(made)
    write(change(mission, frame=change(mission.frame, to_map=Transform(x=1.0, y=2.0, heading=0.5))), made)
    problems, notes = answer(made, made.with_name("floor.dxf"), capsys)
    assert problems == []
    assert [note.partition(",")[0] for note in notes] == ["$.frame.to_map is 1.000"]


def test_a_map_whose_picture_or_place_was_changed_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The digest is of map.yaml alone, so that another picture passed; a robot's map has its own frame."""
    floor = tmp_path / "map.yaml"
    assert main(["convert", str(drawn(tmp_path / "floor.dxf")), "-o", str(floor)]) == 0
    assert main(["plan", str(floor), "-o", str(tmp_path)]) == 0
    capsys.readouterr()
    mission, picture = tmp_path / "mission.json", tmp_path / "map.pgm"
    assert answer(mission, floor, capsys) == ([], [])
    planned = read(mission)
    write(change(planned, frame=change(planned.frame, to_map=Transform(x=1.0, y=0.0, heading=0.0))), mission)
    assert answer(mission, floor, capsys) == (["$.frame"], [])
    write(planned, mission)
    picture.write_bytes(picture.read_bytes()[:-1] + b"\x00")
    assert answer(mission, floor, capsys) == (["$.id"], [])


def test_a_plan_that_claims_nothing_was_changed(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without claims its coverage was not compared with what its parameters require: one stop was enough."""
    mission, floor = read(made), made.with_name("floor.dxf")
    for keys in (("new_units",), ("units", "new_units")):
        bare = [change(stop, sees=change(stop.sees, **dict.fromkeys(keys, 0))) for stop in mission.stops]
        write(change(mission, stops=tuple(bare[:1])), made)
        assert "$.stops[*].sees.new_units" in answer(made, floor, capsys)[0]


def test_what_depends_on_other_missions_is_a_note(
    tmp_path: Path, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The coverage required of a follow-up mission, and of one robot's share, no floor shows."""
    mission, floor = read(made), made.with_name("floor.dxf")
    further = change(with_parameter(mission, coverage=0.1), id="0" * 32, name=f"{mission.name}-top-up")
    write(further, made)
    problems, notes = answer(made, floor, capsys)
    assert problems == []
    assert [note.partition(" is ")[0] for note in notes] == ["$.name"]
    assert main(["plan", str(floor), "-o", str(tmp_path), "--robots", "2", "--start", "1,1,0"]) == 0
    capsys.readouterr()
    problems, notes = answer(tmp_path / "mission-2.json", floor, capsys)
    assert problems == []
    assert [note.partition(":")[0] for note in notes] == ["$.share is 2 of 2"]
