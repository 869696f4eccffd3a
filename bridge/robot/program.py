"""The robot's process: journal, hardware, controller and agent on one link."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stopgo.bridge.link import keys as key_files
from stopgo.bridge.link.access import access_control
from stopgo.bridge.link.admission import can_admit
from stopgo.bridge.link.clock import Clock, WallClock
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import KeyExpressions, place_of
from stopgo.bridge.robot.agent import Agent, on_link, others_of
from stopgo.bridge.robot.controller import Controller, new_boot_id
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.bridge.robot.recorder import LIMIT_BYTES, RunRecorder
from stopgo.bridge.robot.refusal_log import RefusalLog
from stopgo.bridge.robot.robot_hardware import OpenBody
from stopgo.bridge.robot.simulated_faults import NO_FAULTS, RobotFaults
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.revision import RevisionPolicy

if TYPE_CHECKING:
    from stopgo.bridge.link.zenoh_link import ZenohLink

TOKEN_WAIT_S = 1.5
"""Wait of a robot that joins a router for the tokens that the router knows."""
TOKEN_END_S = 5.0
"""Wait for a token to disappear whose robot does not answer."""
ASK_AGAIN_S = 0.2
SWITCH_S = 0.0005
"""Time slice of a thread while others wait; a command waits for some twenty slices."""


@dataclass(frozen=True)
class RobotOptions:
    """Options of a robot's process."""

    name: str
    listen: str
    state: Path
    body: OpenBody
    """The robot's hardware."""
    connect: str | None = None
    """A zenoh router to connect to, instead of listening."""
    site: str | None = None
    speed_up: float = 1.0
    to_map: Transform | None = None
    """Transform from the site to the map; if not given, each mission's own."""
    insecure: bool = False
    keys: Path | None = None
    """Folder with the robot's keys; required beyond this machine."""
    revisions: RevisionPolicy = "next-stop"
    """Treatment of a new revision that is pushed during a run."""
    record_bytes: int = LIMIT_BYTES
    """Most disk space for the records of its runs."""
    say: Callable[[str], None] = lambda line: None
    """Prints refusals to the person at the robot, or its service's log."""
    faults: RobotFaults = NO_FAULTS
    """Simulated crashes of the program; other faults belong to the hardware."""


def run_robot(options: RobotOptions, ready: Callable[[], None]) -> None:
    """Run the robot agent until SIGTERM or Ctrl-C; `ready` is called once it can be reached."""
    from stopgo.bridge.link.zenoh_link import Guard, admitting, joining

    end_at_sigterm()
    sys.setswitchinterval(SWITCH_S)
    keys = KeyExpressions(options.name, options.site)
    held = None if options.keys is None else robots_keys(options.keys, options.name, options.state)
    boot_id = new_boot_id()
    refusals = RefusalLog(options.say, key_files.now_utc)
    admits = options.connect is None and can_admit(options.listen)
    guard = Guard(
        held, options.insecure, None if held is None else access_control(keys, admits=admits), boot_id,
        refused=lambda key, why: refusals.note(place_of(key)[2], "somebody", why),
        turned_away=lambda why: refusals.note("connection", "somebody", why), state=options.state,
    )  # fmt: skip
    opened = joining(options.connect, guard) if options.connect else admitting(options.listen, guard)
    with opened as link:
        if options.connect:
            check_name_is_free(link, keys, options.connect)
        _serve(link, keys, options, boot_id, ready)


def _serve(
    link: ZenohLink, keys: KeyExpressions, options: RobotOptions, boot_id: str, ready: Callable[[], None]
) -> None:
    with robot_on(link, keys, options, boot_id) as agent:
        if link.admission is not None:
            link.admission.failed = agent.fail
        ready()
        agent.wait()


