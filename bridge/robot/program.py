"""The robot's process: journal, body, controller and agent put together on one link."""

from __future__ import annotations

import os
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bridge.link import keys as key_files
from bridge.link.access import access_control
from bridge.link.clock import Clock, WallClock
from bridge.link.link import Link
from bridge.link.protocol import KeyExpressions
from bridge.robot.agent import Agent, on_link
from bridge.robot.bodies import OpenBody
from bridge.robot.controller import Controller, new_boot_id
from bridge.robot.inbox import Inbox
from bridge.robot.journal import Journal, open_journal
from bridge.robot.simulator import NO_FAULTS, Faults
from mission.document import Transform
from mission.errors import InputError
from mission.run.revision import RevisionPolicy


@dataclass(frozen=True)
class RobotOptions:
    """How a robot is set up."""

    name: str
    listen: str
    state: Path
    body: OpenBody
    """What it drives."""
    connect: str | None = None
    """A zenoh router to connect to, instead of listening."""
    site: str | None = None
    speed_up: float = 1.0
    to_map: Transform | None = None
    """Site to map, if the robot knows it; else as each mission says."""
    insecure: bool = False
    keys: Path | None = None
    """Folder with the robot's keys; required beyond this machine."""
    revisions: RevisionPolicy = "next-stop"
    """What becomes of a new revision that is pushed during a run."""
    faults: Faults = NO_FAULTS
    """When its program is to crash; what else goes wrong is its body's."""


def run_robot(options: RobotOptions, ready: Callable[[], None]) -> None:
    """Be a robot until SIGTERM or Ctrl-C; `ready` is called once it can be reached."""
    from bridge.link.zenoh_link import Guard, joining, listening

    signal.signal(signal.SIGTERM, _leave)
    keys = KeyExpressions(options.name, options.site)
    held = None if options.keys is None else robots_keys(options.keys, options.name)
    boot_id = new_boot_id()
    guard = Guard(held, options.insecure, None if held is None else access_control(keys), boot_id)
    opened = joining(options.connect, guard) if options.connect else listening(options.listen, guard)
    with opened as link, robot_on(link, keys, options, boot_id) as agent:
        ready()
        agent.wait()


@contextmanager
def robot_on(
    link: Link, keys: KeyExpressions, options: RobotOptions, boot_id: str | None = None
) -> Iterator[Agent]:
    """A robot on `link`, which is sealed with the robot's keys if it has any."""
    with open_journal(options.state, options.name) as journal:
        clock, wall = clocks(journal, speed_up=options.speed_up)
        journal.edge = crashing(options.faults)
        with options.body(clock) as body:
            controller = Controller(
                robot=options.name, journal=journal, base=body.base, scanner=body.scanner, clock=clock,
                command_clock=wall, mission_taken=body.take, revisions=options.revisions,
                boot_id=boot_id,
            )  # fmt: skip
            agent = Agent(
                keys=keys, link=link, journal=journal, runner=controller, clock=clock, command_clock=wall,
                inbox=Inbox(journal, controller, body.scanner.profiles), speed_up=options.speed_up,
                to_map=options.to_map,
            )  # fmt: skip
            with on_link(agent):
                yield agent


def clocks(journal: Journal, *, speed_up: float, now_ns: int | None = None) -> tuple[Clock, Clock]:
    """The run's clock and the one that orders count on.

    A sped-up clock runs ahead of the wall's, and a wall clock may have been set back: after a reboot the
    run's goes on behind the newest event, so that events never go back in time.
    """
    wall = WallClock(origin_ns=now_ns)
    origin_ns = max(wall.now_ns(), journal.newest_ns + 1)
    return WallClock(speed_up=speed_up, origin_ns=origin_ns), wall


def robots_keys(folder: Path, name: str) -> key_files.HeldKeys:
    """The robot's own keys; anybody else's are refused."""
    held = key_files.read_keys(folder, now=key_files.now_utc())
    if (held.holder.role, held.holder.name) != ("robot", name):
        raise InputError(
            f"--keys {folder}: are those of {held.holder.role} {held.holder.name}, not of robot {name}"
        )
    return held


def crashing(faults: Faults) -> Callable[[str], None]:
    """What dies at the journal entry that the faults name, as if the power had failed."""
    seen: Counter[str] = Counter()

    def at_edge(moment: str) -> None:
        seen[moment] += 1
        if faults.due("crash" if moment == "commit" else "crashed", seen[moment]):
            os.kill(os.getpid(), signal.SIGKILL)

    return at_edge


def _leave(signum: int, frame: object) -> None:
    raise SystemExit(0)
