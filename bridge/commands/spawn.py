"""Starts a robot as a process of its own, for demonstrations and tests, and ends it again."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from stopgo.mission.console.ports import free_port
from stopgo.mission.errors import RobotUnreachable

READY_S = 60.0
END_S = 30.0
READY = "ready "
"""How the line begins that a robot says once it can be reached."""


@contextmanager
def robot_process(
    name: str,
    state: Path,
    *,
    listen: str | None = None,
    speed_up: float = 1.0,
    extra: Sequence[str] = (),
) -> Iterator[str]:
    """A robot in another process; gives the endpoint it listens on (a free port of 127.0.0.1 by default)."""
    endpoint = listen or f"tcp/127.0.0.1:{free_port()}"
    process = start_robot(name, state, listen=endpoint, speed_up=speed_up, extra=extra)
    try:
        yield endpoint
    finally:
        end_robot(process)


def start_robot(
    name: str, state: Path, *, listen: str | None, speed_up: float = 1.0, extra: Sequence[str] = ()
) -> subprocess.Popen[str]:
    """The process of a robot that is ready; one that connects to a router (`extra`) listens nowhere.

    Raises
    ------
    RobotUnreachable
        With the last line the robot said, if it ended or did not get ready.
    """
    own = ["--name", name, "--state", str(state)]
    own += [] if listen is None else ["--listen", listen]
    own += [] if speed_up == 1.0 else ["--speed-up", f"{speed_up:g}"]
    return start("robot", *own, *extra, called=f"robot {name}")


def start(*arguments: str, called: str) -> subprocess.Popen[str]:
    """The process of a stopgo command that says when it is ready; raises as `start_robot` does."""
    command = [sys.executable, "-m", "stopgo", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    lines: list[str] = []
    ready = threading.Event()
    threading.Thread(target=_read, args=(process, lines, ready), daemon=True).start()
    ready.wait(READY_S)
    if not any(line.startswith(READY) for line in lines):
        end_robot(process)
        raise RobotUnreachable(f"{called} did not start: {lines[-1].strip() if lines else 'it said nothing'}")
    return process


def end_robot(process: subprocess.Popen[str]) -> None:
    """Ask the robot to end, and make sure that it does."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _read(process: subprocess.Popen[str], lines: list[str], ready: threading.Event) -> None:
    """Keep reading what the robot says, so that it is never held up by a full pipe."""
    assert process.stderr is not None
    for line in process.stderr:
        lines.append(line)
        if line.startswith(READY):
            ready.set()
    ready.set()
