"""`stopgo conform robot`: a station that tests every requirement on a third-party robot."""

from __future__ import annotations

import shlex
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stopgo.bridge.conform.command_requirements import IDLE, ORDERS
from stopgo.bridge.conform.falsified_signatures import FalsifiedSigning
from stopgo.bridge.conform.requirements import (
    ConformVerdict,
    Nonconforming,
    PeerNotResponding,
    Requirement,
    tried,
)
from stopgo.bridge.conform.robot_bench import OVER, Forger, OtherStation, RobotBench
from stopgo.bridge.conform.robot_pushes import PUSHES
from stopgo.bridge.conform.robot_questions import QUESTIONS
from stopgo.bridge.conform.robot_restarts import RESTARTS
from stopgo.bridge.conform.robot_runs import RUNS
from stopgo.bridge.conform.robot_signatures import SIGNATURE_REQUIREMENTS
from stopgo.bridge.conform.robot_slow_disk import SLOW_DISK
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import Info, KeyExpressions
from stopgo.bridge.link.signatures import MessageSigning
from stopgo.bridge.link.zenoh_link import Guard, connecting
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown
from stopgo.mission.run.lease import remaining_s

REQUIREMENTS: tuple[Requirement[RobotBench], ...] = (
    *QUESTIONS, *SIGNATURE_REQUIREMENTS, *IDLE, *PUSHES, *ORDERS, *RUNS, *SLOW_DISK, *RESTARTS,
)  # fmt: skip
RESTART_S = 120.0
"""Timeout of a command that restarts a robot or makes its disk slow."""


@dataclass(frozen=True)
class ConformOptions:
    """Connection to a robot under test, and the actions that are allowed."""

    endpoint: str
    robot: str
    site: str | None = None
    commander: str | None = None
    timeout_s: float = 5.0
    insecure: bool = False
    keys: Path | None = None
    other_keys: Path | None = None
    take_over: bool = False
    restart: str | None = None
    slow_disk: str | None = None
    """The user's command that makes the robot's disk slow; it gets the seconds of one sync."""
    asked: Callable[[], None] | None = None
    """Asks a person to restart the robot, where no command does; raises `NotTried` if nobody does."""


@dataclass(frozen=True)
class FalsifiedGuard(Guard):
    """Guard of a link with intentionally wrong message signatures."""

    falsified: Any = None

    @property
    def signing(self) -> MessageSigning:
        return self.falsified


@contextmanager
def robot_bench(options: ConformOptions) -> Iterator[RobotBench]:
    """Connect to a robot that is at rest and that nobody else commands, and yield its bench.

    Raises
    ------
    InputError
        If it is on a run, or another operator commands it; nothing was done.
    RobotUnreachable
        If it was not found.
    """
    with ExitStack() as stack:
        reach = _reach(options)
        station = stack.enter_context(connect(**reach, keys=options.keys, commander=options.commander))
        info = _first_info(station)
        check_at_rest(info, station.commander, take_over=options.take_over)
        other: OtherStation | None = None
        if options.other_keys is not None:
            second = stack.enter_context(connect(**reach, keys=options.other_keys))
            other = OtherStation(second.commander, second.link)
        elif station.held is None:
            other = OtherStation(f"{station.commander}-other", station.link)
        bench = RobotBench(
            station.link, station.keys, commander=station.commander, timeout_s=options.timeout_s,
            take_over=options.take_over, other=other, forger=_forger(station, options, stack),
            restart=options.asked if options.restart is None else restarting(options.restart),
            slow_disk=None if options.slow_disk is None else slowing(options.slow_disk),
        )  # fmt: skip
        try:
            yield bench
        finally:  # also after Ctrl-C: no run may continue
            _leave(bench)


def _leave(bench: RobotBench) -> None:
    try:
        bench.leave()
    except PeerNotResponding as error:
        raise OutcomeUnknown(f"{bench.keys.robot}: {error}") from None