def check_name_is_free(link: Link, keys: KeyExpressions, router: str) -> None:
    """Refuse to be a second robot of one name behind a router.

    A token alone proves nothing: a robot that has just ended leaves it until its lease ends.

    Raises
    ------
    NegativeResult
        If a robot of this name answers.
    """
    shown, ended = threading.Event(), threading.Event()
    link.watch_presence(keys.alive, lambda key, alive: (shown if alive else ended).set())
    if not shown.wait(TOKEN_WAIT_S):
        return
    deadline = time.monotonic() + TOKEN_END_S
    while not ended.is_set() and time.monotonic() < deadline:
        others = others_of(link, keys, "")
        if others:
            raise NegativeResult(
                f"robot {keys.robot}: robot name already in use at {router} (boot {others[0]});"
                " end the other robot, or choose another --name"
            )
        ended.wait(ASK_AGAIN_S)


@contextmanager
def robot_on(
    link: Link, keys: KeyExpressions, options: RobotOptions, boot_id: str | None = None
) -> Iterator[Agent]:
    """Run a robot on `link`, which signs with the robot's keys if it has any."""
    with open_journal(options.state, options.name) as journal:
        recorder = RunRecorder(
            options.state / "record", room=journal.space_shortage, limit_bytes=options.record_bytes
        )
        clock, wall = clocks(journal, speed_up=options.speed_up, newest_ns=recorder.newest_ns)
        journal.rows.commit_hook = crashing(options.faults)
        with options.body(clock) as body:
            recorder.health = body.base.health
            controller = Controller(
                robot=options.name, journal=journal, base=body.base, scanner=body.scanner, clock=clock,
                command_clock=wall, mission_taken=body.take, revisions=options.revisions,
                boot_id=boot_id, say=RefusalLog(options.say, key_files.now_utc).tell,
            )  # fmt: skip
            agent = Agent(
                keys=keys, link=link, journal=journal, runner=controller, clock=clock, command_clock=wall,
                inbox=Inbox(journal, controller, body.scanner.profiles), speed_up=options.speed_up,
                to_map=options.to_map, stand_still=controller.hold if options.connect else None,
                refusals=RefusalLog(options.say, key_files.now_utc),
                recorder=recorder,
            )  # fmt: skip
            body.attach(controller)
            with on_link(agent):
                yield agent


def clocks(
    journal: Journal, *, speed_up: float, newest_ns: int = 0, now_ns: int | None = None
) -> tuple[Clock, Clock]:
    """Return the run's clock and the clock of commands.

    A sped-up clock runs ahead of the wall clock, and a wall clock may have been set back. So after a reboot
    the run's clock continues after the newest event and the newest pose of a record.
    """
    wall = WallClock(origin_ns=now_ns)
    origin_ns = max(wall.now_ns(), journal.newest_ns + 1, newest_ns + 1)
    return WallClock(speed_up=speed_up, origin_ns=origin_ns), wall


def robots_keys(folder: Path, name: str, state: Path | None = None) -> key_files.HeldKeys:
    """Read the robot's own keys; raises InputError if they belong to another holder."""
    held = key_files.read_keys(folder, now=key_files.now_utc(), state=state)
    if (held.holder.role, held.holder.name) != ("robot", name):
        raise InputError(
            f"--keys {folder}: keys of {held.holder.role} {held.holder.name}, not of robot {name};"
            " give the folder of that robot"
        )
    return held


def crashing(faults: RobotFaults) -> Callable[[str], None]:
    """Return a commit hook that kills the process at the journal entry that the faults name."""
    seen: Counter[str] = Counter()

    def at_commit(moment: str) -> None:
        seen[moment] += 1
        if faults.due("crash" if moment == "commit" else "crashed", seen[moment]):
            os.kill(os.getpid(), signal.SIGKILL)

    return at_commit


def end_at_sigterm() -> None:
    """Let SIGTERM end the program as its end does: with every session closed."""
    signal.signal(signal.SIGTERM, _leave)


def _leave(signum: int, frame: object) -> None:
    raise SystemExit(0)
