"""A simulated robot's run with faults and orders, and what a witness next to it wrote down: the truth."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import shapely

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.base import Outcome
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.bridge.robot.simulated_faults import Fault, Faults
from stopgo.bridge.robot.simulator import SHAKE_M, SimulatedBase, Wear
from stopgo.mission.comparing.run_collector import RunSink
from stopgo.mission.document import Mission, Point, Scan, Stop
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport, RevisionTaken
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.recordings.runs.field import FieldRecording
from tests.bridge.world import Field

GOES_ON = ("resume", "retry", "skip")
SILENCE_S = 60.0
LOOK_S = 0.05
"""Interval of the witness's observations."""


class WatchedClock(SimulatedClock):
    """Time in which a witness sees where the robot is, whoever waits."""

    def __init__(self) -> None:
        super().__init__()
        self.witness: Witness | None = None

    def wait(self, seconds: float, until: Event | None = None) -> bool:
        left = round(max(0.0, seconds) * 1e9)
        while True:
            piece = min(left, round(LOOK_S * 1e9))
            stopped = super().wait(piece / 1e9, until)
            left -= piece
            if self.witness is not None:
                self.witness.look()
            if stopped or left <= 0:
                return stopped


@dataclass(frozen=True)
class Drove:
    """One drive to a place, and how it ended."""

    to: Point
    to_stay: bool
    """True if the robot was to rotate to a heading there; it does not at a skipped stop."""
    end_ns: int
    outcome: Outcome
    end: Pose


@dataclass(frozen=True)
class Shot:
    """One scan at the time it was made."""

    begin_ns: int
    end_ns: int
    pose: Pose
    good: bool


@dataclass
class Witness:
    """Stands next to the robot; knows nothing of its journal."""

    clock: WatchedClock
    base: SimulatedBase
    rows: list[tuple[int, float, float, float]] = field(default_factory=list)
    drives: list[Drove] = field(default_factory=list)
    shots: list[Shot] = field(default_factory=list)
    orders: list[tuple[int, str]] = field(default_factory=list)
    shakes_m: float = 0.0
    """Distance of a shaking robot from its stationary position."""
    began_ns: int = 0
    ended_ns: int = 0
    events: tuple[AnyEvent, ...] = ()
    """Result of the robot's journal; all other fields are the truth."""

    def look(self) -> None:
        pose = self.base.pose()
        self.rows.append((self.clock.now_ns(), pose.x, pose.y, pose.heading))

    @property
    def xy(self) -> np.ndarray:
        return np.array([row[1:3] for row in self.rows])

    @property
    def length_m(self) -> float:
        return float(np.hypot(*np.diff(self.xy, axis=0).T).sum())

    def seconds(self, ns: int) -> float:
        return (ns - self.began_ns) / 1e9

    def arrivals(self, stop: Stop) -> list[tuple[int, Pose]]:
        """Ends of drives to the stop; of one that ended there early, the time when it was to go on."""
        found = []
        for drove, after in zip(self.drives, [*self.drives[1:], None], strict=True):
            there = near((drove.end.x, drove.end.y), stop, stop.tolerance_m)
            if not (there and drove.to_stay and near(drove.to, stop, 1e-9)):
                continue
            if drove.outcome == "arrived":
                found.append((drove.end_ns, drove.end))
            elif after is None or not near(after.to, stop, 1e-9):
                later = [order for order in self.orders if order[0] > drove.end_ns]
                ns, verb = next(order for order in later if order[1] in GOES_ON)
                found += [(ns, drove.end)] if verb in ("resume", "retry") else []
        return found

    def rests(self, *, least_s: float) -> list[tuple[int, int]]:
        """Times at which the robot was stationary for so long, except for vibration."""
        spans, first = [], self.rows[0]
        for before, row in pairwise([*self.rows, (self.rows[-1][0], math.inf, 0.0, 0.0)]):
            shaken = math.dist(first[1:3], row[1:3]) <= 2 * self.shakes_m and first[3] == row[3]
            if not shaken:
                spans.append((first[0], before[0]))
                first = row
        return [span for span in spans if span[1] - span[0] >= least_s * 1e9]

    def shots_at(self, stop: Stop) -> list[Shot]:
        return [shot for shot in self.shots if near((shot.pose.x, shot.pose.y), stop, stop.tolerance_m)]

    def stood_s(self, verb: str) -> float:
        """Seconds between each pause, or each time the robot gave up, and the order to go on or the end."""
        begin, total = 0, 0.0
        for ns, what in (*self.orders, (self.ended_ns, "end")):
            if what == verb:
                begin = begin or ns
            elif begin:
                total, begin = total + (ns - begin) / 1e9, 0
        return total


