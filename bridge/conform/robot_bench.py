"""Bench of a robot under test: it queries the robot, pushes trial missions, sends commands, and ends runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from stopgo.bridge.conform.falsified_signatures import FalsifiedSigning
from stopgo.bridge.conform.requirements import Nonconforming, PeerNotResponding
from stopgo.bridge.conform.robot_queries import TRY_S, RobotQueries, read
from stopgo.bridge.conform.trial_commands import TrialCommands
from stopgo.bridge.conform.trial_pushes import TrialPushes
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import Info, KeyExpressions
from stopgo.mission.run.events import StateReport

AT_REST_S: Final = 60.0
"""Longest time that a run may take to end after an abort."""
OVER: Final = ("IDLE", "READY", "FINISHED", "ABORTED")
"""States without a run in progress."""


@dataclass(frozen=True)
class OtherStation:
    """Second identity, to test who may send which command."""

    name: str
    link: Link


@dataclass(frozen=True)
class Forger:
    """Link on which queries have falsified signatures."""

    link: Link
    signing: FalsifiedSigning


class RobotBench(RobotQueries):
    """One robot under test."""

    def __init__(
        self,
        link: Link,
        keys: KeyExpressions,
        *,
        commander: str,
        timeout_s: float = 5.0,
        take_over: bool = False,
        other: OtherStation | None = None,
        forger: Forger | None = None,
        restart: Callable[[], None] | None = None,
        slow_disk: Callable[[float], None] | None = None,
    ) -> None:
        """`slow_disk` makes each sync of the robot's disk take that many seconds; 0: as before."""
        super().__init__(link, keys, commander=commander, timeout_s=timeout_s)
        self.other = other
        self.forger = forger
        self.restart = restart
        self.slow_disk = slow_disk
        self.missions = TrialPushes(self, take_over=take_over)
        self.commands = TrialCommands(self)

    def return_to_rest(self, *, may_drive: bool) -> None:
        """End a run after a test; raises the errors of `Bench.return_to_rest`."""
        state = self._responding_state()
        if state.state in OVER:
            return
        self.end_run()
        if not may_drive:
            raise Nonconforming(f"the robot was {state.state} without a command to drive; aborted")

    def _responding_state(self) -> StateReport:
        try:
            return self.info().state
        except Nonconforming as silent:
            raise PeerNotResponding(f"the robot does not answer: {silent}") from None

    def leave(self) -> None:
        """Abort a run in progress, if the robot answers; raise `PeerNotResponding` if it does not abort."""
        raw = self.link.ask(self.keys.info, timeout_s=TRY_S)
        if raw is not None and not self._at_rest(raw):
            self.end_run()

    def _at_rest(self, raw: bytes) -> bool:
        """Return True if an info shows that no run is in progress."""
        try:
            return read(raw, Info, "info").state.state in OVER
        except Nonconforming:
            return False  # the state is unknown

    def end_run(self) -> None:
        """Abort the run; raise `PeerNotResponding` if the robot does not execute the abort."""
        try:
            self.commands.give(self.commands.order("abort"))
            self.wait_for_state(*OVER, within_s=AT_REST_S)
        except Nonconforming as wrong:
            raise PeerNotResponding(f"no abort by the robot; stop it by hand: {wrong}") from None
