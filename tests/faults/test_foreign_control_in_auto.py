"""A vehicle in AUTO, and whatever else befalls it: a stop counts once, and only if it was scanned in place.

The simulated vehicle gives the truth: its own poses at begin and end of each scan.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.auto.logbook import remember
from stopgo.bridge.mavlink.simulated.profiles import profile_named
from stopgo.bridge.mavlink.simulated.vehicle_scanner import ScanEnd, VehicleScanner
from stopgo.bridge.mavlink.transfer.upload import upload
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import position_setpoint, set_current
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, found
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import Who, wire
from stopgo.mission.document import Scan, Stop
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Aborted, Failed, Held, Paused, Pose, Scanned, Skipped, StateReport
from tests.bridge.mavlink.auto.site import KINDS, Site, real_tour
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import size
from tests.faults.test_gateway import moment
from tests.own_time import World

SEEDS = range(size(short=1, full=240))
OTHER = Who(255, 190)
TRUE_M = 0.05
"""By how much an estimate may differ from the truth."""
LONGEST_S = 1500.0
TOLD_S = 3.0
SCAN = Scan(profile="default", duration_s=6.0, timeout_s=40.0)
FAILSAFES = 6


@dataclass
class Hands:
    """The vehicle, its link, and another station on a link of its own."""

    site: Site
    line: Lossy
    world: World
    vehicle: Url
    life: ExitStack = field(default_factory=ExitStack)
    untold: bool = False
    """The last mishap changed nothing that could be told."""

    def on(self) -> None:
        """Switch the vehicle on; it stands where it stood."""
        passed, self.site.url = self.site.url, self.vehicle
        self.life.enter_context(self.site.up())
        self.site.url = passed
        self.site.at, self.site.faults = None, ()

    def other(self, does: Callable[[Peer], object]) -> None:
        with wire(self.vehicle, me=OTHER) as opened, found(opened, 1) as peer:
            does(peer)


def another_list(hands: Hands, chance: random.Random) -> None:
    """Of the same length, with other stops or scans that are cut short; or of another length."""
    site = hands.site
    brief = Scan(profile="default", duration_s=0.2, timeout_s=20.0)
    details: dict[str, Any] = chance.choice([{"scan": brief}, {"settle_s": 4.0}, {"trigger": "none"}])
    trigger = details.pop("trigger", "auto")
    other = translate(real_tour(**details), KINDS[site.profile], trigger=trigger)
    hands.other(lambda peer: upload(peer, other, while_running=True))


def another_mode(hands: Hands, chance: random.Random) -> None:
    modes = profile_named(hands.site.profile).modes
    mode = chance.choice([modes.hold, modes.numbers["manual"]])
    hands.other(lambda peer: peer.order(dialect.MAV_CMD_DO_SET_MODE, *mode.params))


def driven_by_set_points(hands: Hands, chance: random.Random) -> None:
    """Another station takes the guided mode, and drives the vehicle off by half a metre."""
    guided = profile_named(hands.site.profile).modes.guided

    def drive(peer: Peer) -> None:
        here = peer.ask(dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        assert here is not None
        angle = chance.uniform(0.0, math.tau)
        point = (here.x + 0.5 * math.cos(angle), here.y + 0.5 * math.sin(angle))
        for nth in range(30):
            peer.send(position_setpoint(peer.who, point, down=0.0, now_ms=0))
            if nth == 12:  # PX4 wants a stream of them first
                peer.command(dialect.MAV_CMD_DO_SET_MODE, *guided.params)
            hands.world.sleep(0.1)

    hands.other(drive)


def disarmed(hands: Hands, chance: random.Random) -> None:
    hands.other(lambda peer: peer.order(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0))


def jumped(hands: Hands, chance: random.Random) -> None:
    """To the begin of the leg to some stop, ahead or behind."""
    with hands.site.book() as book:
        listed = book.listed
        run = book.run
    assert listed is not None
    to = chance.randrange(len(listed.stops))
    hands.untold = run.state != "RUNNING" or to == run.at  # it drives the same leg once more
    sequence = listed.sequence(listed.stops[to].first)
    hands.other(lambda peer: peer.send(set_current(peer.who, sequence)))


def cut(hands: Hands, chance: random.Random) -> None:
    hands.line.roughness = Roughness(loss=1.0)
    hands.world.sleep(chance.choice([1.0, 4.0, 15.0, 60.0, 120.0]))
    hands.line.roughness = Roughness()


def stalled(hands: Hands, chance: random.Random) -> None:
    """All that is sent meanwhile arrives at once."""
    hands.line.stall(chance.choice([2.0, 8.0, 34.0]))


def rough(hands: Hands, chance: random.Random) -> None:
    hands.line.roughness = Roughness(
        delay_s=0.05, loss=chance.choice([0.1, 0.2, 0.3]), doubled=0.05, overtaken=0.1
    )


def switched_off(hands: Hands, chance: random.Random) -> None:
    hands.life.close()
    hands.world.sleep(chance.choice([0.5, 3.0, 10.0]))
    hands.on()


def watch_restarted(hands: Hands, chance: random.Random) -> None:
    """The connection is closed and opened again after each mishap."""
    hands.world.sleep(chance.choice([0.0, 2.0, 20.0]))


def date_set(hands: Hands, chance: random.Random) -> None:
    """On the station, between two of its processes or during one."""
    hands.world.set_date(chance.choice([-3600.0, -5.0, 5.0, 3600.0]))


FOREIGN = (another_list, another_mode, driven_by_set_points, disarmed, jumped)
"""Told within `TOLD_S` to whoever watches."""
MISHAPS = (*FOREIGN, cut, stalled, rough, switched_off, watch_restarted, date_set)
TELLING = Paused | Held | Skipped | Failed | Aborted


def followed(hands: Hands, befalls: list[Any], chance: random.Random) -> None:
    """Follow the run to its end, let all befall it, and go on as an operator would."""
    began_ns, site = hands.world.monotonic_ns(), hands.site

    def in_time() -> None:
        assert hands.world.monotonic_ns() - began_ns < LONGEST_S * 1e9, site.run

    site.order("start")
    while not site.run.over:
        in_time()
        try:
            with site.reached() as station:
                for report in station.reports():
                    in_time()
                    if befalls and befalls[0][0](report):
                        mishap = befalls.pop(0)[1]
                        before, hands.untold = site.events[-1].number, False
                        mishap(hands, chance)
                        if mishap in FOREIGN:
                            check_told(hands, mishap, before)
                        break
                    if isinstance(report, StateReport) and report.state in ("HELD", "PAUSED"):
                        go_on(hands, report.state)
                        break
        except (NegativeResult, OutcomeUnknown, RobotUnreachable):
            hands.world.sleep(1.0)


def check_told(hands: Hands, mishap: object, before: int) -> None:
    """Who watches is informed of foreign control in time, also over a link that loses frames.

    A jump from the end of a stop's work to the next leg is what comes anyway; the run may be over before.
    """
    hands.world.sleep(TOLD_S)
    events = [event for event in hands.site.events if event.number > before]
    told = any(isinstance(event, TELLING) for event in events)
    comes_anyway = mishap is jumped and any(isinstance(event, Scanned) for event in events)
    assert told or hands.untold or comes_anyway or hands.site.run.over, (mishap, hands.site.run, events)


def go_on(hands: Hands, state: str) -> None:
    """Give the vehicle its list again if it has another one, and order to go on."""
    site = hands.site
    if "changed the vehicle's mission" in site.run.reason:
        hands.other(lambda peer: upload(peer, site.sent, while_running=True))
    try:
        site.order("retry" if state == "HELD" else "resume")
    except NegativeResult as refused:
        if "battery failsafe" in str(refused):  # a charged battery, and a new start
            hands.life.close()
            hands.on()
        if "m off its route" in str(refused):
            site.order("abort")
        raise


@dataclass(frozen=True)
class TrueScan:
    """A scan as the simulated vehicle made it."""

    file: str
    moved_m: float
    at: Pose


@pytest.fixture
def true_scans(monkeypatch: pytest.MonkeyPatch) -> list[TrueScan]:
    made: list[TrueScan] = []
    end = VehicleScanner.end

    def noted(scanner: VehicleScanner, pose: Pose) -> ScanEnd:
        assert scanner.scan is not None
        began = scanner.scan.began_at
        monkeypatch.setattr("stopgo.bridge.mavlink.simulated.vehicle_scanner._moved", lambda *poses: False)
        done = end(scanner, pose)
        moved_m = math.dist((began.x, began.y), (pose.x, pose.y))
        made.append(TrueScan(done.file_url.partition("?")[0], moved_m, pose))
        return done

    monkeypatch.setattr(VehicleScanner, "end", noted)
    return made


def was_in_place(scan: TrueScan, stop: Stop) -> bool:
    """True if the vehicle truly stood within the stop's tolerance during the scan."""
    away_m = math.dist((scan.at.x, scan.at.y), (stop.x, stop.y))
    return scan.moved_m <= stop.tolerance_m and away_m <= stop.tolerance_m + TRUE_M


