"""Scans in a log show targets with points, deviations, and unplanned objects."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import read
from stopgo.mission.stages.coverage_totals import totals_of_plan
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, as_driven, planned_floor, top_up
from stopgo.planner.pipeline.measuring import measured
from stopgo.recordings.logs.field_log import FieldLog, Sweep, poses_of
from stopgo.recordings.replay.drive_verdict import DriveJudgement, drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.placed_sweeps import placed_sweeps
from stopgo.recordings.replay.replay_page import to_do
from stopgo.recordings.replay.replay_text import measured_lines, notes_of
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.replay.standstills import find_standstills
from tests.planner.test_command import drawn
from tests.recordings.clouds.test_clouds import ply
from tests.recordings.replay.driving import driven, logged
from tests.recordings.replay.test_as_driven import PLAN
from tests.recordings.replay.test_replaying import held

HEAP = (2.6, 0.9, 3.0, 1.3)
MOUNT = ("laser", 0.2, 0.1, 0.5)
RAYS = 720


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A planned floor of two rooms."""
    path = tmp_path_factory.mktemp("floor")
    assert main(["plan", str(drawn(path / "floor.dxf")), "-o", str(path), *PLAN]) == 0
    return path


@pytest.fixture(scope="module")
def planned(folder: Path) -> PlannedFloor:
    return planned_floor(folder / "floor.dxf", read(folder / "mission.json"))


def scanned(
    planned: PlannedFloor, *heaps: tuple[float, float, float, float], off: float = 0.0, headings: bool = True
) -> Replay:
    """A drive of the whole mission with a laser, turned on its mount, that meets walls moved by `off`."""
    mission: Mission = planned.mission
    track = logged(driven(mission))
    walls = [shapely.Polygon(shape.exterior, shape.holes) for shape in planned.space.occluders]
    solid = shapely.union_all([*walls, *(shapely.box(*heap) for heap in heaps)])
    solid = shapely.affinity.translate(solid, xoff=off)
    halts = find_standstills(track, speed=mission.robot.speed)

    def sweeps() -> Iterator[Sweep]:
        for halt in halts:
            for k in range(3):
                xyz = seen_by_laser(solid, (halt.x, halt.y, halt.heading))
                yield Sweep(halt.begin_ns + (k + 1) * 10**9, "/scan", "laser", xyz)

    heading = track.heading if headings else np.full(len(track), np.nan)
    poses = poses_of("/odom", "map", track.ns, track.xy, heading)
    assert poses is not None
    log: FieldLog = replace(held(poses), sweeps=sweeps, mounts=(MOUNT,))
    return replay(log, mission, Placing(align="first"))


def seen_by_laser(solid: shapely.Geometry, pose: tuple[float, float, float]) -> np.ndarray:
    """Points (n, 3) in the laser's frame."""
    _, dx, dy, turn = MOUNT
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y, heading = pose[0] + cos * dx - sin * dy, pose[1] + sin * dx + cos * dy, pose[2] + turn
    angles = np.arange(RAYS) * math.tau / RAYS
    ends = np.stack([x + 20 * np.cos(heading + angles), y + 20 * np.sin(heading + angles)], axis=-1)
    rays = shapely.linestrings(np.stack([np.broadcast_to((x, y), ends.shape), ends], axis=1))
    hits = shapely.intersection(rays, solid.boundary)
    ranges = shapely.distance(shapely.Point(x, y), hits)
    flat = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)[np.isfinite(ranges)]
    return np.column_stack([flat, np.zeros(len(flat))])


def test_walls_as_planned_are_measured_without_deviation(planned: PlannedFloor) -> None:
    found = measured(planned, placed_sweeps(scanned(planned)))
    assert found.unplanned == ()
    assert (found.coverage.whole.coverage or 0) > 0.8
    for _, count, mean, rms in found.deviations:
        assert count > 10
        assert abs(mean) <= 0.006
        assert rms <= 0.02


