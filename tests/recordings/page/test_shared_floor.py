"""Runs of missions that share a floor: each did its part, and the floor is judged by all of them together."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import read
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings import run
from tests.recordings.conftest import tell
from tests.recordings.replay.test_as_driven import PLAN, drawn


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two missions of one floor, each with its plan and a run to its end; the second also with a skip."""
    folder = tmp_path_factory.mktemp("shared")
    floor = str(drawn(folder / "floor.dxf"))
    assert main(["plan", floor, "-o", str(folder), *PLAN, "--robots", "2", "--start", "1,1,0"]) == 0
    missions = [read(folder / name) for name in ("mission.json", "mission-2.json")]
    for number, mission in enumerate(missions, start=1):
        recorded(folder / f"field-{number}.rrd", mission, f"{number}" * 12)
    recorded(folder / "lost.rrd", missions[1], "3" * 12, skipped=missions[1].stops[0].id)
    return folder


def recorded(path: Path, mission: Mission, run_id: str, skipped: str | None = None) -> None:
    told = run.reports(mission, run=run_id) if skipped is None else run.reports_with_a_skip(mission, skipped)
    with FieldRecording(path, mission) as recording:
        for report in told:
            tell(recording, report)


def reviewed(
    folder: Path, names: Sequence[str], capsys: pytest.CaptureFixture[str], *more: str
) -> tuple[int, str]:
    capsys.readouterr()
    code = main(["review", *(str(folder / f"{name}.rrd") for name in names), *more])
    return code, capsys.readouterr().out


def test_a_run_of_one_of_two_missions_did_its_part(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text = reviewed(folder, ["plan", "field-1"], capsys)
    assert code == 0
    assert "The required coverage applies to all 2 missions of the floor together." in text
    assert "too little" not in text
    assert "Give also the recordings of mission 2: they share the floor." in text
    assert "--top-up" not in text


def test_both_missions_are_judged_together(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["plan", "field-1", "plan-2", "field-2"]
    code, text = reviewed(folder, names, capsys)
    assert code == 0
    assert "Together, the 2 runs scanned 100.0 % of what is visible" in text
    assert "; 90.0 % was required of all 2 missions together." in text
    assert "No stop is left." in text
    told = json.loads(reviewed(folder, names, capsys, "--json")[1])
    (both,) = told["together"]
    assert (both["answer"], both["left"], len(both["missions"])) == ("yes", [], 2)


def test_a_lost_stop_is_named_with_its_mission_and_one_follow_up(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = folder / "page.html"
    code, text = reviewed(folder, ["plan", "field-1", "plan-2", "lost"], capsys, "--html", str(page))
    assert code == 1
    assert "Not scanned by any run: 2:s01." in text
    assert text.count("--top-up next.json") == 1
    assert "--mission mission.json --mission mission-2.json" in text
    shown = page.read_text()
    assert "floor, 2 missions: runs" in shown
    assert ">1:s01<" in shown and ">2:s01<" in shown


def test_plans_of_two_missions_without_a_run_make_no_page(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [str(folder / f"{name}.rrd") for name in ("plan", "plan-2")]
    assert main(["review", *names, "--html", str(folder / "plans.html")]) == 2
    assert "plans of several missions and no run" in capsys.readouterr().err
