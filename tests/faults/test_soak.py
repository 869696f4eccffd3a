"""Hours of missions in simulated time: nothing grows or is lost; the clock may jump, the disk may fill."""

from __future__ import annotations

import gc
import os
import random
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.bridge.robot.program import clocks
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.simulated_faults import Fault, Faults
from stopgo.mission.run.events import Aborted, Finished, Scanned, Skipped, Started
from tests.bridge.world import Field, corridor
from tests.faults.sizes import size

HOURS = size(short=4, full=200)


def test_hours_of_missions_with_faults_lose_nothing_and_nothing_grows(tmp_path: Path) -> None:
    chance = random.Random(7)
    kinds = ("slip", "blocked", "shaking", "scanner", "empty")
    faults = tuple(
        Fault(chance.choice(kinds), at, chance.uniform(0.1, 5.0))
        for at in range(1, 4000)
        if chance.random() < 0.1
    )
    with open_journal(tmp_path, "r1") as journal:
        field = Field(journal=journal, faults=Faults(faults), record=tmp_path / "scans.log")
        began_ns = field.clock.now_ns()
        field.station().push(corridor())
        runs, handles, threads = 0, 0, set(threading.enumerate())
        while field.clock.now_ns() - began_ns < HOURS * 3600e9:
            one_run(field, chance)
            field.base.charge()
            runs += 1
            if runs == 5:
                handles = grown()
        assert runs >= 10 * HOURS
        assert grown() <= handles + 2
        assert set(threading.enumerate()) <= threads
        check(journal, runs)


def one_run(field: Field, chance: random.Random) -> None:
    """A run to its end, with a pause, a reboot, or somebody who decides whatever the robot asks."""
    field.base.stand_at_start(pose_of(corridor().start))
    started = field.order("start", again=True, from_here=False)
    if started.outcome == "refused":
        field.base.stand_at(field.base.pose().__class__(x=0.0, y=0.0, heading=0.0))
        assert field.order("start", again=True).outcome == "ok"
    if chance.random() < 0.5:
        field.clock.at(chance.uniform(1.0, 250.0), lambda: field.order("pause"))
    while not field.controller.run.over:
        field.work()
        state = field.controller.run.state
        if chance.random() < 0.1:
            field.boot()
        elif state == "PAUSED":
            resumed(field)
        elif state == "HELD":
            field.order("skip" if chance.random() < 0.3 and field.controller.run.at < 3 else "retry")


def resumed(field: Field) -> None:
    """Resume; a robot that has slipped off its route is brought back by hand first."""
    if field.order("resume").reason == "off_route":
        pose = field.base.pose()
        field.base.stand_at(msgspec.structs.replace(pose, y=0.0))
        field.order("resume")


def grown() -> int:
    """Open file handles of this process."""
    gc.collect()
    return len(os.listdir("/proc/self/fd"))


def check(journal: Journal, runs: int) -> None:
    events = journal.events()
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    started = [event.run_id for event in events if isinstance(event, Started)]
    assert len(started) == len(set(started)) == runs
    for run_id in started:
        told = journal.events(run_id=run_id)
        scanned = [event.stop for event in told if isinstance(event, Scanned)]
        skipped = [event.stop for event in told if isinstance(event, Skipped)]
        assert sorted(scanned + skipped) == ["s1", "s2", "s3"], run_id
        assert sum(isinstance(event, Finished | Aborted) for event in told) == 1
        times = [event.mission_time_s for event in told]
        assert times == sorted(times)


def test_a_robot_clock_that_was_set_back_does_not_turn_time_around() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.work(most=500)
    newest_ns = field.journal.newest_ns
    set_back = SimulatedClock(origin_ns=newest_ns - round(3600e9))
    field.clock = set_back
    robot_clock, wall = clocks(field.journal, speed_up=1.0, now_ns=set_back.now_ns())
    assert robot_clock.now_ns() > newest_ns
    assert wall.now_ns() < newest_ns


def test_a_station_whose_clock_is_wrong_is_obeyed_all_the_same() -> None:
    """Commands have the date of the robot's clock, as `info` reports it, and never the station's."""
    field = Field()
    station = field.station()
    station.push(corridor())
    order = station.order("start")
    assert order.issued_ns == field.clock.now_ns()


@pytest.mark.skipif(shutil.which("unshare") is None, reason="needs user namespaces to mount a small disk")
@pytest.mark.parametrize(
    ("robot", "told"),
    [
        ("simulated-time", "resume 0.0 FINISHED"),
        ("process", "ok PAUSED ok ABORTED Paused Aborted"),
    ],
)
def test_a_disk_that_is_really_full_stops_the_robot_until_there_is_room(
    tmp_path: Path, robot: str, told: str
) -> None:
    script = Path(__file__).with_name("full_disk.py")
    small = ["unshare", "--user", "--map-root-user", "--mount"]
    command = [*small, sys.executable, str(script), str(tmp_path), robot]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    result = subprocess.run(
        command, capture_output=True, text=True, timeout=120, env=environment, check=False
    )
    if "cannot mount" in result.stderr or "unshare:" in result.stderr:
        pytest.skip(result.stderr.strip())
    assert result.returncode == 0, result.stderr
    assert result.stdout.split() == told.split()