def near(place: Point, stop: Stop, metres: float) -> bool:
    return math.dist(place, (stop.x, stop.y)) <= metres


def watch(field_: Field, clock: WatchedClock) -> Witness:
    """A witness of everything that this robot's base and scanner do."""
    witness = clock.witness = Witness(clock, field_.base)
    drive, scan = field_.base.goto, field_.scanner.scan

    def goto(path: Sequence[Point], **how: Any) -> Outcome:
        outcome = drive(path, **how)
        if path:
            to_stay, pose = how["heading"] is not None, field_.base.pose()
            witness.drives.append(Drove(path[-1], to_stay, clock.now_ns(), outcome, pose))
        return outcome

    def scanned(label: str, asked: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        begin, pose = clock.now_ns(), field_.base.pose()
        result = scan(label, asked, interrupt=interrupt)
        good = isinstance(result, ScanResult) and bool(result.points)
        witness.shots.append(Shot(begin, clock.now_ns(), pose, good))
        return result

    field_.base.goto = goto  # type: ignore[method-assign, assignment]
    field_.scanner.scan = scanned  # type: ignore[method-assign]
    return witness


@dataclass(frozen=True)
class Troubles:
    """Events of a run: faults, the seconds at which an operator pauses it, and stops that he skips."""

    faults: tuple[Fault, ...] = ()
    pauses: tuple[float, ...] = ()
    skips: frozenset[str] = frozenset()
    """Left out once the robot is under way to them."""
    gives_up: float = 0.5
    """Probability that the operator skips a stop at which the robot is held, instead of retrying."""
    silences: tuple[float, ...] = ()
    """Seconds at which the robot has heard no station for too long."""
    revised: tuple[float, Mission] | None = None
    """A revision, and when it is pushed."""


def troubles_of(seed: int, mission: Mission) -> Troubles:
    """One or more of everything, wherever chance puts it."""
    chance = random.Random(seed)
    count = len(mission.stops)
    kinds = chance.sample(("slip", "blocked", "shaking", "scanner", "empty"), k=chance.randrange(2, 6))
    amounts = {"slip": chance.uniform(0.06, 0.4), "shaking": chance.uniform(1, 40)}
    faults = [Fault(kind, chance.randrange(1, count + 1), amounts.get(kind, 0.0)) for kind in kinds]  # type: ignore[arg-type]
    if chance.random() < 0.5 and "scanner" in kinds:
        first = next(fault.at for fault in faults if fault.kind == "scanner")
        faults.append(Fault("scanner", first + 1))
    pauses = tuple(chance.uniform(5, 60) for _ in range(chance.randrange(3)))
    return Troubles(
        tuple(faults), pauses, frozenset({chance.choice(mission.stops).id} if chance.random() < 0.6 else ())
    )


def run_of(mission: Mission, troubles: Troubles, folder: Path, *, seed: int = 1) -> Witness:
    """Run a mission to its end; the journal lies in `folder`, and a recording of what a station hears."""
    clock, chance = WatchedClock(), random.Random(seed + 10_000)
    with open_journal(folder, "r1") as journal:
        world = Field(journal=journal, clock=clock, wear=Wear(), faults=Faults(troubles.faults))
        world.base._chance.seed(seed)
        world.station().push(mission)
        world.base.stand_at_start(Pose(x=mission.start.x, y=mission.start.y, heading=mission.start.heading))
        witness = watch(world, clock)
        witness.shakes_m = SHAKE_M if any(fault.kind == "shaking" for fault in troubles.faults) else 0.0
        witness.began_ns = clock.now_ns()
        witness.look()
        assert world.order("start").outcome == "ok"
        for seconds in troubles.pauses:
            clock.at(seconds, lambda: _pause(world, witness))
        for seconds in troubles.silences:
            clock.at(seconds, lambda: _hear_nothing(world, witness))
        if troubles.revised is not None:
            when, revised = troubles.revised
            clock.at(when, lambda: world.station().push(revised))
        _operate(world, witness, troubles, chance)
        witness.ended_ns = clock.now_ns()
        witness.events = tuple(world.journal.events())
        missions = [mission] if troubles.revised is None else [mission, troubles.revised[1]]
        with FieldRecording(folder / "field.rrd", mission) as recording:
            tell(recording, missions, witness)
    return witness


def _pause(world: Field, witness: Witness) -> None:
    if world.controller.run.state == "RUNNING":
        assert world.order("pause").outcome == "ok"
        witness.orders.append((world.clock.now_ns(), "pause"))


def _hear_nothing(world: Field, witness: Witness) -> None:
    """The robot holds at once, except for a scan: it is not cut short."""
    if world.controller.run.state == "RUNNING":
        world.controller.on_link_silence(SILENCE_S)
        if world.controller.run.state == "HELD":
            witness.orders.append((world.clock.now_ns(), "held"))


def _operate(world: Field, witness: Witness, troubles: Troubles, chance: random.Random) -> None:
    """As an operator who looks after the robot whenever it stands and waits."""
    to_skip = set(troubles.skips)
    while not world.controller.run.over:
        run = world.controller.run
        mission = world.controller.snapshot()[1]
        assert mission is not None
        stop = mission.stops[run.at].id if run.at < len(mission.stops) else ""
        if run.state == "RUNNING" and stop in to_skip and run.stop_state == "NAVIGATING":
            to_skip.discard(stop)
            _order(world, witness, "skip")
        elif not world.controller.step():
            held = run.state == "HELD"
            if held:
                witness.orders.append((world.clock.now_ns(), "held"))
            world.clock.wait(chance.uniform(3, 30))
            world.controller.on_link_silence(0.0)
            gives_up = held and stop and chance.random() < troubles.gives_up
            _order(world, witness, "skip" if gives_up else "retry" if held else "resume")


def _order(world: Field, witness: Witness, verb: Any) -> None:
    answer = world.order(verb)
    if answer.reason == "off_route":
        _bring_back(world)
        answer = world.order(verb)
    assert answer.outcome == "ok", answer
    witness.orders.append((world.clock.now_ns(), verb))


def _bring_back(world: Field) -> None:
    """Put the robot onto the nearest place of the leg that it was on."""
    run, mission = world.controller.snapshot()
    assert mission is not None
    pose = world.base.pose()
    leg = shapely.LineString(mission.stops[min(run.leg, run.at)].approach)
    place = leg.interpolate(leg.project(shapely.Point(pose.x, pose.y)))
    world.base.stand_at(Pose(x=place.x, y=place.y, heading=pose.heading))


def tell(taker: RunSink, missions: Sequence[Mission], witness: Witness) -> None:
    """Tell what a station would have heard: all events, and poses 20 times a second."""
    first, *revised = missions
    taker.mission(first)
    for event in witness.events:
        if isinstance(event, RevisionTaken):
            taker.mission(revised[0])
        taker.event(event)
    last = witness.events[-1]
    for number, (ns, x, y, heading) in enumerate(witness.rows, 1):
        taker.pose(
            PoseReport(
                robot="r1", boot_id=last.boot_id, seq=number, robot_ns=ns, run_id=last.run_id,
                mission_time_s=witness.seconds(ns), pose=Pose(x=x, y=y, heading=heading), speed=0.0,
            )
        )  # fmt: skip
