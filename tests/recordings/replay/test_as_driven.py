"""Targets visible from the robot's true stationary poses, and the follow-up mission for the rest."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from msgspec import UNSET, UnsetType

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import read, write
from stopgo.mission.files.plan_toml import recorded_settings
from stopgo.mission.geometry import Polygon
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, as_driven, planned_floor, top_up
from tests.planner.test_command import drawn
from tests.recordings.replay.driving import Odd, driven, logged

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
PLAN = [
    "--range",
    "3",
    "--coverage",
    "0.9",
    "--settle",
    "1",
    "--scan-time",
    "8",
    "--no-refine",
    "--no-register",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A planned floor of two rooms."""
    path = tmp_path_factory.mktemp("floor")
    assert main(["plan", str(drawn(path / "floor.dxf")), "-o", str(path), *PLAN]) == 0
    return path


@pytest.fixture(scope="module")
def planned(folder: Path) -> PlannedFloor:
    return planned_floor(folder / "floor.dxf", read(folder / "mission.json"))


def places(planned: PlannedFloor, *left_out: int) -> np.ndarray:
    stops = [(stop.x, stop.y, stop.heading) for stop in planned.mission.stops]
    return np.array([place for k, place in enumerate(stops) if k not in left_out]).reshape(-1, 3)


def test_a_robot_that_stood_at_every_stop_saw_what_was_planned(planned: PlannedFloor) -> None:
    seen = as_driven(planned, places(planned))
    assert (seen.driven == seen.planned).all()
    assert seen.enough
    assert top_up(planned, places(planned)) is None


def test_without_its_last_stop_less_was_seen_and_the_top_up_brings_the_rest(planned: PlannedFloor) -> None:
    last = len(planned.mission.stops) - 1
    left = places(planned, last)
    seen = as_driven(planned, left)
    assert not seen.enough
    further = top_up(planned, left)
    assert further is not None
    assert further.id != planned.mission.id
    more = np.array([(stop.x, stop.y, stop.heading) for stop in further.stops])
    assert len(more) <= 1 + last
    assert as_driven(planned, np.concatenate([left, more])).enough


def test_nothing_seen_needs_no_more_stops_than_the_plan(planned: PlannedFloor) -> None:
    further = top_up(planned, np.empty((0, 3)))
    assert further is not None
    assert len(further.stops) <= len(planned.mission.stops) + 1
    assert not as_driven(planned, np.empty((0, 3))).driven.any()


def test_a_top_up_keeps_clear_of_what_the_plan_did_not_know(planned: PlannedFloor) -> None:
    stop = planned.mission.stops[-1]
    heap = Polygon.of(
        [(stop.x + dx, stop.y + dy) for dx, dy in ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))]
    )
    further = top_up(planned, places(planned, len(planned.mission.stops) - 1), obstacles=[heap])
    assert further is not None
    for item in further.stops:
        assert max(abs(item.x - stop.x), abs(item.y - stop.y)) >= 0.2 + 0.69


@pytest.fixture(scope="module")
def follow_up(tmp_path_factory: pytest.TempPathFactory) -> PlannedFloor:
    """A follow-up mission for three stops of an office."""
    path = tmp_path_factory.mktemp("office")
    floor = shutil.copy(SAMPLE, path / "floor.dxf")
    assert main(["plan", str(floor), "-o", str(path), "--no-refine", "--no-register"]) == 0
    office = planned_floor(path / "floor.dxf", read(path / "mission.json"))
    assert not office.is_follow_up
    mission = top_up(office, places(office, 2, 5, 8))
    assert mission is not None and len(mission.stops) > 1
    return PlannedFloor(office.floor, recorded_settings(mission.origin.parameters), mission)


def test_a_follow_up_mission_is_followed_by_what_it_left_itself(follow_up: PlannedFloor) -> None:
    """Any other part of the floor, which the first run has scanned, does not count instead."""
    for number in range(len(follow_up.mission.stops)):
        left = places(follow_up, number)
        second = top_up(follow_up, left)
        assert second is not None
        more = np.array([(stop.x, stop.y, stop.heading) for stop in second.stops])
        seen = as_driven(follow_up, np.concatenate([left, more]))
        assert not (seen.planned & ~seen.driven).any()


@pytest.mark.parametrize("by", [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)])
def test_a_follow_up_mission_driven_within_tolerance_leaves_nothing(
    by: tuple[float, float], follow_up: PlannedFloor
) -> None:
    """Its required coverage is exactly what its stops see, of which a centimetre costs a little."""
    poses = places(follow_up) + np.array([*by, 0.0])
    assert as_driven(follow_up, poses).enough
    assert top_up(follow_up, poses) is None


