"""Recordings and journals of former versions stay readable, or are refused in one line."""

from __future__ import annotations

import json
import lzma
from pathlib import Path

import pytest

from stopgo.command_line import main

FILES = Path(__file__).parent / "files"
RUNS = {"field-2026-11-22": 1, "field-2026-11-24": 1, "field-0.2.0": 1}
"""Recordings of runs of the small room: two stops, each scanned 30 mm beside."""
REFUSED = {"field-2026-11-21": "as stopgo before 0.2 recorded it"}


def unpacked(name: str, folder: Path) -> Path:
    path = folder / name
    path.write_bytes(lzma.decompress((FILES / f"{name}.xz").read_bytes()))
    return path


@pytest.mark.parametrize("name", RUNS)
def test_a_run_of_a_former_version_is_reviewed(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["review", "--json", str(unpacked(f"{name}.rrd", tmp_path))]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert (run["scanned"], run["asked"], run["answer"]) == (2, 2, "yes")
    assert run["greatest_deviation_m"] == pytest.approx(0.03)
    assert run["driven_s"] == pytest.approx(129.4, abs=0.1)


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("command", ["review", "replay"])
def test_a_run_that_cannot_be_read_is_refused_in_one_line(
    name: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, str(unpacked(f"{name}.rrd", tmp_path))]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("stopgo: ")]
    assert REFUSED[name] in line


@pytest.mark.parametrize("name", ["plan-2026-11-24", "plan-0.2.0"])
def test_a_plan_of_a_former_version_reports_its_coverage(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = unpacked(f"{name}.rrd", tmp_path)
    field = unpacked("field-2026-11-24.rrd", tmp_path)
    main(["review", "--json", str(plan), str(field)])
    told = json.loads(capsys.readouterr().out)
    assert [item["runs"][0]["stops"][0]["stop"] for item in told["recordings"] if item["runs"]] == ["S1"]


def test_every_kept_file_is_tested() -> None:
    names = {path.name.removesuffix(".rrd.xz") for path in FILES.iterdir()}
    assert names == {*RUNS, *REFUSED, "plan-2026-11-24", "plan-0.2.0"}