def test_a_wall_that_stands_elsewhere_is_reported_by_its_side(planned: PlannedFloor) -> None:
    """All walls 4 cm to the right: the left faces of the room come nearer, the right ones go away."""
    found = measured(planned, placed_sweeps(scanned(planned, off=0.04)), tolerance=0.02)
    means = [mean for _, _, mean, _ in found.deviations]
    assert max(means) > 0.02
    assert min(means) < -0.02
    as_planned = measured(planned, placed_sweeps(scanned(planned)), tolerance=0.02)
    assert (found.coverage.whole.coverage or 0) < 0.75 * (as_planned.coverage.whole.coverage or 0)


def test_scans_of_which_nobody_knows_the_heading_measure_nothing(planned: PlannedFloor) -> None:
    """Turned as the robot drove, they would show walls elsewhere, and objects that nobody planned."""
    found = scanned(planned, headings=False)
    assert list(placed_sweeps(found)) == []
    assert "no headings in the log: the direction of driving is used, and no laser scan" in notes_of(found)


def test_what_nobody_planned_is_found_and_driven_round(planned: PlannedFloor) -> None:
    found = measured(planned, placed_sweeps(scanned(planned, HEAP)))
    (heap,) = found.unplanned
    assert math.dist(heap.middle, (2.8, 1.1)) < 0.15
    assert 0.3 < heap.size_m < 0.7
    further = top_up(planned, np.empty((0, 3)), obstacles=[heap.outline])
    assert further is not None
    kept = shapely.Polygon(heap.outline.exterior)
    legs = [shapely.LineString(stop.approach) for stop in further.stops if len(stop.approach) > 1]
    assert all(leg.distance(kept) > planned.settings.radius - 0.01 for leg in legs)