@pytest.mark.parametrize("seed", SEEDS)
def test_no_stop_counts_in_auto_that_was_not_scanned_in_place(
    tmp_path: Path, true_scans: list[TrueScan], world: World, seed: int
) -> None:
    chance = random.Random(2000 + seed)
    profile = ("ardupilot", "px4")[seed // (len(MISHAPS) + 1) % 2]
    first = seed % (len(MISHAPS) + 1)
    faults = (
        [f"failsafe@{chance.randrange(4, 30)}={chance.randrange(FAILSAFES)}"] if first == len(MISHAPS) else []
    )
    befalls = [
        (moment(chance, "S1", "S2"), MISHAPS[first % len(MISHAPS)]),
        (moment(chance, "S2", "S3"), chance.choice(MISHAPS)),
    ]
    site = Site(
        tmp_path, profile, mission=real_tour(scan=SCAN, retries=2), faults=faults, speed_up=1.0, seed=seed + 1
    )
    with Lossy(site.url.number, Roughness(), seed=seed) as line:
        hands = Hands(site, line, world, vehicle=site.url)
        site.url = line.url
        with site.book() as book:
            remember(book, site.mission, site.sent)
        with hands.life:
            hands.on()
            followed(hands, befalls, chance)
        run, events = site.run, site.events
    counted = [event for event in events if isinstance(event, Scanned)]
    names = [event.stop for event in counted]
    assert len(set(names)) == len(names), "scanned twice"
    assert (
        set(run.done) | set(run.skipped) == {stop.id for stop in site.mission.stops} or run.state == "ABORTED"
    )
    for event in counted:
        stop = next(stop for stop in site.mission.stops if stop.id == event.stop)
        scans = [scan for scan in true_scans if scan.file == event.file]
        assert any(was_in_place(scan, stop) for scan in scans), (event, true_scans)
    assert all(event.reason for event in events if isinstance(event, Held | Paused))
