"""A plan's numbers are the same on the terminal, in JSON, in its recording and on its page."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from stopgo.mission.plan import PartPlan
from stopgo.mission.stages import Selection
from stopgo.planner.appraisal.figures_of_route import figures_of
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.page import report_html
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import reviewed
from stopgo.recordings.plan import PlanRecording
from stopgo.recordings.rrd.read import check
from tests.mission.comparing.test_compare import planned
from tests.recordings import world
from tests.recordings.reading import cells, static


def test_candidates_stops_and_coverage_agree_wherever_they_are_reported(tmp_path: Path) -> None:
    nouns = world.nouns_at()
    route, mission = nouns[5], nouns[-1]
    figures = figures_of(route)
    told = PlanReport(PartPlan(route, figures, mission), {}, {})
    numbers = told.as_json()
    path = tmp_path / "plan.rrd"
    recording = PlanRecording(world.MISSION_ID)
    for noun in (*nouns, figures, planned()[1]):
        recording.observe(noun)
    recording.write(path)
    in_file = check(path).properties["plan"]
    for where, name, in_property in (
        ("candidates", "generated", "candidates"),
        ("candidates", "reachable", "reachable_candidates"),
        ("visibility", "visible", "visible_units"),
        ("selection", "stops", "stops"),
        ("selection", "bound", "stops_bound"),
    ):
        assert in_file[in_property] == numbers[where][name], name
    assert in_file["coverage"] == round(numbers["selection"]["coverage"], 4)
    text = told.as_text()
    assert "14 visible from 3 candidates" in text and "stops       2 " in text and "78.5 %" in text
    (report,) = static(path, "/report", "TextDocument:text")
    assert re.search(r"\| reachable candidates \| 3 \|", report) and "| stops | 2 |" in report
    page = report_html(subject_of(reviewed([read_recording(path)]))).decode()
    assert "Reasons for each stop" in page and ">0.3</td>" in page and "21.4 %" in page
    assert "78.5 %" in page and ">2</b>" in page
    log = [line for _, (line,) in cells(path, "/log/plan", "TextLog:text")]
    assert "selection (greedy): 2 stops, coverage 78.5 %, of these candidates at least 2 are needed" in log
    assert any("5 positions" in line or "3 reachable" in line for line in log)


def test_a_page_says_where_its_bound_is_over_all_places(tmp_path: Path) -> None:
    path = tmp_path / "plan.rrd"
    recording = PlanRecording(world.MISSION_ID)
    for noun in (*world.nouns_at(), figures_of(world.nouns_at()[5]), planned()[1]):
        recording.observe(replace(noun, everywhere=True) if isinstance(noun, Selection) else noun)
    recording.write(path)
    page = report_html(subject_of(reviewed([read_recording(path)]))).decode()
    assert "of all places at least 2 are needed" in page
