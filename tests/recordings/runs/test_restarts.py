"""A robot that is killed between two stops and started again, its clock set back: one run in two boots."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Iterator
from pathlib import Path
from threading import Event

import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.command_line import main
from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import write
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.runs.field import FieldRecording
from tests.bridge.world import Field
from tests.faults.sizes import size
from tests.faults.test_crashes import PowerCut
from tests.recordings.conftest import tell
from tests.recordings.replay.driving import wandering

STEP_S = 0.1
SEEDS = range(size(short=3, full=40))


class KilledClock(SimulatedClock):
    """Time in which a robot sends a pose each `STEP_S`, and is killed once it has driven so far."""

    def __init__(self, kill_at_m: float) -> None:
        super().__init__()
        self.kill_at_m = kill_at_m
        self.robot: Field | None = None
        self.reports: list[PoseReport] = []
        self.last: Pose | None = None
        self.driven_m = 0.0

    def wait(self, seconds: float, until: Event | None = None) -> bool:
        left = seconds
        while True:
            step = min(left, STEP_S)
            stopped = super().wait(step, until)
            left -= step
            self.look()
            if stopped or left <= 1e-9:
                return stopped

    def look(self) -> None:
        assert self.robot is not None
        run, pose = self.robot.controller.run, self.robot.base.pose()
        if self.last is not None:
            self.driven_m += math.dist((self.last.x, self.last.y), (pose.x, pose.y))
        self.last = pose
        if run.run_id and not run.over:
            now_ns = self.now_ns()
            self.reports.append(
                PoseReport(
                    robot="r1", boot_id=self.robot.controller.boot_id, seq=len(self.reports) + 1,
                    robot_ns=now_ns, run_id=run.run_id, mission_time_s=(now_ns - run.started_ns) / 1e9,
                    pose=pose, speed=0.5,
                )
            )  # fmt: skip
        if self.driven_m > self.kill_at_m:
            self.kill_at_m = math.inf
            raise PowerCut


def killed_run(
    mission: Mission, seed: int, *, waits_s: float = 0.0
) -> tuple[list[PoseReport | AnyEvent], float]:
    """The reports of a run in the order of sending, and the metres that the robot truly drove.

    After the restart the robot stands for some time until it is told to go on.
    """
    chance = random.Random(seed)
    clock = KilledClock(chance.uniform(8.0, 20.0))
    robot = Field(clock=clock)
    clock.robot = robot
    robot.station().push(mission)
    assert robot.order("start").outcome == "ok"
    try:
        robot.work()
        raise AssertionError("the robot was not killed")
    except PowerCut:
        assert clock.last is not None
        robot.base._stand(clock.last)  # a real one does not go back when its program ends
        clock.jump(-chance.uniform(5.0, 30.0))
        robot.boot()
    clock.wait(waits_s)
    assert robot.order("resume").outcome == "ok"
    robot.work()
    return list(in_order(robot.journal.events(), clock.reports)), clock.driven_m


def in_order(events: tuple[AnyEvent, ...], poses: list[PoseReport]) -> Iterator[PoseReport | AnyEvent]:
    boots = list(dict.fromkeys(event.boot_id for event in events if event.run_id))
    reports = [*(event for event in events if event.run_id), *poses]
    yield from sorted(reports, key=lambda item: (boots.index(item.boot_id), item.robot_ns))


def recorded(path: Path, mission: Mission, reports: list[PoseReport | AnyEvent]) -> Comparison:
    """Record a run, and return what a station that heard it compares."""
    with FieldRecording(path, mission) as recording:
        collector = RunCollector(recording)
        collector.mission(mission)
        for report in reports:
            tell(collector, report)  # type: ignore[arg-type]
    watched = collector.compared()
    assert watched is not None
    return watched


@pytest.mark.parametrize("seed", SEEDS)
def test_a_killed_robot_drove_what_it_drove(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mission = wandering(seed, stops=5)
    reports, truth_m = killed_run(mission, seed)
    assert len({item.boot_id for item in reports}) == 2
    path = tmp_path / "field.rrd"
    watched = recorded(path, mission, reports)
    capsys.readouterr()
    assert main(["review", "--json", str(path)]) == 0
    (reviewed,) = json.loads(capsys.readouterr().out)["runs"]
    assert reviewed["travelled_m"] == pytest.approx(truth_m, abs=0.05)
    assert reviewed["greatest_beside_route_m"] < 0.05
    assert [gap["restarted"] for gap in reviewed["gaps"]] == [True]
    assert reviewed["answer"] == "yes"
    assert watched.log.poses.length_m == pytest.approx(truth_m, abs=0.05)
    assert watched.cross_track.greatest_m == pytest.approx(reviewed["greatest_beside_route_m"], abs=2e-3)
    assert any("clock went back" in note for note in watched.log.source.notes)
    write(mission, tmp_path / "mission.json")
    assert main(["replay", "--json", str(path), "--mission", str(tmp_path / "mission.json")]) == 0
    replayed = json.loads(capsys.readouterr().out)
    assert replayed["way"]["driven_m"] == pytest.approx(truth_m, rel=0.01)
    assert [gap["restarted"] for gap in replayed["run"]["gaps"]] == [True]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_recording_shows_the_gaps_that_were_watched(seed: int, tmp_path: Path) -> None:
    """A recording leaves out poses of a standstill, of which there are many after this restart."""
    mission = wandering(seed, stops=5)
    reports, _ = killed_run(mission, seed, waits_s=40.0)
    path = tmp_path / "field.rrd"
    watched = recorded(path, mission, reports)
    (log,) = read_recording(path).logs
    assert len(log.poses) < 0.7 * len(watched.log.poses)
    reviewed = compare(log, [mission])
    assert reviewed.sighted.gaps == watched.sighted.gaps
    assert reviewed.sighted.seen_m == pytest.approx(watched.sighted.seen_m, abs=0.01)