def test_the_scanners_own_clouds_count_the_same_way(
    folder: Path, planned: PlannedFloor, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Points all over the walls, from floor to ceiling, and a heap of which nobody knew."""
    mission = planned.mission
    track = logged(driven(mission))
    table = zip(track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    rows = "".join(f"{ns},{x},{y},{heading}\n" for ns, (x, y), heading in table)
    (tmp_path / "run.csv").write_text("time_ns,x,y,heading\n" + rows)
    ring = shapely.box(*HEAP).exterior
    heap = shapely.get_coordinates(ring.interpolate(np.linspace(0, ring.length, 200)))
    flat = np.concatenate([planned.space.targets.unit_xy, heap])
    (tmp_path / "clouds").mkdir()
    points = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in (0.0, 0.8, 1.6, 2.6)])
    ply(tmp_path / "clouds" / "all.ply", points)
    given = ["--mission", str(folder / "mission.json"), "--align", "first", "--json"]
    floor = ["--floor", str(folder / "floor.dxf"), "--clouds", str(tmp_path / "clouds")]
    main(["replay", str(tmp_path / "run.csv"), *given, *floor])
    found = json.loads(capsys.readouterr().out)["measured"]
    assert found["share"] == 1.0
    assert found["points"] == 2 * len(flat)
    (unplanned,) = found["unplanned"]
    assert math.dist((unplanned["x"], unplanned["y"]), (2.8, 1.1)) < 0.15


def test_what_walked_by_once_is_nothing(planned: PlannedFloor) -> None:
    person = np.stack([np.linspace(2.0, 2.4, 50), np.full(50, 1.0)], axis=-1)
    assert measured(planned, [person]).unplanned == ()
    assert measured(planned, [person] * 3).unplanned != ()


@pytest.mark.parametrize("points", [np.empty((0, 2)), np.full((3, 2), np.nan), np.full((3, 2), 1e12)])
def test_points_of_nowhere_show_nothing(planned: PlannedFloor, points: np.ndarray) -> None:
    found = measured(planned, [points])
    assert not found.hit.any()
    assert found.unplanned == ()


def wall_points(planned: PlannedFloor, *, without: str = "") -> np.ndarray:
    """A point on every unit, of all elements or all but one."""
    targets = planned.space.targets
    names = np.array([item.id for item in planned.space.floor.elements])
    return targets.unit_xy[names[targets.element[targets.unit_segment]] != without]


def judged(planned: PlannedFloor, *clouds: np.ndarray) -> DriveJudgement:
    """The verdict on the drive of the whole mission, with clouds."""
    found = measured(planned, clouds, least_sweeps=1, surveyed=True)
    driven_well = scanned(planned)
    sight = as_driven(planned, driven_well.scanned_from)
    return drive_verdict(driven_well.with_sight(sight).with_measured(found))


def test_clouds_that_show_everything_leave_the_verdict(planned: PlannedFloor) -> None:
    found = judged(planned, wall_points(planned))
    assert (found.answer, found.headline) == ("yes", "Driven as planned")
    assert "Of what is visible, 100.0 % was measured" in found.text


def test_missing_clouds_are_a_no(planned: PlannedFloor) -> None:
    points = wall_points(planned)
    found = judged(planned, points[points[:, 0] < points[:, 0].mean()])
    assert (found.answer, found.headline) == ("no", "Not measured as planned")


@pytest.mark.parametrize("move", [(0.2, 0.0), (0.2, -0.2), (100.0, 0.0)])
def test_clouds_that_do_not_lie_on_the_floor_report_nothing(
    planned: PlannedFloor, move: tuple[float, float]
) -> None:
    points = wall_points(planned)
    found = judged(planned, points, points + move)
    assert (found.answer, found.exit_code) == ("unknown", 3)
    assert "1 of 2 clouds do not lie on the floor" in found.text


def test_a_wall_that_was_never_built_is_named(planned: PlannedFloor) -> None:
    lengths = {item.name: item.seen for item in totals_of_plan(planned.seen).by_element(planned.seen.visible)}
    least = min((name for name in lengths if lengths[name] >= 0.5), key=lambda name: lengths[name])
    points = wall_points(planned, without=least)
    assert f"No point lies on {least}," in judged(planned, points).text
    found = measured(planned, [points], least_sweeps=1, surveyed=True)
    driven_well = scanned(planned)
    sight = as_driven(planned, driven_well.scanned_from)
    (absent,) = found.absent(sight.driven)
    assert (absent.id, absent.empty) == (least, 1.0)
    by_element = {item.name: item for item in sight.elements}
    assert absent.visible == pytest.approx(by_element[least].seen / by_element[least].visible)
    lines = measured_lines(driven_well.with_sight(sight).with_measured(found))
    assert any(line.startswith(f"  absent     {least}: no point on 100.0 % of") for line in lines)


def test_what_nobody_planned_is_reported_with_the_share_of_scans_that_hit_it(planned: PlannedFloor) -> None:
    heap = np.stack([np.linspace(2.0, 2.4, 50), np.full(50, 1.0)], axis=-1)
    points = wall_points(planned)
    clouds = [points, np.concatenate([points, heap]), points, points]
    found = measured(planned, clouds, least_sweeps=1, surveyed=True)
    (item,) = found.unplanned
    assert (item.hits, item.sweeps) == (1, 4)
    shown = scanned(planned).with_measured(found)
    assert any("hit in 1 of 4 scans (25.0 %)" in line for line in measured_lines(shown))
    assert any("hit in 25.0 % of the scans" in line for line in to_do(shown))


def test_a_follow_up_mission_scans_what_the_clouds_lack(planned: PlannedFloor) -> None:
    shown = np.zeros(planned.space.targets.total, bool)
    everything = scanned(planned).scanned_from
    assert top_up(planned, everything) is None
    further = top_up(planned, everything, measured=shown)
    assert further is not None
    assert len(further.stops) >= len(planned.mission.stops) - 1
    assert top_up(planned, everything, measured=~shown) is None
