"""A run that goes on by a new revision of its mission: drawn, reported, reviewed and compared by it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison_text import comparison_table
from stopgo.mission.comparing.run_collector import SOURCE
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.events import AnyEvent, Arrived, PoseReport, StateReport
from stopgo.mission.run.run_log import RunLog
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.rrd.read import check
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings import run, world
from tests.recordings.conftest import tell
from tests.recordings.reading import cells, on, static
from tests.recordings.test_views import assert_shown
from tests.recordings.viewer import has_vulkan, viewer

RUN = entities.RunEntities(run.RUN)
TWO = RUN.revision(2)
TAKEN_NS = 62_000_000_000
"""After 2 s to settle and 60 s of scan at the first stop, where the mission begins."""


def events(mission: Mission) -> list[AnyEvent]:
    told = run.reports_of_two(mission, world.revised(mission), behind="S1")
    return [item for item in told if not isinstance(item, StateReport | PoseReport)]


def log_of(events: Sequence[AnyEvent]) -> RunLog:
    last = events[-1]
    return RunLog(last.robot, last.run_id, last.mission_id, last.revision, SOURCE, events=tuple(events))


def test_new_stops_and_legs_are_drawn_when_the_revision_is_taken(revised: Path) -> None:
    stops = on(revised, TWO.flat(entities.NEW_STOPS), "Points2D:positions", entities.MISSION_TIME)
    assert list(stops) == [TAKEN_NS]
    assert np.allclose(stops[TAKEN_NS], [(3.2, 0.6), (4.8, 1.6)])
    legs = on(revised, TWO.flat(entities.NEW_ROUTE), "LineStrips2D:strips", entities.MISSION_TIME)
    assert np.allclose(legs[TAKEN_NS], [[(1.0, 1.0), (3.2, 0.6)], [(3.2, 0.6), (4.8, 1.6)]])


def test_what_it_withdraws_is_drawn_over(revised: Path) -> None:
    ((_, gone),) = cells(revised, TWO.flat(entities.WITHDRAWN), "Points2D:positions")
    ((_, labels),) = cells(revised, TWO.flat(entities.WITHDRAWN), "Points2D:labels")
    ((_, legs),) = cells(revised, TWO.flat(entities.WITHDRAWN_ROUTE), "LineStrips2D:strips")
    assert np.allclose(gone, [(3.2, 1.0)])
    assert labels == ["S2 until revision 2"]
    assert np.allclose(legs, [[(1.0, 1.0), (3.2, 1.0)]])


def test_the_first_revision_stays_the_plan(plan: Path, revised: Path) -> None:
    for entity, component in (
        (entities.STOPS, "Points2D:positions"),
        (entities.ROUTE, "LineStrips2D:strips"),
    ):
        assert static(plan, entity, component) == static(revised, entity, component)


def test_stops_of_the_revision_are_marked_where_the_robot_was(revised: Path) -> None:
    for name in (entities.ARRIVED, entities.SCANNED):
        found = cells(revised, RUN.flat(name), "Points2D:positions")
        assert np.allclose([xy for _, (xy,) in found], [(1, 1.03), (3.2, 0.63), (4.8, 1.63)], atol=1e-6)


def test_the_distance_from_the_route_is_that_from_the_new_legs(revised: Path) -> None:
    metric = RUN.metric(entities.METRIC_CROSS_TRACK)
    beside = [value for _, (value,) in cells(revised, metric, "Scalars:scalars")]
    assert max(map(abs, beside)) == pytest.approx(1000 * run.OFFSET, abs=0.5)


def test_the_report_reports_both_revisions(revised: Path) -> None:
    told = on(revised, RUN.flat(entities.RUN_REPORT), "TextDocument:text", entities.MISSION_TIME)
    (text,) = told[max(told)]
    assert "revision 2 (before: 1)" in text
    assert "3 of 3 stops scanned" in text
    assert check(revised).properties["run"]["revision"] == 2


def test_what_a_revision_dropped_is_reported_in_the_report(tmp_path: Path, mission: Mission) -> None:
    shorter = with_digest(msgspec.structs.replace(mission, revision=2, stops=mission.stops[:1]))
    path = tmp_path / "field.rrd"
    with FieldRecording(path, mission) as recording:
        for report in run.reports_of_two(mission, shorter, behind="S1"):
            recording.mission(shorter)
            tell(recording, report)
    told = on(path, RUN.flat(entities.RUN_REPORT), "TextDocument:text", entities.MISSION_TIME)
    assert "| S2 | | | withdrawn by revision 2 |" in told[max(told)][0]


def test_a_run_that_begins_by_a_later_revision_shows_it_from_its_beginning(
    tmp_path: Path, mission: Mission
) -> None:
    path, after = tmp_path / "field.rrd", world.revised(mission)
    with FieldRecording(path, mission) as recording:
        for name, driven in (("run-1", mission), ("run-2", after)):
            recording.mission(driven)
            for report in run.reports(driven, run=name):
                tell(recording, report)
    second = entities.RunEntities("run-2").revision(2).flat(entities.NEW_STOPS)
    assert list(on(path, second, "Points2D:positions", entities.MISSION_TIME)) == [0]
    assert TWO.flat(entities.NEW_STOPS) not in check(path).rows


def test_a_station_that_only_received_the_later_revision_records_the_whole_run(
    tmp_path: Path, mission: Mission
) -> None:
    path, after = tmp_path / "field.rrd", world.revised(mission)
    with FieldRecording(path) as recording:
        for report in run.reports_of_two(mission, after, behind="S1"):
            tell(recording, report)
        recording.mission(after)
    assert check(path).rows[RUN.flat(entities.SCANNED)] == 3
    assert np.allclose(static(path, entities.STOPS, "Points2D:positions")[1:], [(3.2, 0.6), (4.8, 1.6)])


def test_a_revision_that_was_never_received_is_reported_by_the_one_after_it(
    tmp_path: Path, mission: Mission
) -> None:
    path, third = (
        tmp_path / "field.rrd",
        with_digest(msgspec.structs.replace(world.revised(mission), revision=3)),
    )
    with FieldRecording(path, mission) as recording:
        for report in run.reports_of_two(mission, world.revised(mission), behind="S1"):
            tell(recording, report)
        recording.mission(third)
    rows = check(path).rows
    assert rows[RUN.flat(entities.SCANNED)] == 3
    assert RUN.revision(3).flat(entities.NEW_STOPS) in rows


def test_what_waits_for_a_revision_that_never_comes_is_kept(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "field.rrd"
    told = list(run.reports_of_two(mission, world.revised(mission), behind="S1"))
    with FieldRecording(path, mission) as recording:
        for report in told:
            tell(recording, report)
    count = sum(not isinstance(item, StateReport | PoseReport) for item in told)
    assert check(path).rows[RUN.events] == count


def test_review_reports_the_revisions(revised: Path, field: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(revised), "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["runs"]
    assert (told["revisions"], told["scanned"]) == ([1, 2], 3)
    assert [stop["stop"] for stop in told["stops"]] == ["S1", "S2", "S3"]
    assert main(["review", str(revised), str(field)]) == 0
    assert capsys.readouterr().out.count("revisions 1, 2 of the mission") == 1


def test_each_stop_is_compared_with_the_revision_by_which_it_was_reached(mission: Mission) -> None:
    after = world.revised(mission)
    compared = compare(log_of(events(mission)), [mission, after])
    assert [item.stop for item in compared.stops] == ["S1", "S2", "S3"]
    assert compared.scanned == 3
    assert compared.greatest_deviation_m == pytest.approx(run.OFFSET)
    assert [item.arrived_s for item in compared.stops] == pytest.approx([s.planned_s for s in compared.stops])


def test_stops_that_were_withdrawn_or_are_not_of_the_plan_come_last(mission: Mission) -> None:
    first = with_digest(msgspec.structs.replace(mission, stops=mission.stops[:1], revision=2))
    told = [event for event in events(mission) if getattr(event, "stop", "S1") in ("S1", "S3")]
    told = [event for event in told if not isinstance(event, Arrived) or event.stop == "S1"]
    compared = compare(log_of(told), [mission, first])
    assert [(item.stop, item.outcome) for item in compared.stops] == [
        *(("S1", "scanned"), ("S2", "withdrawn"), ("S3", "scanned")),
    ]
    assert (compared.stops[2].planned_s, compared.stops[2].deviation_m) == (None, None)
    assert comparison_table(compared).splitlines()[-1].split()[:5] == ["S3", "scanned", "-", "-", "-"]


@pytest.mark.rerun_threads
@pytest.mark.skipif(not has_vulkan(), reason="no Vulkan driver")
def test_the_views_show_what_was_withdrawn(revised: Path, tmp_path: Path) -> None:
    with viewer([revised]) as client:
        client.set_time("mission_time", duration=150.0, play_state="paused")
        for colour in (palette.WITHDRAWN, palette.DRIVEN, palette.ROUTE):
            assert_shown(client, "Mission", {"Plan and run": colour}, tmp_path)
