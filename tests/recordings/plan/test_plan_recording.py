"""A plan's recording holds every stage, on the right timelines, in the right place."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.geometry import frozen
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.stages import DROP_REASONS
from stopgo.recordings import plan as plan_recording
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.plan import COMMON, CommonDrawings, PlanRecording, visibility
from stopgo.recordings.rrd.read import check
from tests.faults.sizes import some
from tests.recordings import world
from tests.recordings.conftest import write_plan
from tests.recordings.reading import cells, components, everything, on, static

NS = 1_000_000_000

read_once = cache(check)


def test_it_carries_the_mission_id_and_the_four_stages_of_time(plan: Path) -> None:
    held = read_once(plan)
    assert (held.application, held.recording_id, held.complete) == ("stopgo", world.MISSION_ID, True)
    assert held.timelines == ("candidate", "mission_time", "stage_step", "stop")


@pytest.mark.parametrize(
    "entity",
    [
        *("/plan/floor/outline", "/plan/floor/holes", "/plan/floor/room_names", "/plan/floor/openings"),
        *("/plan/floor/walls", "/plan/floor/columns", "/plan/floor/stairs", "/plan/floor/beams"),
        *("/plan/navigable/drive", "/plan/navigable/stop", "/plan/targets", "/plan/candidates"),
        *("/plan/visibility/rays", "/plan/visibility/seen", "/plan/selection/targets", "/plan/coverage"),
        *(
            "/plan/selection/sight",
            "/plan/selection/route",
            "/plan/why/sight",
            "/plan/why/alone",
            "/stop_story",
        ),
        *("/plan/stops", "/plan/route", "/plan/robot", "/world/floor/walls", "/world/stops"),
        *("/metrics/coverage/chosen", "/log/plan", "/report"),
    ],
)
def test_every_stage_is_drawn(plan: Path, entity: str) -> None:
    assert read_once(plan).rows[entity] >= 1


def test_nothing_that_changes_is_hidden_by_something_static(plan: Path) -> None:
    for entity, (fixed, changing) in components(plan).items():
        assert not fixed & changing, f"{entity}: static {fixed & changing} hides what changes"


def test_the_story_is_reported_on_one_timeline_each_step_where_the_log_says(plan: Path) -> None:
    """Floor, space, candidates, two choices, route; hatches make way for the choices."""
    space = on(plan, entities.DRIVE_AREA, "LineStrips2D:strips", entities.STEP)
    assert [(step, bool(strips)) for step, strips in sorted(space.items())] == [(1, True), (3, False)]
    assert list(on(plan, entities.CANDIDATES, "Points2D:positions", entities.STEP)) == [2]
    sights = on(plan, entities.SELECTION_SIGHT, "LineStrips2D:strips", entities.STEP)
    assert [(step, len(strips)) for step, strips in sorted(sights.items())] == [(3, 1), (4, 1), (5, 0)]
    assert list(on(plan, entities.SELECTION_ROUTE, "LineStrips2D:strips", entities.STEP)) == [5]
    lines = cells(plan, entities.LOG_PLAN, "TextLog:text")
    said = {times[entities.STEP]: text for times, (text,) in lines if text.startswith("step")}
    assert said[0].startswith("step 0: floor small room")
    assert said[3] == "step 3: choice 1 of 2 is S1"
    assert [said[k].split()[2] for k in (1, 2, 5)] == ["navigable", "candidates", "route"]
    told = on(plan, entities.STORY, "TextDocument:text", entities.STEP)
    assert sorted(told) == [0, 1, 2, 3, 4, 5]


def test_the_final_state_is_there_on_mission_time(plan: Path) -> None:
    for entity, component in (
        (entities.SELECTION_SEEN, "LineStrips2D:strips"),
        (entities.SELECTION_STOPS, "Points2D:positions"),
    ):
        found = cells(plan, entity, component)
        assert [times[entities.MISSION_TIME] for times, _ in found] == [0, 0]
        assert [times[entities.STEP] for times, _ in found] == [3, 4]
    assert not on(plan, entities.SELECTION_NEW, "LineStrips2D:strips", entities.MISSION_TIME)


def test_nothing_stands_at_the_origin(tmp_path: Path) -> None:
    """Whatever has a place has one on the floor, far from (0, 0); the robot is there when it has a pose."""
    path = write_plan(tmp_path / "plan.rrd", 300.0, 200.0)
    placed = ("Points2D:positions", "LineStrips2D:strips", "Arrows2D:origins")
    for entity in check(path).rows:
        for times, value in (cell for component in placed for cell in cells(path, entity, component)):
            if entity == entities.shape(entities.PLANNED_ROBOT):
                assert list(times) == [entities.MISSION_TIME]
            elif value:
                assert np.concatenate([np.ravel(item) for item in value]).min() > 199, entity


def test_a_stop_says_why_it_is_there(plan: Path) -> None:
    """S2 sees column 1's left and right face; the left is S1's, too. Three units of 0.1 m are its own."""
    told = on(plan, entities.STOP_STORY, "TextDocument:text", entities.STOP_NUMBER)
    assert sorted(told) == [1, 2]
    assert "alone sees 3 units, 0.3 m" in told[2][0].replace("\\", "")
    alone = on(plan, entities.WHY_ALONE, "LineStrips2D:strips", entities.STOP_NUMBER)
    length = [sum(float(np.hypot(*(np.array(b) - a))) for a, b in alone[k]) for k in (1, 2)]
    assert np.allclose(length, [0.4, 0.3], atol=1e-6)
    during = on(plan, entities.WHY_STOP, "Points2D:labels", entities.MISSION_TIME)
    assert [label for _, (label,) in sorted(during.items())] == ["S1", "S2"]


def test_each_candidate_says_why_it_was_dropped(plan: Path) -> None:
    ((_, classes),) = cells(plan, entities.CANDIDATES, "Points2D:class_ids")
    assert classes == [palette.reason(number).number for number in (0, 3, 0, 0, 1)]
    ((_, reasons),) = cells(plan, entities.CANDIDATES, "reason")
    assert reasons == [DROP_REASONS[number] for number in (0, 3, 0, 0, 1)]


def test_every_reason_and_kind_has_a_colour() -> None:
    assert {palette.reason(number).label for number in range(len(DROP_REASONS))} <= {
        item.label for item in palette.MEANINGS
    }
    assert set(palette.KIND_COLOURS) == set(KINDS)
    numbers = [item.number for item in palette.MEANINGS]
    assert len(numbers) == len(set(numbers))


def test_each_candidate_has_a_row_with_what_it_sees(plan: Path) -> None:
    seen = on(plan, "/plan/visibility/seen", "LineStrips2D:strips", entities.CANDIDATE)
    assert [len(seen[row]) for row in range(3)] == [2, 2, 1]
    # Row 2 sees units 16 to 18 of four on the lower face of column 2, from x = 4.0: 0.3 of 0.4 m.
    assert np.allclose(seen[2][0], [(4.0, 2.0), (4.3, 2.0)], atol=1e-6)
    rays = on(plan, "/plan/visibility/rays", "LineStrips2D:strips", entities.CANDIDATE)
    assert np.allclose(rays[2][0], [(4.0, 2.0), (5.0, 1.0), (4.3, 2.0)], atol=1e-6)


def test_of_many_millions_of_lines_one_candidate_in_so_many_is_shown(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of them with all that it sees; none has the lines of the one before."""
    monkeypatch.setattr(visibility, "MOST_LINES", 3)
    thin = write_plan(tmp_path / "thin.rrd")
    lines, points = "LineStrips2D:strips", "Points2D:positions"
    for entity, component in ((entities.SEEN, lines), (entities.RAYS, lines), (entities.EYE, points)):
        all_, some_ = (on(path, entity, component, entities.CANDIDATE) for path in (plan, thin))
        assert sorted(some_) == [0, 2]
        assert all(np.array_equal(some_[row], all_[row]) for row in some_)
    said = [text for _, (text,) in cells(thin, "/log/plan", "TextLog:text")]
    assert any(text.endswith("units visible from any; the timeline has 2 of 3 candidates") for text in said)


