"""Another station's hand on a gateway's vehicle: no scan counts while it truly moved, and none counts twice.

The simulated scanner notices no motion here, so that the gateway must.
"""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_scanner import ScanEnd, VehicleScanner
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint
from stopgo.mission.document import Scan
from stopgo.mission.run.events import Held, Pose, Scanned
from tests.bridge.mavlink.driving.world import cornered_mission, rover
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import size
from tests.faults.test_gateway import (
    ALL,
    TOLD_S,
    WANDERS_M,
    Site,
    begun_again,
    chassis,
    cut,
    disturbed,
    driven,
    held,
    moment,
    newest,
    switched_off,
    taken_by_hand,
)
from tests.own_time import World

SEEDS = range(size(short=1, full=100))


def driven_on(site: Site, chance: random.Random) -> None:
    """By another station's set points, which ArduPilot takes in its guided mode from anybody."""
    peer, (north, east) = site.operator.peer, site.operator.place()
    guided = site.operator.mode() == site.operator.autopilot.modes.name(site.operator.autopilot.modes.guided)
    scans = guided and site.station.status().stop_state == "SCANNING"
    before = newest(site)
    angle = chance.uniform(0.0, math.tau)
    point = (north + 0.2 * math.cos(angle), east + 0.2 * math.sin(angle))
    for _ in range(3):
        peer.send(position_setpoint(peer.who, point, down=0.0, now_ms=0))
    if scans:  # the attempt has failed in time
        site.wait(TOLD_S)
        assert site.station.status().stop_state != "SCANNING" or newest(site) > before, "untold"


SECOND = (driven_on, begun_again, cut, switched_off, held, taken_by_hand, disturbed)


@pytest.fixture
def moved(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """True motion of the vehicle between begin and end of each scan, metres, by file."""
    found: dict[str, float] = {}
    end = VehicleScanner.end

    def noted(scanner: VehicleScanner, pose: Pose) -> ScanEnd:
        assert scanner.scan is not None
        began = scanner.scan.began_at
        monkeypatch.setattr("stopgo.bridge.mavlink.simulated.vehicle_scanner._moved", lambda *poses: False)
        done = end(scanner, pose)
        found[done.file_url.partition("?")[0]] = math.dist((began.x, began.y), (pose.x, pose.y))
        return done

    monkeypatch.setattr(VehicleScanner, "end", noted)
    return found


@pytest.mark.parametrize("seed", SEEDS)
def test_no_stop_counts_that_was_scanned_while_somebody_drove_the_vehicle(
    tmp_path: Path, moved: dict[str, float], world: World, seed: int
) -> None:
    chance = random.Random(1000 + seed)
    profile = ("ardupilot", "px4")[seed % 4 == 3]
    mission = cornered_mission(retries=3, scan=Scan(profile="default", duration_s=5.0, timeout_s=30.0))
    befalls = [
        (moment(chance, "s1", "s2"), driven_on),
        (moment(chance, "s3", "s4", "s5"), chance.choice(SECOND)),
    ]
    with (
        rover(tmp_path, profile, seed=seed, changed=chassis(chance, profile)) as (vehicle, operator),
        Lossy(vehicle.url.number, Roughness(), seed=seed) as line,
    ):
        site = Site(tmp_path, vehicle, operator, line, world)
        site.begin()
        site.station.push(mission)
        driven(site, befalls, chance)
        events = list(site.station.log())
        site.life.close()
    scans = [event for event in events if isinstance(event, Scanned)]
    assert not befalls and [event.stop for event in scans] == ALL
    for event, stop in zip(scans, mission.stops, strict=True):
        assert moved[event.file] <= stop.tolerance_m + WANDERS_M, event
    assert all(event.reason for event in events if isinstance(event, Held))
