"""The smallest world of the bridge's tests: a corridor mission, and a robot in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import msgspec

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import Commit, KeyExpressions, Manifest
from stopgo.bridge.link.signatures import NO_SIGNING, MessageSigning
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.runner import state_report
from stopgo.bridge.robot.simulated_faults import NO_FAULTS, RobotFaults
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner, Wear
from stopgo.bridge.station.station import Station
from stopgo.mission.document import (
    Frame,
    Mission,
    Origin,
    Point,
    Policy,
    RobotSpec,
    Scan,
    ScannerSpec,
    Sees,
    Start,
    Stop,
    with_digest,
)
from stopgo.mission.run.events import StateReport
from stopgo.mission.run.revision import RevisionPolicy
from stopgo.mission.run.run_commands import Answer, RunCommand, Verb
from stopgo.mission.run.states import Run

EXACT = Wear(noise_m=0.0, noise_rad=0.0, battery_per_s=0.0)
WALKING = RobotSpec(radius=0.35, speed=0.5, turn_rate=math.radians(45), acceleration=0.5)


def corridor(*, stops: int = 3, revision: int = 1, closed: bool = True, **stop_details: Any) -> Mission:
    """Stops every 2 m along the x axis from a start at the origin, and the way straight back."""
    made = tuple(_stop(index, **stop_details) for index in range(stops))
    end: Point = (2.0 * stops, 0.0)
    return with_digest(
        Mission(
            id="c0ffee00c0ffee00c0ffee00c0ffee00", revision=revision, name="corridor", digest="",
            frame=Frame(name="site"), georeference=None, robot=WALKING,
            scanner=ScannerSpec(profile="default", range=5.0),
            start=Start(x=0.0, y=0.0, heading=0.0, reason="given"), stops=made,
            return_=(end, (0.0, 0.0)) if closed else None,
            policy=Policy(link_loss="continue", link_loss_after_s=30.0, battery_min=0.15),
            origin=Origin(floor="corridor", floor_digest="0" * 64, parameters={"seed": 1}, stopgo="0.1.0"),
        )
    )  # fmt: skip


def _stop(index: int, **details: Any) -> Stop:
    x = 2.0 * (index + 1)
    plain = Stop(
        id=f"s{index + 1}", x=x, y=0.0, heading=0.0, doorway=False, tolerance_m=0.05, settle_s=2.0,
        scan=Scan(profile="default", duration_s=60.0, timeout_s=120.0), on_failure="ask", retries=1,
        approach=((x - 2.0, 0.0), (x, 0.0)), sees=Sees(units=10, new_units=5),
    )  # fmt: skip
    return msgspec.structs.replace(plain, **details)


@dataclass
class Field:
    """A simulated robot whose time passes only while it works."""

    journal: Journal = field(default_factory=memory_journal)
    clock: SimulatedClock = field(default_factory=SimulatedClock)
    wear: Wear = EXACT
    keep: Path | None = None
    record: Path | None = None
    faults: RobotFaults = NO_FAULTS
    revisions: RevisionPolicy = "next-stop"
    ids: Any = field(default_factory=count)

    def __post_init__(self) -> None:
        self.board = Switchboard()
        self.link = self.board.link()
        self.keys = KeyExpressions("r1")
        self.base = SimulatedBase(clock=self.clock, wear=self.wear, keep=self.keep, faults=self.faults)
        self.scanner = SimulatedScanner(clock=self.clock, faults=self.faults, record=self.record)
        self.boot()

    def boot(self) -> None:
        """Start the robot's program (again): all it knows is in the journal, the world stays as it is."""
        self.controller = Controller(
            robot="r1", journal=self.journal, base=self.base, scanner=self.scanner, clock=self.clock,
            mission_taken=lambda mission: self.base.stand_at_start(pose_of(mission.start)),
            revisions=self.revisions,
        )  # fmt: skip
        self.inbox = Inbox(self.journal, self.controller, self.scanner.profiles)

    def station(self, **options: Any) -> Station:
        """A station on a memory link to this robot's agent, which serves but does not work by itself."""
        self.serve()
        return Station(self.board.link(), self.keys, **({"commander": "test", "timeout_s": 0.3} | options))

    def station_at_the_link(self, commander: str) -> Station:
        """A station; whoever answers for the robot goes on doing so."""
        return Station(self.board.link(), self.keys, commander=commander, timeout_s=0.3)

    def serve(self, signing: MessageSigning = NO_SIGNING) -> None:
        """Answer for the robot as it is since its last boot."""
        self.link.close()
        self.link = self.board.link(signing)
        self.agent = Agent(
            keys=self.keys, link=self.link, journal=self.journal, runner=self.controller, inbox=self.inbox,
            clock=self.clock, command_clock=self.clock,
        )  # fmt: skip
        self.agent.serve()

    def report(self) -> StateReport:
        """The robot's report of its state."""
        newest = self.journal.newest
        return state_report(self.controller, robot="r1", seq=1, ns=self.clock.now_ns(), newest=newest)

    def commit(self, manifest: Manifest) -> Commit:
        not_after_ns = self.clock.now_ns() + 10**15
        return Commit(manifest=manifest, commander="test", nonce="n1", not_after_ns=not_after_ns)

    def order(self, verb: Verb, **details: Any) -> Answer:
        return self.controller.execute(self.command(verb, **details))

    def command(self, verb: Verb, **details: Any) -> RunCommand:
        given = {"cmd_id": f"c{next(self.ids)}", "commander": "test", "valid_for_s": 5.0} | details
        return RunCommand(verb=verb, **({"issued_ns": self.clock.now_ns()} | given))

    def work(self, *, most: int = 500) -> int:
        """Let the robot work until there is nothing to do; how many pieces of work that were."""
        for done in range(most):
            if not self.controller.step():
                return done
        raise AssertionError(f"the robot still works after {most} steps: {self.controller.run}")

    def work_until(self, reached: Callable[[Run], bool]) -> None:
        """Let the robot work until its run is as wanted."""
        while not reached(self.controller.run):
            assert self.controller.step(), f"the robot has nothing to do: {self.controller.run}"

    def told(self, run_id: str | None = None) -> list[str]:
        """The journal as words: `Scanned s1`."""
        events = self.journal.events(run_id=run_id)
        return [f"{type(event).__name__} {getattr(event, 'stop', '')}".strip() for event in events]
