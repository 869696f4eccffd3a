"""A gateway and whatever befalls it at whatever moment: the run goes on, and no stop is scanned twice."""

from __future__ import annotations

import random
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from bridge.commands.spawn import end_robot, start_robot
from bridge.station.station import Station, connect
from mission.document import Scan
from mission.errors import AnswerIsNo
from mission.events import PoseReport, Scanned, StateReport
from tests.bridge.mavlink.driving.world import Operator, Rover, rover, site_mission, until
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import size
from tests.ports import free_port

SEEDS = range(size(short=2, full=40))
AWAY = 60
"""Poses told while the line is cut or the vehicle is off: three seconds."""


@dataclass
class Site:
    """Everything that something can befall."""

    state: Path
    endpoint: str
    vehicle: Rover
    operator: Operator
    line: Lossy
    station: Station
    robot: subprocess.Popen[str]

    def begin(self) -> None:
        driving = ("--controller", f"mavlink:{self.line.url}", "--vehicle", "1", "--arm")
        self.robot = start_robot("r1", self.state, listen=self.endpoint, extra=driving)


def killed(site: Site) -> None:
    site.robot.kill()
    site.robot.wait()
    site.begin()
    site.station.reach(site.endpoint)


def cut(site: Site) -> None:
    site.line.roughness = Roughness(loss=1.0)
    _a_while(site)
    site.line.roughness = Roughness()


def switched_off(site: Site) -> None:
    site.vehicle.off()
    _a_while(site)
    site.vehicle.on()


def held(site: Site) -> None:
    site.operator.hold()


def taken_by_hand(site: Site) -> None:
    site.operator.manual()


MISHAPS: tuple[Callable[[Site], None], ...] = (killed, cut, switched_off, held, taken_by_hand)


def _a_while(site: Site) -> None:
    poses = (report for report in site.station.reports() if isinstance(report, PoseReport))
    list(islice(poses, AWAY))


def moment(chance: random.Random) -> Callable[[Any], bool]:
    """Somewhere on one of the two legs, or during one of the two scans."""
    if chance.random() < 0.6:
        metres = 2 * chance.randrange(2) + chance.uniform(0.2, 1.6)
        return lambda report: isinstance(report, PoseReport) and report.pose.x > metres
    stop = f"s{chance.randrange(2) + 1}"
    return lambda report: (
        isinstance(report, StateReport) and (report.stop, report.stop_state) == (stop, "SCANNING")
    )


def go_on(site: Site) -> None:
    """As an operator would: see to the vehicle, then order to go on, until the run is over."""
    for report in site.station.reports():
        if not isinstance(report, StateReport) or report.state not in ("HELD", "PAUSED"):
            continue
        try:
            site.operator.hold()
            site.station.command("retry" if report.state == "HELD" else "resume")
        except AnswerIsNo:
            continue


@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_survives_what_befalls_robot_line_and_vehicle(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    mishap, when = MISHAPS[seed % len(MISHAPS)], moment(chance)
    brief = Scan(profile="default", duration_s=4.0, timeout_s=4.0)
    mission = site_mission(scan=brief, retries=3)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        rover(tmp_path, "ardupilot") as (vehicle, operator),
        Lossy(vehicle.url.number, Roughness(), seed=seed) as line,
    ):
        site = Site(tmp_path / "r1", endpoint, vehicle, operator, line, None, None)  # type: ignore[arg-type]
        site.begin()
        try:
            with connect(endpoint, robot="r1") as station:
                site.station = station
                station.push(mission)
                station.command("start")
                until(station.reports(), when)
                mishap(site)
                go_on(site)
                assert station.status().state == "FINISHED"
                scanned = [event.stop for event in station.log() if isinstance(event, Scanned)]
        finally:
            end_robot(site.robot)
    assert scanned == ["s1", "s2"], mishap.__name__
