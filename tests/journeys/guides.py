"""Commands of the guides, the files they need, and the robots and vehicles they reach: in one process."""

from __future__ import annotations

import re
import shlex
import textwrap
from collections.abc import Callable, Iterator
from contextlib import ExitStack, chdir, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import CompletedProcess
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest

from stopgo.bridge.commands import tunnel_commands
from stopgo.bridge.conform import conform_robot
from stopgo.bridge.link import zenoh_link
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.zenoh_link import UNGUARDED, Guard, check_endpoint
from stopgo.bridge.mavlink.simulated import vehicle_process
from stopgo.bridge.mavlink.simulated.vehicle_process import VehicleOptions, setup_of, vehicle_on
from stopgo.bridge.mavlink.vehicle_link.url import Url, read_url
from stopgo.bridge.robot import program
from stopgo.bridge.robot.controller import new_boot_id
from stopgo.bridge.robot.program import RobotOptions, robot_on, robots_keys
from stopgo.bridge.station import shared_session
from stopgo.commands import site_command
from tests.called import stopgo
from tests.own_time import stepped_into

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
BLOCK = re.compile(r"^ *```(?P<kind>\w*)\n(?P<text>.*?)^ *```$", re.MULTILINE | re.DOTALL)
PROMPT = re.compile(r"^(?:\w+)?\$ +")
TOUR = re.compile(r"<!-- journey: (?!open)\w+ -->\n```console\n.*?```", re.DOTALL)
"""Blocks of the README that `test_readme` runs."""
VEHICLE = Url("udpin", "127.0.0.1", 14550)


def commands_of(page: Path) -> list[str]:
    """Command lines in the blocks of a page, without prompts and comments, in their order."""
    text = TOUR.sub("", page.read_text(encoding="utf-8"))
    return [command for found in BLOCK.finditer(text) for command in _in_block(found["kind"], found["text"])]


def blocks_of(page: str, kind: str) -> list[str]:
    """Blocks of a guide in a language, such as files that its commands read."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return [textwrap.dedent(found["text"]) for found in BLOCK.finditer(text) if found["kind"] == kind]


def _in_block(kind: str, text: str) -> Iterator[str]:
    if text.lstrip().startswith("#!"):
        yield text.lstrip().splitlines()[0]  # a script is one command
        return
    for line in text.replace("\\\n", " ").splitlines():
        given = line.strip()
        if kind == "sh" or PROMPT.match(given) or given.startswith("stopgo "):
            yield re.sub(r" {2,}# .*| # .*", "", PROMPT.sub("", given)).strip()


@dataclass
class GuideFolder:
    """A folder with the files of a guide, and robots and vehicles that its commands reach."""

    folder: Path
    patch: pytest.MonkeyPatch
    ends: ExitStack
    """Closes what a guide has started."""
    board: Switchboard = field(default_factory=Switchboard)
    robots: dict[str, ExitStack] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    """Other values for parts of the commands, such as paths outside the folder."""

    def run(self, command: str) -> CompletedProcess[str]:
        """Run a command as its guide has it, with other values for what lies outside the folder."""
        line, _, target = command.partition(" > ")
        for said, here in self.words.items():
            line = line.replace(said, here)
        done = stopgo(*shlex.split(line)[1:])
        if target:
            (self.folder / target).write_text(done.stdout, encoding="utf-8")
        return done

    # What the modules of the bridge get instead of processes and connections

    @contextmanager
    def connecting(self, endpoint: str, guard: Guard = UNGUARDED, *, open_s: float = 1.0) -> Iterator[Link]:
        check_endpoint(endpoint, guard, option="--connect")
        yield self.board.link(guard.signing)

    def run_robot(self, options: RobotOptions, ready: Callable[[], None]) -> None:
        """Run the robot until the guide ends, or until it is started again."""
        option, endpoint = ("--connect", options.connect) if options.connect else ("--listen", options.listen)
        held = None if options.keys is None else robots_keys(options.keys, options.name, options.state)
        boot_id = new_boot_id()
        guard = Guard(held, options.insecure, boot_id=boot_id, state=options.state)
        check_endpoint(endpoint, guard, option=option)
        self.robots.setdefault(options.name, ExitStack()).close()
        keys = KeyExpressions(options.name, options.site)
        link = self.board.link(guard.signing)
        self.robots[options.name].enter_context(robot_on(link, keys, options, boot_id))
        ready()

    def run_vehicle(self, options: VehicleOptions, ready: Callable[[Url], None]) -> None:
        url = read_url(options.url)
        self.ends.enter_context(vehicle_on(url, setup_of(options), speed_up=options.speed_up))
        ready(url)

    def replace_processes(self) -> None:
        """Let robots run in this process, and let what runs until Ctrl-C be ended at once."""
        for module, name in ((zenoh_link, "connecting"), (conform_robot, "connecting")):
            self.patch.setattr(module, name, self.connecting)
        for name in ("joining", "listening"):
            self.patch.setattr(zenoh_link, name, self.connecting)
        self.patch.setattr(program, "run_robot", self.run_robot)
        self.patch.setattr(vehicle_process, "run_vehicle", self.run_vehicle)
        self.patch.setattr(shared_session.SharedSession, "serve", _ctrl_c)
        self.patch.setattr(tunnel_commands, "_run", _ctrl_c)
        self.patch.setattr(tunnel_commands, "_leave_on_sigterm", lambda: None)
        waiting = SimpleNamespace(wait=_ctrl_c)
        self.patch.setattr(site_command, "threading", SimpleNamespace(Event=lambda: waiting))


def _ctrl_c(*_: Any) -> NoReturn:
    raise KeyboardInterrupt


@contextmanager
def place(folder: Path) -> Iterator[GuideFolder]:
    """The folder as working folder and home, in time of its own."""
    with stepped_into(), chdir(folder), pytest.MonkeyPatch.context() as patch, ExitStack() as ends:
        made = GuideFolder(folder, patch, ends)
        patch.setenv("HOME", str(folder))
        # A session's socket lies in it, whose path may have 107 bytes.
        patch.setenv("XDG_STATE_HOME", ends.enter_context(TemporaryDirectory(prefix="stopgo-")))
        made.words = {"~/": f"{folder}/"}
        made.replace_processes()
        try:
            yield made
        finally:
            for robot in made.robots.values():
                robot.close()