def _reach(options: ConformOptions) -> dict[str, Any]:
    return {
        "endpoint": options.endpoint, "robot": options.robot, "site": options.site,
        "timeout_s": options.timeout_s, "insecure": options.insecure,
    }  # fmt: skip


def _first_info(station: Station) -> Info:
    try:
        return station.info()
    except NegativeResult as no:
        raise InputError(f"{no}; nothing was tested") from None


def check_at_rest(info: Info, commander: str, *, take_over: bool) -> None:
    """Check that no run is in progress, and that nobody else commands the robot.

    Raises
    ------
    InputError
        Names the remedy.
    """
    if info.state.state not in OVER:
        raise InputError(
            f"{info.robot} is {info.state.state}: a robot on a run is not tested; end the run first"
            f" (stopgo abort --robot {info.robot})"
        )
    lease = info.lease
    left_s = 0.0 if lease is None else remaining_s(lease, info.clock_ns)
    if lease is not None and lease.commander != commander and left_s > 0 and not take_over:
        raise InputError(
            f"{lease.commander} commands {info.robot} for {left_s:.0f} s more: wait, or add --take-over"
        )


def _forger(station: Station, options: ConformOptions, stack: ExitStack) -> Forger | None:
    if station.held is None:
        return None
    signing = FalsifiedSigning(Guard(station.held).signing)
    guard = FalsifiedGuard(station.held, falsified=signing)
    link = stack.enter_context(connecting(options.endpoint, guard, open_s=options.timeout_s))
    await_robot(link, station.keys, options.timeout_s)
    return Forger(link, signing)


def await_robot(link: Link, keys: KeyExpressions, timeout_s: float) -> None:
    """Wait until a second link finds the robot."""
    seen = threading.Event()
    link.watch_presence(keys.alive, lambda key, alive: seen.set() if alive else None)
    if not seen.wait(timeout_s):
        raise OutcomeUnknown(f"{keys.robot} was not found on a second link within {timeout_s:g} s")


def restarting(command: str) -> Callable[[], None]:
    """Return a function that runs the user's command for a restart of the robot, and waits for its end."""
    words = _words("--restart", command)
    return lambda: _run("--restart", command, words)


def slowing(command: str) -> Callable[[float], None]:
    """Return a function that runs the user's command for a slow disk, with the seconds of one sync."""
    words = _words("--slow-disk", command)
    return lambda seconds: _run("--slow-disk", command, [*words, f"{seconds:g}"])


def _words(option: str, command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise InputError(f"{option} {command}: {error}") from None


def _run(option: str, command: str, words: list[str]) -> None:
    """Run a command of the user's, and wait for its end; processes that it leaves behind may go on."""
    null = subprocess.DEVNULL
    try:
        subprocess.run(words, check=True, timeout=RESTART_S, stdin=null, stdout=null, stderr=null)
    except OSError as error:
        raise InputError(f"{option} {command}: {error.strerror}") from None
    except subprocess.SubprocessError as error:
        raise InputError(f"{option} {command}: {error}") from None


def robot_verdicts(bench: RobotBench, *, drive: bool) -> Iterator[ConformVerdict]:
    """Test all requirements, and yield their verdicts; the robot's own mission is restored at the end.

    Raises
    ------
    InputError
        If the robot's own mission cannot be read, and so would be lost; nothing was done.
    """
    try:
        held = bench.missions.stored_mission()
    except Nonconforming as wrong:
        raise InputError(
            f"the mission on {bench.keys.robot} cannot be read, and would be lost: {wrong}; clear it on the"
            " robot first; nothing was tested"
        ) from None
    lost = False
    for verdict in tried(REQUIREMENTS, bench, drive=drive, undrivable="the robot would drive: --drive"):
        lost |= verdict.lost
        yield verdict
    if not lost and held is not None:
        last = Requirement[RobotBench](
            "Pushing a mission",
            "what lay there before lies ready again",
            lambda bench: bench.missions.restore(held),
        )
        yield from tried((last,), bench)
