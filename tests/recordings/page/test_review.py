"""`stopgo review` reports what recordings hold, with the exit codes of every command."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission, with_digest
from stopgo.recordings.embedded.checking import problems_of
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.rrd.compact import VIEWER
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings import run, world
from tests.recordings.conftest import tell


def test_a_plan_in_json(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(plan), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["recording_id"] == told["mission_id"] == world.MISSION_ID
    assert (told["plan"]["candidates"], told["plan"]["stops"], told["plan"]["route_m"]) == (4, 2, 2.2)
    assert told["runs"] == []


def test_a_run_in_json(field: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(field), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["runs"]
    assert (told["run_id"], told["scanned"], told["asked"]) == (run.RUN, 2, 2)
    assert [stop["deviation_m"] for stop in told["stops"]] == pytest.approx([run.OFFSET] * 2)
    assert told["driven_s"] == pytest.approx(129.4)
    assert told["greatest_beside_route_m"] == pytest.approx(run.OFFSET)
    assert (told["coverage"], told["answer"]) == (None, "yes")


def test_both_for_a_person(plan: Path, field: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(plan), str(field)]) == 0
    text = capsys.readouterr().out
    assert "coverage: 0.7857" in text
    assert "greatest position error 30.0 mm, cross-track error 30.0 mm" in text


def test_a_skipped_stop_is_reported_with_what_it_cost(
    sighted: Path, skipping: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of 14 visible units, S2 alone sees 3; 70 % is asked, and 57 % was scanned."""
    assert main(["review", str(skipping), str(sighted), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)["recordings"][0]["runs"][0]
    assert told["coverage"]["acquired"] == pytest.approx(8 / 14)
    assert told["stops"][1]["lost"] == pytest.approx(3 / 14)
    assert main(["review", str(sighted), str(skipping)]) == 1
    text = capsys.readouterr().out
    assert "Not acquired. 57.1 % of what is visible was scanned; 70.0 % was required, 78.5 % planned." in text
    assert "skip by ann" in text
    command = f"stopgo replay {skipping} --mission mission.json --floor FLOOR --top-up next.json"
    assert text.rstrip().endswith(
        f"For the missing coverage, plan a follow-up mission (FLOOR is the file of small.dxf): {command}"
    )
    page = tmp_path / "report.html"
    assert main(["review", str(sighted), str(skipping), "--html", str(page)]) == 1
    assert "What to do next" in page.read_text() and command in page.read_text()


def test_nothing_is_to_be_done_after_a_run_as_planned(
    sighted: Path, field: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["review", str(sighted), str(field)]) == 0
    assert "a follow-up mission" not in capsys.readouterr().out


def run_without(path: Path, mission: Mission, stop: str) -> Path:
    """A recording of a run of its own, in which a stop is skipped."""
    recording = FieldRecording(path, mission)
    with recording:
        for report in run.reports_with_a_skip(mission, stop):
            tell(recording, msgspec.structs.replace(report, run_id=f"without-{stop}"))
    return path


def test_two_runs_are_reported_together_and_need_no_follow_up_for_what_one_of_them_did(
    sighted: Path, mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without S2, 57 % of the visible is scanned; without S1 less. Together it is the planned 78.5 %."""
    files = [str(run_without(tmp_path / f"{stop}.rrd", mission, stop)) for stop in ("S1", "S2")]
    page = tmp_path / "report.html"
    assert main(["review", str(sighted), *files, "--html", str(page)]) == 1
    text = capsys.readouterr().out
    assert (
        "Together, the 2 runs scanned 78.5 % of what is visible; 70.0 % was required.\nNo stop is left."
        in text
    )
    assert "follow-up" not in text and "follow-up" not in page.read_text()
    assert "All runs together" in page.read_text() and "robot r1 (run 2)" in page.read_text()
    assert main(["review", str(sighted), *files, "--json"]) == 1
    (both,) = json.loads(capsys.readouterr().out)["together"]
    assert both["coverage"] == pytest.approx(11 / 14)
    assert (both["answer"], both["left"]) == ("yes", [])
    assert sum(room["acquired"] is not None for room in both["rooms"]) > 0
    assert page.read_text().count(">together<") == 1


def test_two_runs_that_lack_the_same_stop_get_one_follow_up(
    sighted: Path, skipping: Path, mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = run_without(tmp_path / "other.rrd", mission, "S2")
    assert main(["review", str(sighted), str(skipping), str(other)]) == 1
    text = capsys.readouterr().out
    assert "Together, the 2 runs scanned 57.1 % of what is visible; 70.0 % was required." in text
    assert "Not scanned by any run: S2." in text
    assert text.count("--top-up next.json") == 1
    assert f"stopgo replay {skipping} {other} --mission mission.json" in text


def test_without_its_plan_a_skipped_stop_is_a_no(skipping: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(skipping)]) == 1
    assert "1 of 2 stops were scanned" in capsys.readouterr().out


def test_a_folder_is_read_and_one_bad_file_hides_no_other(
    field: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(field, tmp_path / "b.rrd")
    (tmp_path / "a.rrd").write_bytes(b"junk" * 100)
    (tmp_path / "notes.txt").write_text("mine")
    assert main(["review", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert "b.rrd: recording" in out
    assert err == f"stopgo: {tmp_path}/a.rrd: is not a Rerun recording\n"


def test_an_empty_folder_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(tmp_path)]) == 2
    assert "no .rrd file in this folder" in capsys.readouterr().err


def test_whole_recordings_pass_the_check(plan: Path, field: Path) -> None:
    assert main(["review", "--check", str(plan), str(field)]) == 0


def test_a_recording_that_was_cut_and_mended_fails_the_check(
    field: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Cut off in the middle and made whole again by Rerun's own tool, it calls itself complete."""
    data = field.read_bytes()
    cut, mended = tmp_path / "cut.rrd", tmp_path / "mended.rrd"
    cut.write_bytes(data[: len(data) // 3])
    subprocess.run([VIEWER, "rrd", "optimize", cut, "-o", mended], check=False, capture_output=True)
    assert main(["review", "--check", str(mended)]) == 1
    assert "problem: incomplete" in capsys.readouterr().out


def test_a_recording_of_another_mission_than_it_says_fails_the_check(field: Path, mission: Mission) -> None:
    read = read_recording(field)
    other = with_digest(msgspec.structs.replace(mission, name="other"))
    assert problems_of(read) == ()
    (problem,) = problems_of(replace(read, missions=(other,)))
    assert "its run has digest" in problem


def test_junk_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "junk.rrd"
    path.write_bytes(b"junk" * 100)
    assert main(["review", str(path)]) == 2
    assert capsys.readouterr().err == f"stopgo: {path}: is not a Rerun recording\n"


def other_revision_1(mission: Mission) -> Mission:
    """Return a mission with the same id and revision, whose second stop has another id and lies elsewhere."""
    first, second = mission.stops
    moved = msgspec.structs.replace(second, id="S9", x=second.x - 0.3)
    return with_digest(msgspec.structs.replace(mission, stops=(first, moved)))


def test_a_plan_of_another_mission_with_this_id_and_revision_is_named_and_not_compared(
    sighted: Path, mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The plan's S2 was "withdrawn", and its coverage that of the run."""
    field, page, merged = tmp_path / "field.rrd", tmp_path / "page.html", tmp_path / "merged.rrd"
    with FieldRecording(field, other_revision_1(mission)) as recording:
        for report in run.reports(other_revision_1(mission)):
            tell(recording, report)
    files = [str(sighted), str(field)]
    assert main(["review", *files, "--html", str(page), "-o", str(merged), "--check"]) == 1
    text = capsys.readouterr().out
    assert f"problem: {sighted} has another mission with id {mission.id} and revision 1 (digest" in text
    assert "withdrawn" not in text and "S2" not in text
    assert f"{sighted} has another mission" in page.read_text()
    assert [item.stops[1].id for item in read_recording(merged).missions] == ["S9"]
    assert main(["review", *files, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["recordings"][1]["runs"][0]
    assert ([stop["stop"] for stop in told["stops"]], told["coverage"]) == (["S1", "S9"], None)


def test_runs_of_two_missions_with_one_id_and_revision_are_not_judged_together(
    field: Path, mission: Mission, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = run_without(tmp_path / "other.rrd", other_revision_1(mission), "S9")
    assert main(["review", str(field), str(other), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["together"] == []
    assert main(["review", str(field), str(other), "--html", str(tmp_path / "page.html")]) == 2
    error = capsys.readouterr().err
    assert f"{field}: {other} has another mission with id {mission.id} and revision 1" in error
    assert error.rstrip().endswith("give the recordings of one of them")
