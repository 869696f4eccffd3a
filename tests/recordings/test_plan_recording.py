"""A plan's recording holds every stage, on the right timelines, in the right place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mission.geometry import frozen
from mission.kinds import KINDS
from mission.planning import DROP_REASONS
from recordings import entities, palette
from recordings.plan import PlanRecording
from recordings.read import check
from tests.recordings import world
from tests.recordings.conftest import write_plan
from tests.recordings.reading import cells, components, everything, on, static

NS = 1_000_000_000


def test_it_carries_the_mission_id_and_the_four_stages_of_time(plan: Path) -> None:
    held = check(plan)
    assert (held.application, held.recording_id, held.complete) == ("stopgo", world.MISSION_ID, True)
    assert held.timelines == ("candidate", "mission_time", "stage_step")


@pytest.mark.parametrize(
    "entity",
    [
        *("/plan/floor/outline", "/plan/floor/holes", "/plan/floor/room_names", "/plan/floor/openings"),
        *("/plan/floor/walls", "/plan/floor/columns", "/plan/floor/stairs", "/plan/floor/beams"),
        *("/plan/navigable/drive", "/plan/navigable/stop", "/plan/targets", "/plan/candidates"),
        *("/plan/visibility/rays", "/plan/visibility/seen", "/plan/selection/targets", "/plan/coverage"),
        *("/plan/stops", "/plan/route", "/plan/robot", "/world/floor/walls", "/world/stops"),
        *("/metrics/coverage/chosen", "/log/plan", "/report"),
    ],
)
def test_every_stage_is_drawn(plan: Path, entity: str) -> None:
    assert check(plan).rows[entity] >= 1


def test_nothing_that_changes_is_hidden_by_something_static(plan: Path) -> None:
    for entity, (fixed, changing) in components(plan).items():
        assert not fixed & changing, f"{entity}: static {fixed & changing} hides what changes"


def test_the_final_state_is_there_on_mission_time(plan: Path) -> None:
    for entity in ("/plan/selection/targets", "/plan/selection/stops"):
        component = "Points2D:positions" if entity.endswith("stops") else "LineStrips2D:class_ids"
        steps = on(plan, entity, component, entities.STEP)
        (final,) = on(plan, entity, component, entities.MISSION_TIME).values()
        assert len(final) == len(steps[2])
    assert (
        palette.NEW.number
        not in on(plan, "/plan/selection/targets", "LineStrips2D:class_ids", entities.MISSION_TIME)[0]
    )


def test_each_candidate_says_why_it_was_dropped(plan: Path) -> None:
    classes = static(plan, entities.CANDIDATES, "Points2D:class_ids")
    assert classes == [palette.reason(number).number for number in (0, 3, 0, 0, 1)]
    reasons = static(plan, entities.CANDIDATES, "reason")
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


def test_units_change_their_class_as_they_get_seen(plan: Path) -> None:
    lines = static(plan, "/plan/selection/targets", "LineStrips2D:strips")
    lengths = np.array([np.hypot(*(np.array(b) - a)) for a, b in lines]) / 0.1
    steps = on(plan, "/plan/selection/targets", "LineStrips2D:class_ids", entities.STEP)

    def units(step: int, meaning: palette.Meaning) -> int:
        return round(float(lengths[np.array(steps[step]) == meaning.number].sum()))

    told = (palette.UNSEEN, palette.NEW, palette.SEEN, palette.HIDDEN)
    assert [units(0, item) for item in told] == [14, 0, 0, 18]
    assert [units(1, item) for item in told] == [6, 8, 0, 18]
    assert [units(2, item) for item in told] == [3, 3, 8, 18]


def test_coverage_rises_with_each_stop(plan: Path) -> None:
    coverage = on(plan, "/metrics/coverage/chosen", "Scalars:scalars", entities.STEP)
    assert [round(coverage[step][0], 2) for step in range(3)] == [0.0, 57.14, 78.57]
    planned = on(plan, "/metrics/coverage/planned", "Scalars:scalars", entities.MISSION_TIME)
    assert [round(value[0], 2) for _, value in sorted(planned.items())] == [0.0, 57.14, 78.57]


def test_the_planned_robot_stands_at_its_stops_when_it_scans(plan: Path) -> None:
    poses = on(plan, entities.PLANNED_ROBOT, "Transform3D:translation", entities.MISSION_TIME)
    # 2.2 m at 0.5 m/s and 0.5 m/s²: 4.4 s and 1 s to speed up and slow down, after 62 s at stop 1.
    arrived = poses[round((62 + 5.4) * NS)]
    assert np.allclose(arrived[0], (3.2, 1.0, 0.0), atol=1e-6)


def test_findings_and_results_are_told(plan: Path) -> None:
    lines = [value[0] for _, value in cells(plan, entities.LOG_PLAN, "TextLog:text")]
    assert sum("unknown_layer" in line for line in lines) == 1
    assert sum("narrow_door" in line for line in lines) == 1
    told = check(plan).properties
    assert (told["plan"]["stops"], told["plan"]["coverage"], told["plan"]["route_m"]) == (2, 0.7857, 2.2)
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


@pytest.mark.parametrize("count", range(9))
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
