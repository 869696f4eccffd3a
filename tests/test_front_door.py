"""`import stopgo`: typed, documented, quick to import, and aware of what stands in front of its folders."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import stopgo
from stopgo.command_line import front_door, main
from stopgo.mission.errors import InputError
from stopgo.mission.plan import Plan
from stopgo.renamed_options import RENAMED, NewName, with_new_names

ROOT = Path(__file__).parents[1]
OFFICE = ROOT / "recordings" / "samples" / "office.dxf"


@pytest.mark.parametrize("name", stopgo.__all__)
def test_every_public_function_is_documented_and_typed(name: str) -> None:
    function = getattr(stopgo, name)
    assert inspect.getdoc(function)
    signature = inspect.signature(function)
    assert signature.return_annotation is not inspect.Signature.empty
    for parameter in signature.parameters.values():
        assert parameter.annotation is not inspect.Parameter.empty, parameter


def test_the_guide_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "recordings").symlink_to(ROOT / "recordings", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "how-to" / "python.md").read_text(encoding="utf-8")
    known: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(block, known)
    plan = known["plan"]
    assert isinstance(plan, Plan)
    assert repr(plan).count("\n") == 0
    assert plan._repr_svg_().startswith("<?xml")
    assert (tmp_path / "stops.csv").exists()
    assert stopgo.read_mission("mission.json") == plan.mission


def test_paths_may_be_text_and_settings_are_given_once() -> None:
    floor = stopgo.read_floor(str(OFFICE))
    assert np.isclose(floor.area, stopgo.read_floor(OFFICE).area)
    with pytest.raises(TypeError, match="not both: range"):
        stopgo.plan(floor, stopgo.settings(), range=8.0)
    with pytest.raises(InputError, match="rnage"):
        stopgo.plan(floor, rnage=8.0)


def test_importing_it_loads_nothing_slow() -> None:
    slow = {"numpy", "shapely", "zenoh", "rerun", "typer"}
    code = f"import sys, stopgo; print(sorted({slow} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_name_that_is_not_text_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Linux lets a name be any bytes; one that cannot be printed is refused before a file is written."""
    assert main(["check", "caf\udce9.json", "--json"]) == 2
    told = capsys.readouterr()
    line = "caf\ufffd.json: is not UTF-8 text; rename the file or folder"
    assert told.err == f"stopgo: {line}\n"
    assert json.loads(told.out) == {"error": {"message": line, "exit_code": 2}}


@pytest.mark.parametrize(
    ("given", "today", "line"),
    [
        (
            ("robot", "--endurance", "2"),
            ["robot", "--battery-life=2h"],
            "is now called --battery-life",
        ),
        (("robot", "--endurance=0.5"), ["robot", "--battery-life=0.5h"], "--endurance is now called"),
        (
            ("plan", "f.dxf", "--views=2"),
            ["plan", "f.dxf", "--min-views=2"],
            "now called --min-views",
        ),
        (
            ("pause", "--stop", "s01", "--robot", "r1"),
            ["pause", "--robot", "r1"],
            "no effect on pause",
        ),
        (("abort", "--take-over", "--json"), ["abort", "--json"], "--take-over has no effect on abort"),
        (("start", "--take-over"), ["start", "--take-over"], ""),
        (("plan", "--", "--views"), ["plan", "--", "--views"], ""),
    ],
)
def test_an_old_option_is_taken_with_a_line(given: tuple[str, ...], today: list[str], line: str) -> None:
    words, lines = with_new_names(list(given))
    assert words == today
    assert [text for text in lines if line not in text] == []
    assert bool(lines) == bool(line)


@pytest.mark.parametrize(("command", "old"), [(word, old) for word, olds in RENAMED.items() for old in olds])
def test_a_command_has_the_new_option_and_not_the_old_one(command: str, old: str) -> None:
    made = front_door().commands[command]
    subcommands = getattr(made, "commands", {command: made}).values()
    options = {name for item in subcommands for param in item.params for name in param.opts}
    assert old not in options
    new = RENAMED[command][old]
    assert not isinstance(new, NewName) or new.option in options


@pytest.mark.parametrize("given", [("--mavlink", "udpout:127.0.0.1:14550"), ("--mavlink=tcp:1.2.3.4:5",)])
def test_home_names_what_a_vehicle_can_do_instead(
    given: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["home", *given]) == 2
    line = capsys.readouterr().err
    assert line.startswith("stopgo: --mavlink has no meaning with home: ") and line.count("\n") == 1
    assert "stopgo abort --mavlink" in line
    assert main(["home"]) == 2
    assert "add --robot NAME (or preset" in capsys.readouterr().err
