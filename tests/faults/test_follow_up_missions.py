"""A follow-up mission scans the rest of a run, driven on the simulated robot like any mission."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import read
from stopgo.planner.pipeline.follow_up_mission import as_driven, planned_floor
from tests.planner.test_command import drawn
from tests.recordings.replay.witnessed import Troubles, Witness, run_of

PLAN = ["--range", "2", "--coverage", "0.9", "--settle", "1", "--scan-time", "8", "--no-refine"]


def test_a_run_with_two_stops_skipped_and_its_top_up_reach_the_coverage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    floor = drawn(tmp_path / "floor.dxf")
    assert main(["plan", str(floor), "-o", str(tmp_path), *PLAN]) == 0
    mission = read(tmp_path / "mission.json")
    planned = planned_floor(floor, mission)
    skipped = frozenset(stop.id for stop in mission.stops[:2])
    first = run_of(mission, Troubles(skips=skipped), tmp_path / "first")
    capsys.readouterr()
    further = tmp_path / "next.json"
    given = ["--mission", str(tmp_path / "mission.json"), "--floor", str(floor), "--top-up", str(further)]
    assert main(["replay", str(tmp_path / "first"), *given, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    outcomes = {item["stop"]: item["outcome"] for item in told["run"]["stops"]}
    assert {stop for stop, outcome in outcomes.items() if outcome == "skipped"} == skipped
    alone = as_driven(planned, places(first, mission))
    assert not alone.enough
    assert told["coverage"]["shares"]["all"]["as_driven"] == alone.coverage.whole.coverage
    top_up = read(further)
    second = run_of(top_up, Troubles(), tmp_path / "second", seed=2)
    both = as_driven(planned, np.concatenate([places(first, mission), places(second, top_up)]))
    assert both.enough
    assert main(["replay", str(tmp_path / "second"), "--mission", str(further)]) == 0


def places(witness: Witness, mission: Mission) -> np.ndarray:
    """Positions of the simulated scanner's scans, by the witness."""
    shots = [shot.pose for stop in mission.stops for shot in witness.shots_at(stop) if shot.good]
    return np.array([(pose.x, pose.y, pose.heading) for pose in shots]).reshape(-1, 3)
