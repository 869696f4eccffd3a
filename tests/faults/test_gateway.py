"""A gateway on a vehicle that drives as a real one, and whatever befalls both: each stop is scanned once."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_scanner import ScanEnd, VehicleScanner
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import Pose, PoseReport, Scanned, StateReport
from stopgo.mission.run.route_position import foot
from tests.bridge.mavlink.driving.world import (
    Operator,
    Rover,
    cornered_mission,
    gateway,
    rover,
    site_pose,
)
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import size
from tests.own_time import World

SEEDS = range(size(short=1, full=112))
ALL = ["s1", "s2", "s3", "s4", "s5"]
WANDERS_M = 0.03
"""By how much an estimate may be beside the truth."""
ASIDE_M = 0.15
"""How far beside its legs it may come."""
LONGEST_S = 900.0


@dataclass
class Site:
    """Everything that something can befall."""

    state: Path
    vehicle: Rover
    operator: Operator
    line: Lossy
    world: World
    life: ExitStack = field(default_factory=ExitStack)
    station: Station = None  # type: ignore[assignment]

    def begin(self) -> None:
        self.life = ExitStack()
        self.station = self.life.enter_context(gateway(self.state, self.line.url))

    def wait(self, seconds: float) -> None:
        self.world.sleep(seconds)


def begun_again(site: Site, chance: random.Random) -> None:
    """The gateway's program."""
    site.life.close()
    site.begin()


def cut(site: Site, chance: random.Random) -> None:
    site.line.roughness = Roughness(loss=1.0)
    site.wait(chance.choice([0.5, 2.0, 8.0, 30.0]))
    site.line.roughness = Roughness()


def switched_off(site: Site, chance: random.Random) -> None:
    site.vehicle.off()
    site.wait(chance.choice([0.5, 3.0, 10.0]))
    site.vehicle.on()


def stalled(site: Site, chance: random.Random) -> None:
    """All that is sent meanwhile arrives at once."""
    site.line.stall(chance.choice([0.5, 3.0, 12.0]))


def held(site: Site, chance: random.Random) -> None:
    site.operator.hold()


def taken_by_hand(site: Site, chance: random.Random) -> None:
    site.operator.manual()


def disturbed(site: Site, chance: random.Random) -> None:
    site.line.roughness = Roughness(delay_s=0.05, loss=0.2, doubled=0.05, overtaken=0.1)


Mishap = Callable[[Site, random.Random], None]
MISHAPS: tuple[Mishap, ...] = (
    begun_again, cut, stalled, switched_off, held, taken_by_hand, disturbed,
)  # fmt: skip
FAILSAFES = (1, 2, 3, 5)
"""Causes that are over after a while."""
TOLD_S = 3.0
BY_ITSELF = (switched_off, disturbed)
"""After these it goes on without anybody."""


def chassis(chance: random.Random, profile: str) -> dict[str, float]:
    """Wheels, sensors and loops, better or worse than usual."""
    own = {"SIM_LAG": chance.uniform(0.15, 0.5), "SIM_TURN_LAG": chance.uniform(0.05, 0.25)}
    own |= {"SIM_STICTION": chance.uniform(0.0, 0.03), "SIM_POS_DRIFT": chance.uniform(0.002, 0.008)}
    own |= {"SIM_ARM_AFTER": chance.choice([0.0, 5.0, 18.0])}
    own |= {"SIM_POS_NOISE": chance.uniform(0.0005, 0.002), "SIM_EST_LAG": chance.uniform(0.02, 0.15)}
    if profile == "ardupilot":
        return {**own, "ATC_SPEED_I": chance.uniform(0.1, 0.4), "ATC_STR_ANG_P": chance.uniform(1.5, 2.5)}
    return {**own, "RO_YAW_P": chance.uniform(1.5, 2.5), "RO_DECEL_LIM": chance.uniform(0.3, 1.0)}


def moment(chance: random.Random, *stops: str) -> Callable[[Any], bool]:
    """Somewhere on the leg to one of these stops, or during its scan."""
    stop, states = chance.choice(stops), ("NAVIGATING", "NAVIGATING", "SETTLING", "SCANNING")
    state, beats = chance.choice(states), chance.randrange(200)
    seen = iter(range(10_000))

    def is_now(report: Any) -> bool:
        told = isinstance(report, StateReport) and (report.stop, report.stop_state) == (stop, state)
        is_now.began = is_now.began or told  # type: ignore[attr-defined]
        here = is_now.began and isinstance(report, PoseReport)  # type: ignore[attr-defined]
        return here and next(seen) >= (beats if state == "NAVIGATING" else 2)

    is_now.began = False  # type: ignore[attr-defined]
    return is_now