def test_the_command_reports_coverage_and_writes_the_top_up(
    folder: Path, planned: PlannedFloor, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = planned.mission
    last = len(mission.stops) - 1
    track = logged(driven(mission, Odd(skipped=frozenset({last}))))
    rows = zip(track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    table = "".join(f"{ns},{x},{y},{heading}\n" for ns, (x, y), heading in rows)
    (folder / "run.csv").write_text("time_ns,x,y,heading\n" + table)
    given = [str(folder / "run.csv"), "--mission", str(folder / "mission.json"), "--align", "first", "--json"]
    floor = ["--floor", str(folder / "floor.dxf"), "--top-up", str(folder / "next.json")]
    assert main(["replay", *given, *floor]) == 3  # the log ends where the stop would be
    told = json.loads(capsys.readouterr().out)
    whole = told["coverage"]["shares"]["all"]
    seen = as_driven(planned, places(planned, last)).coverage.whole
    assert whole["as_driven"] == pytest.approx(seen.coverage, abs=0.005)
    assert whole["planned"] > whole["as_driven"]
    assert main(["check", str(folder / "next.json"), "--floor", str(folder / "floor.dxf")]) == 0


def test_a_lost_robots_stops_are_planned_from_the_missions_of_both_robots(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Robot 1 drives its whole mission, its part; robot 2 is lost before its first stop, and has no log."""
    floor = str(drawn(tmp_path / "floor.dxf"))
    assert main(["plan", floor, "-o", str(tmp_path), *PLAN, "--robots", "2", "--start", "1,1,0"]) == 0
    names = [str(tmp_path / name) for name in ("mission.json", "mission-2.json")]
    mission, lost = (read(Path(name)) for name in names)
    track = logged(driven(mission, Odd()))
    rows = zip(track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    table = "".join(f"{ns},{x},{y},{heading}\n" for ns, (x, y), heading in rows)
    (tmp_path / "run.csv").write_text("time_ns,x,y,heading\n" + table)
    log, further = str(tmp_path / "run.csv"), tmp_path / "next.json"
    given = ["replay", log, "--align", "first", "--floor", floor, "--top-up", str(further)]
    capsys.readouterr()
    assert main(["replay", log, "--map", "0,0,0", "--floor", floor, "--mission", names[0]]) == 0
    assert "required" not in capsys.readouterr().out.rpartition("Driven as planned")[2]
    assert main([*given, "--mission", names[0]]) == 2
    assert "give also mission 2 of 2" in capsys.readouterr().err
    both = [*given, "--mission", names[0], "--mission", names[1]]
    assert main([*both, "--html", str(tmp_path / "page.html")]) == 2
    assert "is of one mission, not 2" in capsys.readouterr().err
    capsys.readouterr()
    assert main(both) == 1
    told = capsys.readouterr()
    assert "Driven as planned" in told.out
    assert f"{lost.name} ({lost.id[:12]}): no log of it is given; it counts as not driven" in told.err
    left = read(further)
    assert left.share is UNSET
    assert 0 < len(left.stops) <= len(lost.stops)


def test_limits_on_views_hold_as_driven_and_for_the_top_up(tmp_path: Path) -> None:
    """Each wall is to be seen from two stops: left by one, what only one other sees counts no more."""
    limits = ["--min-views", "2", "--max-incidence", "65", "--min-range", "0.9"]
    floor = drawn(tmp_path / "floor.dxf")
    assert main(["plan", str(floor), "-o", str(tmp_path), *PLAN, *limits]) == 0
    planned = planned_floor(floor, read(tmp_path / "mission.json"))
    whole = as_driven(planned, places(planned))
    assert whole.enough
    assert (whole.driven == whole.planned).all()
    left = places(planned, 1)
    seen = as_driven(planned, left)
    assert not seen.enough
    further = top_up(planned, left)
    assert further is not None
    assert not isinstance(further.limits, UnsetType)
    assert (further.limits.near, further.limits.views) == (0.9, UNSET)
    more = np.array([(stop.x, stop.y, stop.heading) for stop in further.stops])
    assert as_driven(planned, np.concatenate([left, more])).enough
    write(further, tmp_path / "next.json")
    assert main(["check", str(tmp_path / "next.json"), "--floor", str(floor)]) == 0


def test_a_floor_of_another_mission_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = drawn(tmp_path / "other.dxf", door=1.1)
    (tmp_path / "run.csv").write_text("time,x,y\n0,0,0\n")
    mission = ["--mission", str(folder / "mission.json"), "--align", "first"]
    assert main(["replay", str(tmp_path / "run.csv"), *mission, "--top-up", str(tmp_path / "n.json")]) == 2
    assert "--floor" in capsys.readouterr().err
    with pytest.raises(InputError, match="is not the floor"):
        planned_floor(other, read(folder / "mission.json"))


def test_where_a_narrow_scanner_looked_is_not_made_up(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The directions of driving, in a log without headings, say nothing of it: nor of what was visible."""
    floor = str(drawn(tmp_path / "floor.dxf"))
    assert main(["plan", floor, "-o", str(tmp_path), *PLAN, "--fov", "180"]) == 0
    track = logged(driven(read(tmp_path / "mission.json")))
    rows = zip(track.ns.tolist(), track.xy.tolist(), strict=True)
    table = "".join(f"{ns},{x},{y}\n" for ns, (x, y) in rows)
    (tmp_path / "run.csv").write_text("time_ns,x,y\n" + table)
    further = tmp_path / "next.json"
    given = ["replay", str(tmp_path / "run.csv"), "--mission", str(tmp_path / "mission.json")]
    capsys.readouterr()
    assert main([*given, "--map", "0,0,0", "--floor", floor, "--top-up", str(further), "--json"]) == 3
    told, said = capsys.readouterr()
    found = json.loads(told)
    assert found["coverage"] is None and {stop["heading_rad"] for stop in found["run"]["stops"]} == {None}
    why = "its scanner sees 180°, and the log has no headings; give another source of poses"
    assert f"what was visible is undecided: {why}" in said and not further.exists()
    assert f"{further}: not written: it is not known what was visible" in said
