"""A run's recording shows what the robot reported, overlays the plan, and survives a killed writer."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Pose, PoseReport, Scanned, StateReport
from stopgo.mission.run.run_log import Track
from stopgo.recordings.drawing import entities
from stopgo.recordings.rrd import compact as compacting
from stopgo.recordings.rrd import segment_file
from stopgo.recordings.rrd.compact import compact
from stopgo.recordings.rrd.read import check
from stopgo.recordings.rrd.segment_file import SegmentFile
from stopgo.recordings.runs import field as field_module
from stopgo.recordings.runs.field import FieldRecording
from stopgo.recordings.runs.report import run_report
from stopgo.recordings.runs.trail import Trail
from tests.disk import ROOMY, small_disk
from tests.recordings import run, world
from tests.recordings.conftest import tell, write_field, write_plan
from tests.recordings.reading import components, on, static

NS = 1_000_000_000
RUN = f"/field/{run.RUN}"


def test_it_has_the_id_of_its_run_and_names_mission_and_floor(
    plan: Path, field: Path, mission: Mission
) -> None:
    held = check(field)
    assert check(plan).recording_id == mission.id
    assert held.recording_id == f"{mission.id}-{run.RUN}"
    about = held.properties["run"]
    assert (about["mission_id"], about["digest"]) == (mission.id, mission.digest)
    assert (about["floor"], about["floor_digest"]) == (mission.origin.floor, mission.origin.floor_digest)
    assert held.timelines == ("mission_time", "robot_time", "stop")
    assert held.properties["run"]["run_id"] == run.RUN
    names = ("robot", "driven", "arrived", "scanned", "state", "stop_state", "events", "report")
    assert {f"{RUN}/{name}" for name in names} <= set(held.rows)


def test_it_draws_the_mission_where_the_plan_does(plan: Path, field: Path) -> None:
    for entity, component in (
        (entities.STOPS, "Points2D:positions"),
        (entities.ROUTE, "LineStrips2D:strips"),
        (entities.PLAN, "Transform3D:scale"),
    ):
        assert static(plan, entity, component) == static(field, entity, component)
    assert static(field, entities.FIELD, "Transform3D:scale") == static(
        field, entities.PLAN, "Transform3D:scale"
    )


def test_far_from_the_origin_both_overlay(tmp_path: Path) -> None:
    x, y = 500_123.4567, 5_400_987.6543
    plan = write_plan(tmp_path / "plan.rrd", x, y)
    field = write_field(tmp_path / "field.rrd", world.nouns_at(x, y)[-1])
    assert check(field).properties["run"]["local_origin"] == check(plan).properties["plan"]["local_origin"]
    robot = on(field, f"{RUN}/robot", "Transform3D:translation", entities.MISSION_TIME)
    stop = static(plan, entities.STOPS, "Points2D:positions")[1]
    assert np.allclose(robot[max(robot)][0][:2], (stop[0], stop[1] + run.OFFSET), atol=1e-4)


def test_nothing_that_changes_is_hidden_by_something_static(field: Path) -> None:
    for entity, (fixed, changing) in components(field).items():
        assert not fixed & changing, f"{entity}: static {fixed & changing} hides what changes"


def test_the_robot_is_not_drawn_before_its_first_pose(field: Path) -> None:
    for robot in (f"{RUN}/robot", f"/world{RUN}/robot"):
        moves = on(field, robot, "Transform3D:translation", entities.MISSION_TIME)
        dimension = "3D" if robot.startswith("/world") else "2D"
        shapes = on(field, entities.shape(robot), f"LineStrips{dimension}:strips", entities.MISSION_TIME)
        assert list(shapes) == [min(moves)]


def test_the_driven_path_grows_piece_by_piece(field: Path) -> None:
    strips = on(field, f"{RUN}/driven", "LineStrips2D:strips", entities.MISSION_TIME)
    lengths = [np.hypot(*np.diff(strip, axis=0).T) for (strip,) in strips.values()]
    assert np.concatenate(lengths).sum() == pytest.approx(2.2, abs=0.01)
    assert np.concatenate(lengths).min() >= 0.05


def _shown(recording: Path) -> dict[str, object]:
    """All rows of values that change in a run, by their entity and component."""
    changing = {entity: found for entity, (_, found) in components(recording).items() if RUN in entity}
    return {
        f"{entity} {name}": on(recording, entity, name, entities.ROBOT_TIME)
        for entity, names in changing.items() for name in names
    }  # fmt: skip


def test_reports_that_are_drawn_together_are_drawn_as_each_alone(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Poses and states are collected over half a minute: each drawing costs as much as many poses."""
    write_field(tmp_path / "together.rrd", mission)
    monkeypatch.setattr("stopgo.recordings.runs.field.MOST_COLLECTED", 1)
    write_field(tmp_path / "alone.rrd", mission)
    together, alone = _shown(tmp_path / "together.rrd"), _shown(tmp_path / "alone.rrd")
    assert {name for name in together if "driven" not in name} == {
        name for name in alone if "driven" not in name
    }
    assert all(together[name] == alone[name] for name in together if "driven" not in name)


