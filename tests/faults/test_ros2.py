"""Faults of a robot that speaks ROS 2, in simulated time: no stop lost or doubled, no scan while moving.

An operator lets the robot go on after each fault, and corrects a localisation that was wrong. Every other
mission allows the robot's own way.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable

import msgspec
import pytest

from stopgo.bridge.ros2.ros_settings import RosLimits, RosSettings, ScanCall
from stopgo.mission.document import with_digest
from stopgo.mission.frames.transform import SAME
from stopgo.mission.run.events import Event, Finished, Scanned, Started
from tests.bridge.ros2.world import Killed, RosField, World
from tests.bridge.world import corridor
from tests.faults.sizes import size

MISSION = corridor(stops=3)
SETTINGS = RosSettings(
    limits=RosLimits(rest_m=0.01, rest_rad=0.02, gap_s=4.0, stalled_s=6.0), scan=ScanCall(late_s=10.0)
)
LONGEST_S = 60.0
"""Faults come within this time of a run that takes about as long."""


def _killed(world: World, chance: random.Random) -> None:
    world.killed = True


def _aborted(world: World, chance: random.Random) -> None:
    world.end("aborted", "FAILED_TO_MAKE_PROGRESS")


def _cancelled(world: World, chance: random.Random) -> None:
    world.end("canceled")


def _preempted(world: World, chance: random.Random) -> None:
    world.preempted = chance.choice(["aborted", "succeeded"])
    world.foreign(world.at.x + chance.uniform(-0.6, 0.6), world.at.y + chance.uniform(-0.4, 0.4))


def _restarted(world: World, chance: random.Random) -> None:
    world.restart_servers(chance.uniform(0.3, 8.0))


def _silent(*what: str) -> Callable[[World, random.Random], None]:
    def happens(world: World, chance: random.Random) -> None:
        world.silent |= set(what)
        world.later(chance.uniform(0.5, 8.0), lambda: world.silent.difference_update(what))

    return happens


def _discovery(world: World, chance: random.Random) -> None:
    _silent("tf", "odometry")(world, chance)
    world.servers = False
    world.later(chance.uniform(1.0, 8.0), lambda: setattr(world, "servers", True))


def _hour_off(world: World, chance: random.Random) -> None:
    world.odometry_offset_s = chance.choice([-3600.0, 3600.0])
    world.later(chance.uniform(2.0, 10.0), lambda: setattr(world, "odometry_offset_s", 0.0))


def _odometry_jumps(world: World, chance: random.Random) -> None:
    world.odometry_jump = chance.choice([0.4, -2.0])
    world.later(chance.uniform(1.0, 4.0), lambda: setattr(world, "odometry_jump", 0.0))


def _second_publisher(world: World, chance: random.Random) -> None:
    world.second_publisher = chance.choice([0.2, 1.5])
    world.later(chance.uniform(1.0, 6.0), lambda: setattr(world, "second_publisher", 0.0))


def _map_jumps(metres: float) -> Callable[[World, random.Random], None]:
    def happens(world: World, chance: random.Random) -> None:
        shift = metres * chance.choice([-1.0, 1.0])
        world.correction = msgspec.structs.replace(world.correction, y=world.correction.y + shift)

    return happens


def _scanner(kind: str) -> Callable[[World, random.Random], None]:
    def happens(world: World, chance: random.Random) -> None:
        world.scan_kinds.append(kind)  # type: ignore[arg-type]

    return happens


FAULTS = {
    "goal aborted": _aborted,
    "preempted by another client": _preempted,
    "cancelled in RViz": _cancelled,
    "server restarted": _restarted,
    "odometry frozen": _silent("odometry"),
    "odometry jumps": _odometry_jumps,
    "odometry an hour off": _hour_off,
    "gap in tf": _silent("tf"),
    "two publishers of tf": _second_publisher,
    "map moved by 0.3 m": _map_jumps(0.3),
    "map moved by 5 m": _map_jumps(5.0),
    "killed": _killed,
    "discovery lost": _discovery,
    "scan late": _scanner("late"),
    "scan told twice": _scanner("twice"),
    "scan never told": _scanner("never"),
    "scan fails": _scanner("fails"),
}


class Trial:
    """One robot, its faults, and an operator who does not give up."""

    def __init__(self, seed: int, kinds: list[str]) -> None:
        chance = random.Random(seed)
        self.field = RosField(settings=SETTINGS)
        self.kills = 0
        self.scan = msgspec.structs.replace(MISSION.stops[0].scan, duration_s=3.0, timeout_s=8.0)
        made = corridor(stops=3, scan=self.scan, settle_s=1.0)
        policy = msgspec.structs.replace(made.policy, own_way=True) if seed % 2 else made.policy
        self.mission = with_digest(msgspec.structs.replace(made, policy=policy))
        self.push()
        for kind in kinds:
            at_s = chance.uniform(0.0, LONGEST_S)
            self.field.world.later(at_s, lambda kind=kind: self.strike(kind, chance))  # type: ignore[misc]

    def push(self) -> None:
        self.field.station().push(self.mission)
        assert self.field.order("start").outcome == "ok"

    def strike(self, kind: str, chance: random.Random) -> None:
        FAULTS[kind](self.field.world, chance)

    def finish(self) -> None:
        for _ in range(60):
            try:
                self.field.work()
                state = self.field.controller.run.state
                if state == "FINISHED":
                    return
                self.help()
            except Killed:
                self.kills += 1
                self.boot()
        raise AssertionError(f"not finished: {self.field.controller.run}, {self.field.told()[-8:]}")

    def boot(self) -> None:
        while True:
            try:
                self.field.boot()
                return
            except Killed:
                self.kills += 1

    def help(self) -> None:
        """Wait until whatever happens is over, localise the robot, and let it go on."""
        world, run = self.field.world, self.field.controller.run
        assert run.state in ("HELD", "PAUSED"), run
        self.field.clock.wait(12.0)
        far = abs(world.correction.y) > 1.0 or abs(world.at.y - world.correction.y) > 0.2
        if far:
            world.correction = SAME
            self.field.clock.wait(1.0)
        if abs(world.at.y) > 0.05 or not 0 <= world.at.x <= 6:  # driven away: back by hand
            world.at = msgspec.structs.replace(world.at, x=max(0.0, min(6.0, world.at.x)), y=0.0)
            world.brake()
            self.field.clock.wait(1.0)
        run = self.field.controller.run
        self.field.order("resume" if run.state == "PAUSED" else "retry")

    def check(self) -> None:
        """Nothing was lost, nothing counted twice, and no scan counted during which the robot moved."""
        events = self.field.journal.events()
        assert [event.stop for event in events if isinstance(event, Scanned)] == ["s1", "s2", "s3"]
        assert _count(events, Started) == _count(events, Finished) == 1
        files = {event.file for event in events if isinstance(event, Scanned)}
        assert len(files) == 3
        for number, scan in enumerate(self.field.world.scans, 1):
            assert not scan.driven_by_us, f"driven during scan {number} of {scan.label}"
            if scan.moved_m > 0.03:
                assert f"{number}.e57" not in files, f"scan {number} counts, moved {scan.moved_m:.3f} m"


def _count(events: tuple[Event, ...], kind: type[Event]) -> int:
    return sum(isinstance(event, kind) for event in events)


def run_trial(seed: int, kinds: list[str]) -> Trial:
    trial = Trial(seed, kinds)
    trial.finish()
    trial.check()
    return trial


@pytest.mark.parametrize("kind", FAULTS)
def test_no_stop_is_lost_or_doubled_by_a_fault(kind: str) -> None:
    for seed in range(size(short=1, full=20)):
        run_trial(seed, [kind])


def test_no_stop_is_lost_or_doubled_by_many_faults() -> None:
    trials, seen = size(short=5, full=300), Counter[str]()
    for seed in range(trials):
        chance = random.Random(f"many {seed}")
        kinds = chance.choices(list(FAULTS), k=chance.randint(2, 8))
        seen.update(kinds)
        run_trial(seed, kinds)
    print(f"{trials} trials: {sum(seen.values())} faults of {len(seen)} kinds")
