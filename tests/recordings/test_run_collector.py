"""A run that is heard: compared at its end, and recorded with its plan's floor and sight."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from stopgo.bridge.commands.watch_commands import print_comparison
from stopgo.bridge.station.watch import hand_over
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.document import Mission
from stopgo.mission.run.events import Aborted, Event, Finished, StateReport
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.rrd.read import check
from stopgo.recordings.runs.field import FieldRecording
from tests.mission.comparing.test_compare import planned
from tests.recordings import run


def heard_run(mission: Mission, *sights: Sight, skips: str | None = None) -> tuple[RunCollector, StateReport]:
    """A run that was heard to its end, and its last state."""
    heard = RunCollector(None, sights)
    heard.mission(mission)
    reports = list(run.reports(mission) if skips is None else run.reports_with_a_skip(mission, skips))
    for report in reports:
        hand_over(heard, report)
    return heard, next(item for item in reversed(reports) if isinstance(item, StateReport))


@pytest.mark.parametrize(("skips", "code"), [(None, 0), ("S2", 1)])
def test_what_was_received_decides_how_watching_ends(
    skips: str | None, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    mission, sight = planned()
    heard, state = heard_run(mission, sight, skips=skips)
    assert print_comparison(heard, state, as_json=False) == code
    assert ("Not acquired. 57.1 %" in capsys.readouterr().out) == bool(skips)


def test_an_aborted_run_is_judged_by_its_scans(capsys: pytest.CaptureFixture[str]) -> None:
    mission, sight = planned()
    heard = RunCollector(None, (sight,))
    heard.mission(mission)
    for report in run.reports(mission):
        if isinstance(report, Finished):
            common = {name: getattr(report, name) for name in Event.__struct_fields__}
            hand_over(heard, Aborted(**common, reason="abort by ann"))
        else:
            hand_over(heard, report)
    _, state = heard_run(mission, sight)
    assert print_comparison(heard, replace(state, state="ABORTED"), as_json=False) == 0
    assert "The run was aborted: abort by ann." in capsys.readouterr().out


def test_a_plan_of_another_mission_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    mission, sight = planned()
    object.__setattr__(sight, "mission_id", "f" * 32)
    heard, state = heard_run(mission, sight)
    assert print_comparison(heard, state, as_json=True) == 0
    assert "--plan: belongs to another mission" in capsys.readouterr().err


def test_a_run_that_is_reported_twice_is_one(mission: Mission) -> None:
    heard, _ = heard_run(mission)
    for report in run.reports(mission):
        hand_over(heard, report)
    log = heard.log()
    assert log is not None
    assert [event.number for event in log.events] == list(range(1, 9))


def test_recorded_with_its_plan_a_run_shows_the_floor_and_knows_what_stops_see(
    sighted: Path, mission: Mission, tmp_path: Path
) -> None:
    path = tmp_path / "field.rrd"
    with FieldRecording(path, mission, plan=read_recording(sighted)) as recording:
        for report in run.reports(mission):
            hand_over(recording, report)
    rows = check(path).rows
    assert {entities.OUTLINE, entities.ROOM_NAMES, entities.COVERAGE, entities.SLAB} <= set(rows)
    (sight,) = read_recording(path).sights
    assert sight.planned.whole.coverage == pytest.approx(11 / 14)