def test_few_drawings_are_written_of_many_poses_and_states(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, written = segment_file.SegmentFile.add, list[int]()

    def counted(file: segment_file.SegmentFile, recording: bytes) -> None:
        written.append(len(recording))
        add(file, recording)

    monkeypatch.setattr(segment_file.SegmentFile, "add", counted)
    with FieldRecording(tmp_path / "field.rrd", mission) as recording:
        recording.event(next(item for item in run.reports(mission) if not isinstance(item, StateReport)))
        begun, teller = len(written), run._Teller(mission, run.RUN)
        for second in range(300):
            recording.pose(teller.pose(float(second), 0.01 * second, 0.0, 0.0))
            recording.state(teller.state(float(second), "RUNNING"))
        assert len(written) - begun <= 300 / 30


def test_no_path_is_drawn_across_a_long_silence(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "field.rrd"
    poses = [item for item in run.reports(mission) if isinstance(item, PoseReport)]
    with FieldRecording(path, mission) as recording:
        recording.pose(poses[0])
        recording.pose(poses[-1])
    assert not on(path, f"{RUN}/driven", "LineStrips2D:strips", entities.MISSION_TIME)


def test_deviation_and_distance_from_the_route_are_plotted(field: Path) -> None:
    deviation = on(field, f"{entities.METRIC_DEVIATION}/{run.RUN}", "Scalars:scalars", entities.MISSION_TIME)
    assert [value[0] for _, value in sorted(deviation.items())] == pytest.approx([30.0, 30.0])
    beside = on(field, f"{entities.METRIC_CROSS_TRACK}/{run.RUN}", "Scalars:scalars", entities.MISSION_TIME)
    # 3 cm to the left of a leg driven along +x; on the stop itself it is as far, to either side.
    driving = [value[0] for time, value in beside.items() if 62 * NS < time < 67 * NS]
    assert driving == pytest.approx([1000 * run.OFFSET] * len(driving), abs=1e-3)
    assert driving


def test_a_scan_from_outside_its_tolerance_is_reported_by_log_report_and_plot(
    tmp_path: Path, mission: Mission
) -> None:
    path, first = tmp_path / "field.rrd", mission.stops[0]
    aside = Pose(x=first.x + 0.12, y=first.y, heading=first.heading)
    with FieldRecording(path, mission) as recording:
        for report in run.reports(mission):
            moved = isinstance(report, Scanned) and report.stop == first.id
            tell(recording, msgspec.structs.replace(report, pose=aside) if moved else report)
    words = "120 mm from its stop (50 mm are tolerated)"
    names = entities.RunEntities(run.RUN)
    log = on(path, names.log, "TextLog:text", entities.MISSION_TIME)
    levels = on(path, names.log, "TextLog:level", entities.MISSION_TIME)
    (at,) = [time for time, (text,) in log.items() if words in text]
    assert log[at][0].startswith(f"Scanned {first.id}") and levels[at] == ["WARN"]
    reports = on(path, names.flat(entities.RUN_REPORT), "TextDocument:text", entities.MISSION_TIME)
    final = reports[max(reports)][0]
    assert f"| 120.0 | scanned {words} |" in final and "2 of 2 stops scanned" in final
    deviation = on(path, f"{entities.METRIC_DEVIATION}/{run.RUN}", "Scalars:scalars", entities.MISSION_TIME)
    assert deviation[at] == pytest.approx([120.0])


def test_states_are_reported_on_both_clocks(field: Path) -> None:
    states = on(field, f"{RUN}/stop_state", "StateChange:state", entities.MISSION_TIME)
    told = [value[0] for _, value in sorted(states.items())]
    assert told[-3:] == ["SETTLING", "SCANNING", ""]
    robot = on(field, f"{RUN}/state", "StateChange:state", entities.ROBOT_TIME)
    assert max(robot) == run.BEGAN_NS + round(129.4 * NS)


def test_reports_before_the_mission_are_kept(tmp_path: Path, mission: Mission, field: Path) -> None:
    path = tmp_path / "field.rrd"
    with FieldRecording(path, None) as recording:
        for number, report in enumerate(run.reports(mission)):
            if number == 10:
                assert not list(tmp_path.iterdir())
                recording.mission(mission)
            tell(recording, report)
    assert check(path).rows == check(field).rows


def test_the_mission_may_be_reported_again(tmp_path: Path, mission: Mission) -> None:
    with FieldRecording(tmp_path / "field.rrd", mission) as recording:
        recording.mission(mission)
        for report in run.reports(mission):
            tell(recording, report)
    assert check(tmp_path / "field.rrd").complete


def test_another_mission_needs_another_file(tmp_path: Path, mission: Mission) -> None:
    other = msgspec.structs.replace(mission, id="f" * 32)
    recorded = FieldRecording(tmp_path / "field.rrd", mission)
    with pytest.raises(InputError, match="use another file"), recorded as recording:
        recording.mission(other)
    assert check(tmp_path / "field.rrd").recording_id == mission.id


def test_two_runs_lie_side_by_side(tmp_path: Path, mission: Mission) -> None:
    path = write_field(tmp_path / "field.rrd", mission, "run-1", "run-2")
    rows = check(path).rows
    assert rows["/field/run-1/events"] == rows["/field/run-2/events"] == 8


def test_what_belongs_to_no_run_is_left_out(tmp_path: Path, mission: Mission) -> None:
    idle = StateReport(
        **{**_fields(next(r for r in run.reports(mission) if isinstance(r, StateReport))), "run_id": None}
    )
    with FieldRecording(tmp_path / "field.rrd", mission) as recording:
        recording.state(idle)
    assert not [entity for entity in check(tmp_path / "field.rrd").rows if entity.startswith("/field/")]


def test_without_a_mission_there_is_no_file(tmp_path: Path, mission: Mission) -> None:
    with FieldRecording(tmp_path / "field.rrd", None) as recording:
        for report in run.reports(mission):
            tell(recording, report)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_keeps_the_run_so_far(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "field.rrd"
    with pytest.raises(KeyboardInterrupt), FieldRecording(path, mission) as recording:
        for report in list(run.reports(mission))[:10]:
            tell(recording, report)
        raise KeyboardInterrupt
    assert [item.name for item in tmp_path.iterdir()] == ["field.rrd"]
    assert check(path).complete


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("none/field.rrd", "does not exist"),
        (".", "is a folder"),
        ("file/field.rrd", "is a file, not a folder"),
        ("/dev/null", "is not a file"),
        ("/proc/field.rrd", "no file can be created in /proc"),
        (f"{'x' * 250}.rrd", "File name too long"),
    ],
)
def test_a_place_where_no_file_can_be_is_refused_before_the_run(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match=why), FieldRecording(tmp_path / name):
        raise AssertionError("entered")
    assert [item.name for item in tmp_path.iterdir()] == ["file"]


def test_watching_into_an_unwritable_place_is_refused_before_the_robot_is_asked(
    capfd: pytest.CaptureFixture[str],
) -> None:
    assert main(["watch", "--robot", "r1", "--timeout", "0.1", "--rrd", "/proc/field.rrd"]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("stopgo: /proc/field.rrd: no file can be created in /proc")


# ---- the disk is full ----


def test_what_finds_no_room_waits_until_there_is_some(tmp_path: Path, mission: Mission, field: Path) -> None:
    said: list[str] = []
    reports = list(run.reports(mission))
    path, partial = tmp_path / "field.rrd", tmp_path / "field.partial.rrd"
    with small_disk() as full_at, FieldRecording(path, mission, say=said.append) as recording:
        for number, report in enumerate(reports):
            if number == len(reports) // 4:
                full_at(0)
            if number == len(reports) // 2:
                full_at(ROOMY)
            tell(recording, report)
    assert said == [
        f"{partial}: cannot be written (File too large); the recording waits in memory for room",
        f"{partial}: the disk has room again; waiting data was written",
    ]
    held, whole = check(path), check(field)
    assert held.complete
    assert held.rows == whole.rows
    assert os.listdir(tmp_path) == ["field.rrd"]


def test_what_finds_no_room_to_the_end_is_reported_and_keeps_its_partial_name(
    tmp_path: Path, mission: Mission, field: Path
) -> None:
    path, partial = tmp_path / "field.rrd", tmp_path / "field.partial.rrd"
    with pytest.raises(InputError) as raised, small_disk(180_000), FieldRecording(path, mission) as recording:
        for report in run.reports(mission):
            tell(recording, report)
    why = "could not be written completely (File too large)"
    assert str(raised.value) == f"{path}: {why}; the saved part is in {partial}"
    assert os.listdir(tmp_path) == [partial.name]
    events = check(partial).rows[f"{RUN}/events"]
    assert 0 < events < check(field).rows[f"{RUN}/events"]


def test_what_is_too_much_for_the_memory_is_not_called_whole(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(segment_file, "MOST_WAITING", 150_000)
    path = tmp_path / "field.rrd"
    why = "could not be written completely (too much data waited for room); the saved part is in"
    with (
        pytest.raises(InputError, match=re.escape(why)),
        small_disk(0) as full_at,
        FieldRecording(path, mission) as recording,
    ):
        for report in run.reports(mission):
            tell(recording, report)
        full_at(ROOMY)
    assert 0 < check(tmp_path / "field.partial.rrd").rows[f"{RUN}/events"] < 8
    assert not path.exists()


def test_how_a_run_ended_is_not_hidden_by_what_became_of_its_recording(
    tmp_path: Path, mission: Mission
) -> None:
    said: list[str] = []
    path = tmp_path / "field.rrd"
    with (
        pytest.raises(KeyboardInterrupt),
        small_disk(0),
        FieldRecording(path, mission, say=said.append),
    ):
        raise KeyboardInterrupt
    assert said[-1] == f"{path}: could not be written completely (File too large); the file was not saved"
    assert not os.listdir(tmp_path)


def test_a_recording_whose_folder_went_away_is_reported(tmp_path: Path, mission: Mission) -> None:
    folder = tmp_path / "usb"
    folder.mkdir()
    said: list[str] = []
    why = r"field\.rrd: could not be written completely \(No such file or directory\); the file was not saved"
    with (
        pytest.raises(InputError, match=why),
        FieldRecording(folder / "field.rrd", mission, say=said.append) as recording,
    ):
        tell(recording, next(iter(run.reports(mission))))
        shutil.rmtree(folder)
        for report in run.reports(mission):
            tell(recording, report)
        assert len(said) == 1  # while the run goes on, and not only when it is over
        assert "field.partial.rrd: cannot be written (No such file or directory)" in said[0]


@pytest.mark.parametrize("away", [Path.unlink, lambda path: path.rename(path.with_name("moved.rrd"))])
def test_a_recording_that_is_deleted_or_moved_meanwhile_is_written_again(
    away: Callable[[Path], object], tmp_path: Path, mission: Mission, field: Path
) -> None:
    reports = list(run.reports(mission))
    path, partial = tmp_path / "field.rrd", tmp_path / "field.partial.rrd"
    with FieldRecording(path, mission) as recording:
        for number, report in enumerate(reports):
            if number == len(reports) // 2:
                away(partial)
            tell(recording, report)
    held, whole = check(path), check(field)
    assert held.complete
    assert held.rows == whole.rows


def test_without_room_for_two_the_recording_stays_as_it_is(tmp_path: Path, mission: Mission) -> None:
    """Compacting needs room next to the file; a file not compacted holds the same."""
    path = tmp_path / "field.rrd"
    with small_disk() as full_at, FieldRecording(path, mission) as recording:
        for report in run.reports(mission):
            tell(recording, report)
        full_at(1000)
    assert check(path).rows[f"{RUN}/events"] == 8
    assert os.listdir(tmp_path) == ["field.rrd"]


def test_a_recording_that_was_cut_is_left_under_its_partial_name(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "field.rrd"
    whole = write_field(tmp_path / "whole.rrd", mission).read_bytes()
    partial = tmp_path / "field.partial.rrd"
    partial.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is truncated"):
        compact(partial, path)
    assert partial.exists()
    assert not path.exists()


def test_two_recordings_of_one_run_at_once_both_end_with_its_file(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two sites of one folder took one partial file, and one temporary file; at the end there was none."""
    path, merge = tmp_path / "field.rrd", compacting._merge
    first, second = (SegmentFile(tmp_path / "field.partial", lambda line: None) for _ in range(2))
    whole = write_field(tmp_path / "whole.rrd", mission).read_bytes()
    for segments in (first, second):
        segments.add(whole)
    for segments in (first, second):
        segments.close()
    assert first.path != second.path

    def merged_meanwhile(source: Path, merged: Path) -> bool:
        made = merge(source, merged)
        if source == first.path:
            compact(second.path, path)
        return made

    monkeypatch.setattr(compacting, "_merge", merged_meanwhile)
    compact(first.path, path)
    assert check(path).rows == check(tmp_path / "whole.rrd").rows
    assert sorted(os.listdir(tmp_path)) == ["field.rrd", "whole.rrd"]


def test_a_run_that_another_recorder_has_saved_meanwhile_is_saved(
    tmp_path: Path, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "field.rrd"

    def saved_by_another(source: Path, target: Path) -> None:
        source.rename(target)
        compact(source, target)

    monkeypatch.setattr(field_module, "compact", saved_by_another)
    with FieldRecording(path, mission) as recording:
        for report in run.reports(mission):
            tell(recording, report)
    assert check(path).rows[f"{RUN}/events"] == 8


KILLED = """
import os, signal, sys
from collections.abc import Callable
from pathlib import Path
from stopgo.recordings.runs.field import FieldRecording
from tests.recordings import run, world
from tests.recordings.conftest import tell
mission = world.nouns_at()[-1]
for _ in range(2):
    if writer := os.fork():
        os.waitpid(writer, 0)
        continue
    with FieldRecording(Path(sys.argv[1]), mission) as recording:
        for report in run.reports(mission):
            tell(recording, report)
        os.kill(os.getpid(), signal.SIGKILL)
"""
"""Two writers one after another, copies of a process that has loaded everything."""


def test_a_killed_writer_leaves_what_it_was_given(tmp_path: Path) -> None:
    path = tmp_path / "field.rrd"
    root = Path(__file__).parents[3]
    subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=root, check=True)
    for partial in ("field.partial.rrd", "field.partial-2.rrd"):
        held = check(tmp_path / partial)
        assert not held.complete
        assert held.rows[f"{RUN}/events"] == 8
    assert not path.exists()


def _fields(report: StateReport) -> dict[str, object]:
    return {name: getattr(report, name) for name in report.__struct_fields__}


def test_the_report_of_a_large_mission_stays_short_until_the_run_is_over(mission: Mission) -> None:
    stops = tuple(msgspec.structs.replace(mission.stops[0], id=f"S{number}") for number in range(1, 1001))
    large = msgspec.structs.replace(mission, stops=stops)
    events = [item for item in run.reports(mission) if not isinstance(item, PoseReport | StateReport)]
    arrived, finished = events[1], events[-1]
    going = run_report([large], "run-1", {}, arrived)
    assert (going.count("| S"), "| S1 |" in going, "| S999 |" in going) == (60, True, False)
    assert "940 other stops are listed" in going
    assert run_report([large], "run-1", {}, finished).count("| S") == 1000


def test_names_of_a_thousand_stops_do_not_bury_the_plan(tmp_path: Path, mission: Mission) -> None:
    stops = tuple(msgspec.structs.replace(mission.stops[0], id=f"S{number}") for number in range(1, 1001))
    path = tmp_path / "field.rrd"
    with FieldRecording(path, msgspec.structs.replace(mission, stops=stops)):
        pass
    assert static(path, entities.STOPS, "Points2D:show_labels") == [False]
    assert len(static(path, entities.STOPS, "Points2D:labels")) == 1000


def test_no_path_is_drawn_through_what_nobody_knows_of() -> None:
    trail = Trail()
    _, first = trail.extended(Track.of([0, 10**9], [(0.0, 0.0), (1.0, 0.0)], [0.0, 0.0]))
    trail.end()
    _, second = trail.extended(Track.of([2 * 10**9, 3 * 10**9], [(5.0, 0.0), (6.0, 0.0)], [0.0, 0.0]))
    assert [strip.tolist() for strip in (*first, *second)] == [
        [[0.0, 0.0], [1.0, 0.0]],
        [[5.0, 0.0], [6.0, 0.0]],
    ]


def test_a_gap_is_drawn_dashed_with_its_length(tmp_path: Path, mission: Mission) -> None:
    path = tmp_path / "field.rrd"
    poses = [item for item in run.reports(mission) if isinstance(item, PoseReport)]
    first, last = poses[0], poses[-1]
    with FieldRecording(path, mission) as recording:
        recording.pose(first)
        recording.pose(last)
    (labels,) = on(path, f"{RUN}/unseen", "LineStrips2D:labels", entities.ROBOT_TIME).values()
    away = np.hypot(last.pose.x - first.pose.x, last.pose.y - first.pose.y)
    seconds = (last.robot_ns - first.robot_ns) / 1e9
    assert labels[0] == f"no poses for {seconds:.1f} s; {away:.1f} m apart"


def test_poses_of_the_past_are_measured_against_the_events_of_their_time(
    tmp_path: Path, mission: Mission
) -> None:
    """A station that comes late reads all events first, then a state of now, and then the poses."""
    path, late = tmp_path / "field.rrd", tmp_path / "late.rrd"
    reports = list(run.reports(mission))
    with FieldRecording(path, mission) as recording:
        for report in reports:
            tell(recording, report)
    events = [item for item in reports if not isinstance(item, PoseReport | StateReport)]
    poses = [item for item in reports if isinstance(item, PoseReport)]
    with FieldRecording(late, mission) as recording:
        for report in (*events[:-1], reports[-1]):
            tell(recording, report)
        for report in poses:
            tell(recording, report)
        tell(recording, events[-1])
    metric = f"{entities.METRIC_CROSS_TRACK}/{run.RUN}"
    watched, fetched = (on(item, metric, "Scalars:scalars", entities.ROBOT_TIME) for item in (path, late))
    assert {time: value[0] for time, value in fetched.items()} == pytest.approx(
        {time: value[0] for time, value in watched.items()}
    )