def test_each_choice_adds_what_it_newly_sees(plan: Path) -> None:
    def units(strips: list) -> int:
        return round(sum(float(np.hypot(*(np.array(b) - a))) for a, b in strips) / 0.1)

    ((_, all_of_them),) = cells(plan, entities.SELECTION_TARGETS, "LineStrips2D:strips")
    ((_, classes),) = cells(plan, entities.SELECTION_TARGETS, "LineStrips2D:class_ids")
    hidden = [strip for strip, number in zip(all_of_them, classes, strict=True)
              if number == palette.HIDDEN.number]  # fmt: skip
    assert (units(all_of_them), units(hidden)) == (32, 18)
    for entity in (entities.SELECTION_SEEN, entities.SELECTION_NEW):
        added = on(plan, entity, "LineStrips2D:strips", entities.STEP)
        assert [units(added[step]) for step in (3, 4)] == [8, 3]


def test_coverage_rises_with_each_stop(plan: Path) -> None:
    coverage = on(plan, "/metrics/coverage/chosen", "Scalars:scalars", entities.STEP)
    assert [round(coverage[step][0], 2) for step in (2, 3, 4)] == [0.0, 57.14, 78.57]
    planned = on(plan, "/metrics/coverage/planned", "Scalars:scalars", entities.MISSION_TIME)
    assert [round(value[0], 2) for _, value in sorted(planned.items())] == [0.0, 57.14, 78.57]


def test_the_planned_robot_stands_at_its_stops_when_it_scans(plan: Path) -> None:
    poses = on(plan, entities.PLANNED_ROBOT, "Transform3D:translation", entities.MISSION_TIME)
    # 2.2 m at 0.5 m/s and 0.5 m/s²: 4.4 s and 1 s to speed up and slow down, after 62 s at stop 1.
    arrived = poses[round((62 + 5.4) * NS)]
    assert np.allclose(arrived[0], (3.2, 1.0, 0.0), atol=1e-6)


