"""`stopgo conform station`: a simulated robot with faulty answers tests a third-party station."""

from __future__ import annotations

import shlex
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stopgo.bridge.conform.fake_robot import FakeRobot, FaultyLink, ForgedAnswers, at_work
from stopgo.bridge.conform.requirements import ConformVerdict, NotTried, tried
from stopgo.bridge.conform.station_bench import StationAction, StationBench
from stopgo.bridge.conform.station_requirements import STATION_REQUIREMENTS
from stopgo.bridge.link.access import access_control
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.signatures import MessageSigning
from stopgo.bridge.link.zenoh_link import Guard, listening
from stopgo.bridge.robot.controller import new_boot_id
from stopgo.bridge.robot.program import robots_keys
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import write

COMMAND_S = 180.0
"""Timeout of a station's command."""
QUIET_S = 8.0
"""Time without a query after which the station's action is complete."""
POLL_S = 0.1
SPEED_UP = 10.0


@dataclass(frozen=True)
class StationOptions:
    """Endpoint of the fake robot, and the user's command that makes the station act."""

    listen: str
    robot: str
    site: str | None = None
    keys: Path | None = None
    insecure: bool = False
    command: str | None = None
    """Command that is run for each action; `None` asks a person."""
    patience_s: float = 120.0
    """Time that a person has to begin an action."""
    say: Callable[[str], None] = lambda line: None


@dataclass(frozen=True)
class ForgingGuard(Guard):
    """Guard of a robot whose answers get wrong message signatures on request."""

    forged: Any = None

    @property
    def signing(self) -> MessageSigning:
        return super().signing if self.forged is None else self.forged


@contextmanager
def station_bench(options: StationOptions, ready: Callable[[], None]) -> Iterator[StationBench]:
    """Run a fake robot, and yield the bench of the station; `ready` is called once it listens."""
    keys = KeyExpressions(options.robot, options.site)
    held = None if options.keys is None else robots_keys(options.keys, options.robot)
    boot_id = new_boot_id()
    plain = Guard(
        held, options.insecure, None if held is None else access_control(keys), boot_id
    )  # fmt: skip
    forged = None if held is None else ForgedAnswers(plain.signing)
    guard = ForgingGuard(held, options.insecure, plain.access, boot_id, forged=forged)
    with (
        tempfile.TemporaryDirectory(prefix="stopgo-conform-") as folder,
        listening(options.listen, guard) as link,
    ):
        faulty = FaultyLink(link, keys)
        with at_work(FakeRobot(faulty, keys, boot_id, speed_up=SPEED_UP)) as robot:
            ready()
            path = Path(folder) / "mission.json"
            do = by_command(options, path) if options.command else by_hand(options, faulty, path)
            yield StationBench(robot, do, forged=forged)


def station_verdicts(bench: StationBench) -> Iterator[ConformVerdict]:
    """Test all requirements, and yield their verdicts."""
    yield from tried(STATION_REQUIREMENTS, bench)


def by_command(options: StationOptions, path: Path) -> StationAction:
    """Return a function that makes the station act by the user's command.

    The command ends with 0 for success, 1 for a refusal by the robot, 3 for an unknown outcome.

    Raises
    ------
    InputError
        If the command has no {what}, or cannot be run.
    """
    command = options.command or ""
    if "{what}" not in command:
        raise InputError(f"--command {command}: must hold {{what}}, which is replaced by push FILE, start, …")

    def do(what: str, mission: Mission | None) -> int | None:
        if mission is not None:
            write(mission, path)
        wanted = what if mission is None else f"{what} {shlex.quote(str(path))}"
        try:
            words = shlex.split(command.replace("{what}", wanted))
            return subprocess.run(
                words, check=False, timeout=COMMAND_S, capture_output=True, stdin=subprocess.DEVNULL
            ).returncode
        except subprocess.TimeoutExpired:
            raise NotTried(f"the command did not end within {COMMAND_S:g} s: {what}") from None
        except OSError as error:
            raise InputError(f"--command {command}: {error.strerror}") from None
        except ValueError as error:
            raise InputError(f"--command {command}: {error}") from None

    return do


def by_hand(options: StationOptions, link: FaultyLink, path: Path) -> StationAction:
    """Return a function that asks a person to make the station act, and waits until its queries end."""

    def do(what: str, mission: Mission | None) -> int | None:
        if mission is not None:
            write(mission, path)
        options.say(f"now let the station {what} {f'{path} to ' if mission else ''}{options.robot}")
        deadline = time.monotonic() + options.patience_s
        while not _has_acted(link, what):
            if time.monotonic() > deadline:
                raise NotTried(f"nobody let the station {what} within {options.patience_s:g} s")
            time.sleep(POLL_S)
        seen, since = len(link.asked), time.monotonic()
        while time.monotonic() - since < QUIET_S:
            time.sleep(POLL_S)
            if len(link.asked) != seen:
                seen, since = len(link.asked), time.monotonic()
        return None

    return do


KEYS_OF = {"push": "mission/", "watch": "keep", "status": "info"}
"""First query of a station for each action that is not a command."""


def _has_acted(link: FaultyLink, what: str) -> bool:
    """Return True if the station has sent a query; with faulty answers the command itself may never come."""
    return (
        bool(link.asked)
        if what not in KEYS_OF
        else any(asked.tail.startswith(KEYS_OF[what]) for asked in list(link.asked))
    )