Befalls = list[tuple[Callable[[Any], bool], Mishap]]
"""What is to happen, and when, in its order."""


def driven(site: Site, befalls: Befalls, chance: random.Random) -> list[Pose]:
    """Start, let it all befall it, and do as an operator would, until the run is over; the poses reported."""
    poses: list[Pose] = []
    began_ns = site.world.monotonic_ns()
    site.station.command("start")
    while site.station.status().state != "FINISHED":
        for report in site.station.reports():
            assert site.world.monotonic_ns() - began_ns < LONGEST_S * 1e9, site.station.status()
            if isinstance(report, PoseReport):
                poses.append(report.pose)
            if befalls and befalls[0][0](report):
                mishap = befalls.pop(0)[1]
                before = newest(site)
                mishap(site, chance)
                if mishap is taken_by_hand:  # also over a link that loses frames
                    site.wait(TOLD_S)
                    assert newest(site) > before, "untold"
                break
            if isinstance(report, StateReport) and report.state in ("HELD", "PAUSED"):
                go_on(site, report.state)
    return poses


def newest(site: Site) -> int:
    """Number of the newest event that the robot reports."""
    return site.station.status().last_event


def go_on(site: Site, state: str) -> None:
    """Hand the vehicle over, and order to go on."""
    try:
        site.operator.hold()
        site.station.command("retry" if state == "HELD" else "resume")
    except NegativeResult:
        return


def beside(mission: Mission, pose: Pose) -> float:
    """Metres from the nearest leg."""
    here = (pose.x, pose.y)
    return min(
        math.dist(here, foot(a, b, here)) for stop in mission.stops for a, b in pairwise(stop.approach)
    )


@pytest.fixture
def stood(monkeypatch: pytest.MonkeyPatch) -> list[Pose]:
    """True positions of the vehicle on the site at the end of each unspoilt scan."""
    found: list[Pose] = []
    end = VehicleScanner.end

    def noted(scanner: VehicleScanner, pose: Pose) -> ScanEnd:
        done = end(scanner, pose)
        if not done.why:
            found.append(site_pose(pose))
        return done

    monkeypatch.setattr(VehicleScanner, "end", noted)
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_survives_what_befalls_gateway_line_and_vehicle(
    tmp_path: Path, stood: list[Pose], world: World, seed: int
) -> None:
    chance = random.Random(seed)
    profile = ("ardupilot", "px4")[seed % 2]
    mission = cornered_mission(retries=3)
    befalls = [
        (moment(chance, "s1", "s2"), MISHAPS[seed // 2 % (len(MISHAPS) + 1) % len(MISHAPS)]),
        (moment(chance, "s3", "s4", "s5"), chance.choice(MISHAPS)),
    ]
    first = seed // 2 % (len(MISHAPS) + 1)
    failsafe = VehicleFault("failsafe", chance.randrange(8, 40), float(chance.choice(FAILSAFES)))
    faults = VehicleFaults((failsafe,) if first == len(MISHAPS) else ())
    wheels = chassis(chance, profile)
    with (
        rover(tmp_path, profile, seed=seed, changed=wheels, faults=faults) as (vehicle, operator),
        Lossy(vehicle.url.number, Roughness(), seed=seed) as line,
    ):
        site = Site(tmp_path, vehicle, operator, line, world)
        site.begin()
        site.station.push(mission)
        poses = driven(site, befalls, chance)
        events = list(site.station.log())
        site.life.close()
    assert not befalls
    scans = [event for event in events if isinstance(event, Scanned)]
    assert [event.stop for event in scans] == ALL
    for event, stop in zip(scans, mission.stops, strict=True):
        assert math.dist((event.pose.x, event.pose.y), (stop.x, stop.y)) <= stop.tolerance_m + 0.01
        nearest = min(math.dist((pose.x, pose.y), (stop.x, stop.y)) for pose in stood)
        assert nearest <= stop.tolerance_m + WANDERS_M
    assert max(beside(mission, pose) for pose in poses) <= ASIDE_M
