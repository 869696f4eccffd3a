"""A robot at work in the test's own time, for the kit to put through its paces."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from stopgo.bridge.conform.conform_robot import robot_verdicts
from stopgo.bridge.conform.falsified_signatures import FalsifiedSigning
from stopgo.bridge.conform.requirements import ConformVerdict
from stopgo.bridge.conform.robot_bench import Forger, OtherStation, RobotBench
from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.keys import now_utc, read_keys
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.signatures import NO_SIGNING, KeySigning, MessageSigning
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.robot.controller import Controller, new_boot_id
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.recorder import RunRecorder
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner
from tests.bridge.world import EXACT


class RobotUnderTest:
    """A whole robot on a memory link, which can be started again; subclasses are broken on purpose."""

    controller: type[Controller] = Controller
    agent: type[Agent] = Agent
    inbox: type[Inbox] = Inbox
    recorder: type[RunRecorder] = RunRecorder

    def __init__(self, site: Path | None = None) -> None:
        self.site = site
        self.board = Switchboard()
        self.keys = KeyExpressions("r1")
        self.journal: Journal = memory_journal()
        self.clock = WallClock()
        self.base = SimulatedBase(clock=self.clock, wear=EXACT)
        self.scanner = SimulatedScanner(clock=self.clock)
        self.controllers: list[Controller] = []
        self.sync_s = 0.0
        """Time that each transaction takes."""
        self.journal.rows.commit_hook = lambda moment: self._sync() if moment == "commit" else None
        self._running = ExitStack()
        self._folder = TemporaryDirectory()

    def signing(self, name: str, boot_id: str = "") -> MessageSigning:
        if self.site is None:
            return NO_SIGNING
        return KeySigning(read_keys(self.site / name, now=now_utc()), boot_id=boot_id)

    def slow_disk(self, seconds: float) -> None:
        self.sync_s = seconds

    def _sync(self) -> None:
        if self.sync_s:
            time.sleep(self.sync_s)

    def boot(self) -> None:
        boot_id = new_boot_id()
        link = self.board.link(self.signing("r1", boot_id))
        controller = self.controller(
            robot="r1", journal=self.journal, base=self.base, scanner=self.scanner, clock=self.clock,
            mission_taken=lambda mission: self.base.stand_at_start(pose_of(mission.start)), boot_id=boot_id,
        )  # fmt: skip
        self.controllers.append(controller)
        agent = self.agent(
            keys=self.keys, link=link, journal=self.journal, runner=controller,
            inbox=self.inbox(self.journal, controller, ("default",)), clock=self.clock,
            command_clock=self.clock, recorder=self.recorder(Path(self._folder.name)),
        )  # fmt: skip
        self._running.callback(link.close)
        self._running.enter_context(on_link(agent))

    def restart(self) -> None:
        self.shut_down()
        self.boot()

    def shut_down(self) -> None:
        self._running.close()

    def bench(self) -> RobotBench:
        forger = None
        if self.site is not None:
            signing = FalsifiedSigning(self.signing("alice"))
            forger = Forger(self.board.link(signing), signing)
        other = OtherStation("bob", self.board.link(self.signing("bob")))
        return RobotBench(
            self.board.link(self.signing("alice")), self.keys, commander="alice", timeout_s=2.0, other=other,
            forger=forger, restart=self.restart, slow_disk=self.slow_disk,
        )  # fmt: skip


@contextmanager
def booted(robot: RobotUnderTest) -> Iterator[RobotUnderTest]:
    robot.boot()
    try:
        yield robot
    finally:
        robot.shut_down()


def verdicts(robot: RobotUnderTest, *, drive: bool = True) -> list[ConformVerdict]:
    """Verdicts of the kit on a robot."""
    with booted(robot):
        return list(robot_verdicts(robot.bench(), drive=drive))


def failed(found: list[ConformVerdict]) -> dict[str, str]:
    return {verdict.text: verdict.reason for verdict in found if verdict.outcome == "failed"}
