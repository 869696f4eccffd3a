"""The robot's process: journal, body, controller and agent put together on one link."""

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

from stopgo.bridge.link import keys as key_files
from stopgo.bridge.link.access import access_control
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
from stopgo.bridge.robot.simulator import NO_FAULTS, Faults
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.revision import RevisionPolicy

LOOK_S = 1.5
"""How long a robot that joins a router waits for what that one knows."""
GONE_S = 5.0
"""After this a token of a robot that does not answer is not waited for."""
ASK_AGAIN_S = 0.2
SWITCH_S = 0.0005
"""How long one thread computes while another waits to: an order waits for its turn some twenty times."""


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
    record_bytes: int = LIMIT_BYTES
    """How much of the disk the record of its runs may take."""
    say: Callable[[str], None] = lambda line: None
    """Tells the person there, or its service's log, what was refused."""
    faults: Faults = NO_FAULTS
    """When its program is to crash; what else goes wrong is its body's."""


def run_robot(options: RobotOptions, ready: Callable[[], None]) -> None:
    """Be a robot until SIGTERM or Ctrl-C; `ready` is called once it can be reached."""
    from stopgo.bridge.link.zenoh_link import Guard, joining, listening

    signal.signal(signal.SIGTERM, _leave)
    sys.setswitchinterval(SWITCH_S)
    keys = KeyExpressions(options.name, options.site)
    held = None if options.keys is None else robots_keys(options.keys, options.name, options.state)
    boot_id = new_boot_id()
    refusals = RefusalLog(options.say, key_files.now_utc)
    guard = Guard(
        held, options.insecure, None if held is None else access_control(keys), boot_id,
        refused=lambda key, why: refusals.note(place_of(key)[2], "somebody", why), state=options.state,
    )  # fmt: skip
    opened = joining(options.connect, guard) if options.connect else listening(options.listen, guard)
    with opened as link:
        if options.connect:
            check_name_is_free(link, keys, options.connect)
        _serve(link, keys, options, boot_id, ready)


def _serve(
    link: Link, keys: KeyExpressions, options: RobotOptions, boot_id: str, ready: Callable[[], None]
) -> None:
    with robot_on(link, keys, options, boot_id) as agent:
        ready()
        agent.wait()


def check_name_is_free(link: Link, keys: KeyExpressions, router: str) -> None:
    """Refuse to be a second robot of one name behind a router.

    A token alone is that of a robot that has just ended, perhaps: it is gone when its lease is.

    Raises
    ------
    AnswerIsNo
        If a robot of this name answers.
    """
    shown, gone = threading.Event(), threading.Event()
    link.watch_presence(keys.alive, lambda key, alive: (shown if alive else gone).set())
    if not shown.wait(LOOK_S):
        return
    deadline = time.monotonic() + GONE_S
    while not gone.is_set() and time.monotonic() < deadline:
        others = others_of(link, keys, "")
        if others:
            raise NegativeResult(
                f"robot {keys.robot}: is alive behind {router} already (boot {others[0]}); two of one name"
                " cannot be told apart. End the other, or choose another --name"
            )
        gone.wait(ASK_AGAIN_S)


@contextmanager
def robot_on(
    link: Link, keys: KeyExpressions, options: RobotOptions, boot_id: str | None = None
) -> Iterator[Agent]:
    """A robot on `link`, which is sealed with the robot's keys if it has any."""
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
                boot_id=boot_id,
            )  # fmt: skip
            agent = Agent(
                keys=keys, link=link, journal=journal, runner=controller, clock=clock, command_clock=wall,
                inbox=Inbox(journal, controller, body.scanner.profiles), speed_up=options.speed_up,
                to_map=options.to_map, stand_still=controller.hold if options.connect else None,
                refusals=RefusalLog(options.say, key_files.now_utc),
                recorder=recorder,
            )  # fmt: skip
            with on_link(agent):
                yield agent


def clocks(
    journal: Journal, *, speed_up: float, newest_ns: int = 0, now_ns: int | None = None
) -> tuple[Clock, Clock]:
    """The run's clock and the one that orders count on.

    A sped-up clock runs ahead of the wall's, and a wall clock may have been set back: after a reboot the
    run's goes on behind the newest event, and the newest pose of a record, so that neither goes back in time.
    """
    wall = WallClock(origin_ns=now_ns)
    origin_ns = max(wall.now_ns(), journal.newest_ns + 1, newest_ns + 1)
    return WallClock(speed_up=speed_up, origin_ns=origin_ns), wall


def robots_keys(folder: Path, name: str, state: Path | None = None) -> key_files.HeldKeys:
    """The robot's own keys; anybody else's are refused."""
    held = key_files.read_keys(folder, now=key_files.now_utc(), state=state)
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
