"""stopgo's own logs are replayed by their own events, and in no frame but the mission's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace as changed

from stopgo.bridge.robot.journal_file import open_journal
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Arrived, Event, Finished, Scanned, Skipped, Started, Unconfirmed
from stopgo.mission.run.run_log import RunLog
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.heading_evidence import unknown_headings
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replay_page import to_do
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.runs.field import FieldRecording
from tests.mission.comparing.reports import SCAN, at, told
from tests.recordings.replay.driving import wandering

MISSION = wandering(1)
SKIPPED = MISSION.stops[3].id


def run_of(mission: Mission, *, turned: float = 0.0) -> RunLog:
    """Every stop 12 mm from its stop and scanned, except for one that was skipped."""
    events: list[tuple[type, float, dict[str, Any]]] = [(Started, 0.0, {"commander": "me"})]
    for number, stop in enumerate(mission.stops):
        seconds, pose = 60.0 * (number + 1), at(stop.x + 0.012, stop.y, stop.heading + turned)
        if stop.id == SKIPPED:
            events.append((Skipped, seconds, {"stop": stop.id, "reason": "blocked"}))
            continue
        events.append((Arrived, seconds, {"stop": stop.id, "pose": pose, "deviation_m": 0.012}))
        events.append((Scanned, seconds + 14, {"stop": stop.id, "pose": pose, **SCAN}))
    events.append((Finished, 60.0 * (len(mission.stops) + 1), {}))
    return told(mission, *events)


def written_journal(folder: Path) -> Path:
    with open_journal(folder / "state", "r1") as journal:
        for event in run_of(MISSION).events:
            journal.append(event)
    return folder / "state"


def written_recording(folder: Path) -> Path:
    with FieldRecording(folder / "field.rrd", MISSION) as recording:
        for event in run_of(MISSION).events:
            recording.event(event)
    return folder / "field.rrd"


def replayed(path: Path) -> Replay:
    return replay(read_log(path), MISSION, Placing())


@pytest.mark.parametrize("written", [written_journal, written_recording])
def test_our_own_logs_are_reported_by_their_own_events(
    tmp_path: Path, written: Callable[[Path], Path]
) -> None:
    found = replayed(written(tmp_path))
    outcomes = {item.stop: item.outcome for item in found.comparison.stops}
    assert outcomes.pop(SKIPPED) == "skipped"
    assert set(outcomes.values()) == {"scanned"}
    assert not found.inferred
    assert found.comparison.greatest_deviation_m == pytest.approx(0.012, abs=1e-6)
    assert drive_verdict(found).answer == "no"
    assert len(found.scanned_from) == len(MISSION.stops) - 1


@pytest.mark.parametrize("kind", ["journal", "recording"])
def test_a_run_whose_every_stop_was_skipped_has_no_pose_and_is_reported(tmp_path: Path, kind: str) -> None:
    skips = [(Skipped, 9.0 * n, {"stop": s.id, "reason": "no"}) for n, s in enumerate(MISSION.stops, 1)]
    events = told(MISSION, (Started, 0.0, {"commander": "me"}), *skips, (Finished, 999.0, {})).events
    if kind == "journal":
        with open_journal(tmp_path / "state", "r1") as journal:
            for event in events:
                journal.append(event)
    else:
        with FieldRecording(tmp_path / "state", MISSION) as recording:
            for event in events:
                recording.event(event)
    found = replayed(tmp_path / "state")
    assert {item.outcome for item in found.comparison.stops} == {"skipped"}
    assert drive_verdict(found).answer == "no"


def test_a_run_of_another_mission_is_refused_by_name(tmp_path: Path) -> None:
    from msgspec.structs import replace

    from stopgo.mission.document import with_digest

    other = with_digest(replace(MISSION, id="f" * 32))
    with pytest.raises(InputError, match="no run of mission ffff"):
        replay(read_log(written_journal(tmp_path)), other, Placing())


def test_another_revision_and_another_version_are_refused_with_their_differences(tmp_path: Path) -> None:
    from msgspec.structs import replace

    from stopgo.mission.document import with_digest

    log = read_log(written_recording(tmp_path))
    wider = tuple(
        replace(stop, tolerance_m=0.2 if k == 3 else stop.tolerance_m) for k, stop in enumerate(MISSION.stops)
    )
    name = MISSION.stops[3].id
    later = with_digest(replace(MISSION, revision=MISSION.revision + 1, stops=wider))
    with pytest.raises(InputError, match=rf"followed revision 1 of mission room, not 2 \(changed: {name}\)"):
        replay(log, later, Placing())
    with pytest.raises(InputError, match=rf"another version of mission room, revision 1 \(changed: {name}\)"):
        replay(log, with_digest(replace(MISSION, stops=wider)), Placing())


def test_a_scan_turned_from_its_heading_is_named_as_such_and_to_be_repeated(tmp_path: Path) -> None:
    mission = with_digest(changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=180.0)))
    with open_journal(tmp_path / "state", "r1") as journal:
        for event in run_of(mission, turned=-0.25).events:
            journal.append(event)
    found = replay(read_log(tmp_path / "state"), mission, Placing())
    name, judgement = mission.stops[0].id, drive_verdict(found)
    assert judgement.answer == "no" and "position error" not in judgement.text
    assert f"{name}: turned 14.3° from its heading; the scanner sees 180°." in judgement.text
    assert f"{name}: scan it again, turned by +14.3°" in list(to_do(found))


def test_a_stop_without_a_pose_leaves_what_was_visible_from_the_others_known(tmp_path: Path) -> None:
    mission = with_digest(changed(MISSION, scanner=changed(MISSION.scanner, fov_deg=180.0)))
    run = run_of(mission)
    stop, *_ = (event for event in run.events if isinstance(event, Scanned))
    common = {name: getattr(stop, name) for name in Event.__struct_fields__}
    passed = Unconfirmed(**common, stop=stop.stop, pose=None, reason="no pose of the vehicle at the stop")
    with open_journal(tmp_path / "state", "r1") as journal:
        for event in run.events:
            if getattr(event, "stop", None) != stop.stop:
                journal.append(event)
            elif event is stop:
                journal.append(passed)
    found = replay(read_log(tmp_path / "state"), mission, Placing())
    assert next(item for item in found.comparison.asked if item.stop == stop.stop).deviation_m is None
    assert unknown_headings(found) == ""
