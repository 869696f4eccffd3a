"""Health of a vehicle in the report: at the start, each change and the end; unknown without a report."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.run.events import UNKNOWN_CHARGE, StateReport
from stopgo.recordings.page import report_html
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings import run
from tests.recordings.conftest import tell
from tests.recordings.page.test_page import skipping, words


def reports(mission: Mission, **health: Any) -> Iterator[Any]:
    """A run whose state has this health at the first stop, and reports nothing else of it."""
    for report in run.reports(mission):
        if isinstance(report, StateReport):
            known = health if report.stop == "S1" else {}
            yield msgspec.structs.replace(report, **({"battery": UNKNOWN_CHARGE} | known))
        else:
            yield report


def page_of(folder: Path, mission: Mission, **health: Any) -> str:
    path, page = folder / "field.rrd", folder / "report.html"
    with FieldRecording(path, mission) as recording:
        for report in reports(mission, **health):
            tell(recording, report)
    main(["review", str(path), "--html", str(page)])
    text = words(page.read_bytes())
    return text.partition("Health of the vehicle")[2].partition("During the run")[0]


def test_what_the_vehicle_does_not_report_is_unknown(mission: Mission, tmp_path: Path) -> None:
    text = page_of(tmp_path, mission)
    assert text.count("unknown unknown unknown") == 2 and "%" not in text and "ok" not in text


def test_every_change_of_battery_position_and_fence_is_on_the_page(mission: Mission, tmp_path: Path) -> None:
    text = page_of(tmp_path, mission, battery=0.42, battery_ok=False, position_ok=True, fence_ok=False)
    assert "battery position estimate geofence" in text
    assert "42%, its failsafe lasts ok breached" in text
    assert text.count("unknown unknown unknown") == 3  # at the begin, once it was over, and at the end


def test_a_log_without_health_says_so() -> None:
    assert "position estimate and geofence: unknown" in words(report_html(skipping()))
