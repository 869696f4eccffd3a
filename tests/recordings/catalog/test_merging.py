"""A plan and its runs as one recording: everything once, and laid out for exactly these runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.recordings.drawing import entities
from stopgo.recordings.embedded.checking import problems_of
from stopgo.recordings.embedded.reading import read_recording
from tests.recordings import run
from tests.recordings.conftest import write_field
from tests.recordings.test_views import SMALL, assert_shown
from tests.recordings.viewer import has_vulkan, viewer


@pytest.fixture(scope="module")
def merged(sighted: Path, skipping: Path, mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("merged")
    other = write_field(folder / "field.rrd", mission, "run-2")
    assert main(["review", str(skipping), str(other), str(sighted), "-o", str(folder / "merged.rrd")]) == 1
    return folder / "merged.rrd"


def test_it_holds_the_plan_and_every_run_once(merged: Path, sighted: Path, mission: Mission) -> None:
    found = read_recording(merged)
    assert problems_of(found) == ()
    assert [log.run_id for log in found.logs] == [run.RUN, "run-2"]
    assert (found.missions, len(found.sights)) == ((mission,), 1)
    plan = read_recording(sighted).contents.rows
    for entity in (entities.STOPS, entities.SELECTION_TARGETS, entities.OUTLINE):
        assert found.contents.rows[entity] == plan[entity]


def test_reviewed_alone_it_reports_what_was_acquired(
    merged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["review", str(merged)]) == 1
    out = capsys.readouterr().out
    assert "Not acquired. 57.1 %" in out
    assert "Acquired. 78.5 %" in out


def test_merging_twice_adds_nothing(merged: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.rrd"
    main(["review", str(merged), str(merged), "-o", str(again)])
    assert len(read_recording(again).logs) == 2


def test_a_recording_is_not_written_over_itself(merged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["review", str(merged), "-o", str(merged)]) == 2
    assert "is one of the recordings" in capsys.readouterr().err


@pytest.mark.rerun_threads
@pytest.mark.skipif(not has_vulkan(), reason="no Vulkan driver")
def test_each_run_has_a_report_and_no_view_complains(merged: Path, tmp_path: Path) -> None:
    with viewer([merged], size=SMALL) as client:
        assert_shown(client, "Mission", {"Report": None}, tmp_path)
        assert_shown(client, "Run", {"States": None}, tmp_path)