def test_findings_and_results_are_reported(plan: Path) -> None:
    lines = [value[0] for _, value in cells(plan, entities.LOG_PLAN, "TextLog:text")]
    assert sum("unknown_layer" in line for line in lines) == 1
    assert sum("narrow_door" in line for line in lines) == 1
    told = read_once(plan).properties
    assert (told["plan"]["stops"], told["plan"]["coverage"], told["plan"]["route_m"]) == (2, 0.7857, 2.2)
    assert told["plan"]["findings"] == 2  # one of the floor, one of the space
    assert (told["plan"]["floor_digest"], told["parameters"]["d_sec"]) == (world.FLOOR_DIGEST, "0.7")
    (report,) = static(plan, entities.REPORT, "TextDocument:text")
    assert "| stops | 2 |" in report


def test_the_same_plan_makes_the_same_recording(plan: Path, tmp_path: Path) -> None:
    """Rerun files are never byte-identical; what they hold is."""
    again = write_plan(tmp_path / "again.rrd")
    assert everything(again) == everything(plan)


def test_far_coordinates_keep_their_millimetres(tmp_path: Path) -> None:
    x, y = 500_123.4567, 5_400_987.6543
    path = write_plan(tmp_path / "far.rrd", x, y)
    origin = check(path).properties["plan"]["local_origin"]
    assert origin == [500_100.0, 5_401_000.0]
    stops = np.array(static(path, entities.STOPS, "Points2D:positions"), dtype=np.float64) + origin
    assert np.abs(stops - [(x + 1.0, y + 1.0), (x + 3.2, y + 1.0)]).max() < 1e-4
    (report,) = static(path, entities.REPORT, "TextDocument:text")
    assert "x = 500100 m, y = 5401000 m" in report


@pytest.mark.parametrize("count", some(range(9), every=2))
def test_a_plan_may_end_after_any_stage(tmp_path: Path, count: int) -> None:
    recording = PlanRecording(world.MISSION_ID)
    for noun in (*world.nouns_at()[:count], object()):
        recording.observe(noun)
    recording.write(tmp_path / "plan.rrd")
    assert check(tmp_path / "plan.rrd").complete


def test_stages_that_found_nothing_are_recorded_too(tmp_path: Path) -> None:
    floor, space, candidates, visibility, selection, *_ = world.nouns_at()
    nothing = frozen([], np.int64)
    blind = replace(
        visibility, pointer=frozen([0] * 4, np.int64), segment=nothing, first=nothing, last=nothing
    )
    recording = PlanRecording(world.MISSION_ID)
    recording.observe(replace(floor, rooms=(), openings=(), elements=()))
    recording.observe(replace(space, rooms=(), openings=(), drive_area=()))
    recording.observe(replace(candidates, xy=frozen(np.empty((0, 2))), reason=nothing, room=nothing))
    recording.observe(blind)
    recording.observe(replace(selection, visibility=blind, chosen=nothing, coverage_steps=frozen([])))
    recording.write(tmp_path / "plan.rrd")
    assert check(tmp_path / "plan.rrd").complete


def test_edges_are_called_by_their_elements_and_global_ids_where_a_model_has_them(tmp_path: Path) -> None:
    floor = world.floor_at()
    named = replace(floor.elements[1], global_id="0LiOMJvJv5Bu0hPkJYEFGw")
    recording = PlanRecording(world.MISSION_ID)
    recording.observe(replace(floor, elements=(floor.elements[0], named, *floor.elements[2:])))
    recording.write(tmp_path / "plan.rrd")
    labels = static(tmp_path / "plan.rrd", "/plan/floor/columns", "LineStrips2D:labels")
    assert list(labels) == ["c1 0LiOMJvJv5Bu0hPkJYEFGw", "c2"]
    assert not cells(tmp_path / "plan.rrd", "/plan/floor/walls", "LineStrips2D:labels")


def test_what_recordings_have_in_common_is_drawn_once_for_an_origin(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[type] = []
    for kind, drawings in plan_recording.DRAWINGS.items():
        noted = (lambda canvas, result, kind=kind: drawn.append(kind), *drawings)
        monkeypatch.setitem(plan_recording.DRAWINGS, kind, noted)
    common, near, far = CommonDrawings(), world.nouns_at(), world.nouns_at(500_100.0, 5_401_000.0)
    for nouns, others in ((near, False), (near, True), (far, False), (far, True)):
        drawn.clear()
        recording = PlanRecording(world.MISSION_ID, common)
        for noun in nouns:
            recording.observe(noun)
        assert recording.draw()
        kinds = {type(noun) for noun in nouns if type(noun) in plan_recording.DRAWINGS}
        assert sorted(map(str, drawn)) == sorted(map(str, kinds - COMMON if others else kinds))
