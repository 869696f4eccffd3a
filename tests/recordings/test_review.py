"""`stopgo review` tells what recordings hold, with the exit codes of every command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mission.__main__ import main
from tests.recordings import run, world


def test_a_plan_in_json(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(plan), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["recording_id"] == told["mission_id"] == world.MISSION_ID
    assert (told["plan"]["candidates"], told["plan"]["stops"], told["plan"]["route_m"]) == (5, 2, 2.2)
    assert told["runs"] == []


def test_a_run_in_json(field: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(field), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["runs"]
    assert (told["run_id"], told["scanned"], told["ended"]) == (run.RUN, ["S1", "S2"], "Finished")
    assert told["deviation_m"] == {"S1": run.OFFSET, "S2": run.OFFSET}
    assert told["seconds"] == pytest.approx(129.4)


def test_both_for_a_person(plan: Path, field: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(plan), str(field)]) == 0
    text = capsys.readouterr().out
    assert "coverage: 0.7857" in text
    assert "greatest deviation 30.0 mm, at S1" in text


def test_junk_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "junk.rrd"
    path.write_bytes(b"junk" * 100)
    assert main(["review", str(path)]) == 2
    assert capsys.readouterr().err == f"stopgo: {path}: is not a Rerun recording\n"
