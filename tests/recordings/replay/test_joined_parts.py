"""A run in several logs, as of a robot that was rebooted, is judged as one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.files.mission_json import write
from tests.faults.sizes import some
from tests.recordings.truth import disturbances, drives
from tests.recordings.truth.disturbances import Sensed
from tests.recordings.truth.drives import Mishap, mission_with_return
from tests.recordings.truth.formats import MAP, VEHICLES, WRITERS, Writer, write_log

MISSION = mission_with_return(1)


def parts(folder: Path, mishap: Mishap, writer: Writer, *, lost_s: float = 0.0) -> list[str]:
    """Two logs of one drive, cut between the fourth and fifth standstill; the second clock begins again."""
    tour = mishap(MISSION, np.random.default_rng(1))
    whole = disturbances.sensed(tour)
    cut = (tour.drive.halts[3].end_s + tour.drive.halts[4].begin_s) / 2
    halves = [whole.true_s <= cut, whole.true_s > cut + lost_s]
    paths, options = [], ()
    for number, mask in enumerate(halves):
        poses: Sensed = whole.rows(mask)
        (folder / str(number)).mkdir()
        poses = disturbances.replace(poses, ns=poses.ns - poses.ns[0] + whole.ns[0])
        log = write_log(writer, folder / str(number), MISSION, poses, MAP)
        paths.append(str(log.path))
        options = log.options
    write(MISSION, folder / "mission.json")
    return [*paths, "--mission", str(folder / "mission.json"), *options, "--json"]


def judged(given: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = main(["replay", *given])
    out, err = capsys.readouterr()
    return code, json.loads(out)["verdict"] if code != 2 else err


@pytest.mark.parametrize("writer", some(WRITERS, every=3), ids=lambda writer: writer.__name__)
def test_a_run_in_two_logs_is_one_run(
    writer: Writer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, verdict = judged([*parts(tmp_path, drives.as_planned, writer), "--one-run"], capsys)
    assert (code, "8 of 8 stops" in verdict) == (0, True)


@pytest.mark.parametrize("writer", VEHICLES, ids=lambda writer: writer.__name__)
def test_a_stop_that_no_part_shows_is_a_no(
    writer: Writer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, verdict = judged([*parts(tmp_path, drives.one_skipped, writer), "--one-run"], capsys)
    assert (code, "7 of 8 stops" in verdict) == (1, True)


def test_a_robot_that_drove_between_the_logs_may_have_scanned_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = parts(tmp_path, drives.as_planned, VEHICLES[0], lost_s=25.0)
    code, verdict = judged([*given, "--one-run"], capsys)
    assert code == 3
    assert "7 of 8 stops" in verdict and "restarted" in verdict


def test_alone_neither_part_reports_the_whole_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = parts(tmp_path, drives.as_planned, VEHICLES[0])
    assert main(["replay", *given]) == 3
    told = json.loads(capsys.readouterr().out)["replays"]
    assert [item["answer"] for item in told] == ["unknown", "unknown"]


def test_logs_that_are_not_of_one_run_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = parts(tmp_path, drives.as_planned, VEHICLES[0])
    assert main(["replay", given[0], *given, "--one-run"]) == 2
    assert "given twice" in capsys.readouterr().err
    assert main(["replay", *given, "--one-run", "--align", "first"]) == 2
    assert "only one log begins at the start" in capsys.readouterr().err
