"""Several robots behind one zenoh router, under one site."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.station.station import connect
from stopgo.mission.errors import RobotUnreachable
from stopgo.mission.run.events import Finished, PoseReport, Scanned
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.ports import free_port

ROOT = Path(__file__).parents[3]


@contextmanager
def router(endpoint: str, *keys: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "tests.bridge.router", endpoint, *keys]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    try:
        yield process
    finally:
        end_robot(process)


@contextmanager
def robots(endpoint: str, state: Path, *names: str) -> Iterator[None]:
    extra = ("--connect", endpoint, "--site", "north/hall")
    processes = [start_robot(name, state / name, listen=None, speed_up=100, extra=extra) for name in names]
    try:
        yield
    finally:
        for process in processes:
            end_robot(process)


def test_a_router_in_between_changes_nothing(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router(endpoint), robots(endpoint, tmp_path, "r1", "r2"):
        with connect(endpoint, robot="r2", site="north/hall") as station:
            station.push(corridor())
            station.command("start")
            reports = list(station.reports())
        every = json.loads(stopgo("status", "--connect", endpoint, "--site", "north/hall", "--json").stdout)
    assert [report.stop for report in reports if isinstance(report, Scanned)] == ["s1", "s2", "s3"]
    assert any(isinstance(report, Finished) for report in reports)
    assert any(isinstance(report, PoseReport) for report in reports)
    assert [(robot["robot"], robot["state"]) for robot in every["robots"]] == [
        ("r1", "IDLE"),
        ("r2", "FINISHED"),
    ]


def test_robots_of_another_site_are_not_seen(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with router(endpoint), robots(endpoint, tmp_path, "r1"):
        elsewhere = stopgo("status", "--connect", endpoint, "--site", "south", "--timeout", "0.5")
        nowhere = stopgo("status", "--connect", endpoint, "--timeout", "0.5", "--robot", "r1")
    assert (elsewhere.returncode, nowhere.returncode) == (2, 2)


def test_a_killed_router_is_found_again_and_no_event_is_lost(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    events = []
    with (
        router(endpoint) as first,
        robots(endpoint, tmp_path, "r1"),
        connect(endpoint, robot="r1", site="north/hall") as station,
    ):
        station.push(corridor())
        station.command("start")
        reports = station.reports()
        for report in reports:
            if isinstance(report, Scanned):
                events.append(report.stop)
                break
        first.kill()
        first.wait()
        with router(endpoint):
            events += [report.stop for report in reports if isinstance(report, Scanned)]
    assert events == ["s1", "s2", "s3"]


def test_a_robot_that_finds_its_name_alive_does_not_start(tmp_path: Path) -> None:
    """And starts once the other has ended, also if that one was killed."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    extra = ("--connect", endpoint)
    with router(endpoint):
        first = start_robot("r1", tmp_path / "a", listen=None, extra=extra)
        with pytest.raises(RobotUnreachable, match=r"r1: robot name already in use at .*--name"):
            start_robot("r1", tmp_path / "b", listen=None, extra=extra)
        first.kill()
        first.wait()
        end_robot(start_robot("r1", tmp_path / "b", listen=None, extra=extra))
