"""Embedded data is read back unchanged: the mission, what its stops see, and runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import PoseReport, StateReport
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.drawing.canvas import Sheet, open_canvas
from stopgo.recordings.embedded.reading import Recording, read_recording
from stopgo.recordings.embedded.sight import embed_sight, sights_in
from stopgo.recordings.embedded.values import Values
from tests.mission.comparing.test_compare import planned
from tests.recordings import run, world


@pytest.fixture(scope="module")
def read(field: Path) -> Recording:
    return read_recording(field)


def embedded(sight: Sight, path: Path) -> Values:
    sheet = Sheet(recording_id="a" * 32, name="n", origin=(0.0, 0.0), extent=(0.0, 0.0, 1.0, 1.0))
    with open_canvas(sheet) as canvas:
        embed_sight(canvas, sight)
        path.write_bytes(canvas.drain())
    values = Values()
    for chunk in RrdReader(path).stream():
        values.take(chunk)
    return values


def test_a_run_is_read_back_event_by_event(read: Recording, mission: Mission) -> None:
    (log,) = read.logs
    told = [item for item in run.reports(mission) if not isinstance(item, PoseReport | StateReport)]
    assert list(log.events) == told
    assert (log.run_id, log.mission_id, log.revision, log.robot) == (run.RUN, mission.id, 1, "r1")
    assert (log.source.format, len(log.source.digest), log.source.lost) == ("rrd", 64, 0)


def test_its_poses_are_as_exact_as_they_were_reported(read: Recording, mission: Mission) -> None:
    poses = [item for item in run.reports(mission) if isinstance(item, PoseReport)]
    (log,) = read.logs
    by_time = {item.robot_ns: item.pose for item in poses}
    for ns, (x, y) in zip(log.poses.ns.tolist(), log.poses.xy.tolist(), strict=True):
        assert (x, y) == (by_time[ns].x, by_time[ns].y)
    assert len(log.poses) > 10


def test_the_mission_travels_in_plan_and_run(plan: Path, read: Recording, mission: Mission) -> None:
    assert read.missions == (mission,)
    assert read_recording(plan).missions == (mission,)


def test_every_revision_travels(revised: Path, mission: Mission) -> None:
    assert read_recording(revised).missions == (mission, world.revised(mission))


def test_what_stops_see_comes_back_whole(tmp_path: Path) -> None:
    _, sight = planned()
    (back,) = sights_in(embedded(sight, tmp_path / "sight.rrd"), "sight.rrd")
    for name in ("mission_id", "revision", "digest", "stops"):
        assert getattr(back, name) == getattr(sight, name)
    for name in ("weight", "visible", "room", "element"):
        assert np.array_equal(getattr(back.totals, name), getattr(sight.totals, name)), name
    assert (back.totals.rooms, back.totals.elements) == (sight.totals.rooms, sight.totals.elements)
    assert back.planned == sight.planned
    assert back.coverage(["S1"]) == sight.coverage(["S1"])
    assert np.array_equal(back.targets.unit_xy, sight.targets.unit_xy)


def test_how_many_views_are_asked_for_travels(tmp_path: Path) -> None:
    _, sight = planned()
    asked = np.ones(len(sight.totals.weight), dtype=np.int64)
    asked[::2] = 2
    twice = replace(sight, totals=replace(sight.totals, asked=asked))
    (back,) = sights_in(embedded(twice, tmp_path / "sight.rrd"), "sight.rrd")
    assert np.array_equal(back.totals.asked, asked)
    assert back.planned == twice.planned != sight.planned


def test_sight_that_does_not_fit_is_reported(tmp_path: Path) -> None:
    _, sight = planned()
    object.__setattr__(sight, "last", sight.last + 1000)
    with pytest.raises(InputError, match=r"sight\.rrd: visibility of its stops is damaged"):
        sights_in(embedded(sight, tmp_path / "sight.rrd"), "sight.rrd")
