"""Robot agents as child processes, for demonstrations and tests."""

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
"""Prefix of the line that a robot prints once it can be reached."""


@contextmanager
def robot_process(
    name: str,
    state: Path,
    *,
    listen: str | None = None,
    speed_up: float = 1.0,
    extra: Sequence[str] = (),
) -> Iterator[str]:
    """Run a robot in a child process; yield its endpoint (by default a free port of 127.0.0.1)."""
    endpoint = listen or f"tcp/127.0.0.1:{free_port()}"
    process = start_robot(name, state, listen=endpoint, speed_up=speed_up, extra=extra)
    try:
        yield endpoint
    finally:
        end_robot(process)


def start_robot(
    name: str, state: Path, *, listen: str | None, speed_up: float = 1.0, extra: Sequence[str] = ()
) -> subprocess.Popen[str]:
    """Start a robot, and return its process once it is ready; with a router (`extra`) it does not listen.

    Raises
    ------
    RobotUnreachable
        If the robot ended or did not get ready; the message has its last line.
    """
    own = ["--name", name, "--state", str(state)]
    own += [] if listen is None else ["--listen", listen]
    own += [] if speed_up == 1.0 else ["--speed-up", f"{speed_up:g}"]
    return start("robot", *own, *extra, called=f"robot {name}")


def start(*arguments: str, called: str) -> subprocess.Popen[str]:
    """Start a stopgo command that prints when it is ready; raises the errors of `start_robot`."""
    command = [sys.executable, "-m", "stopgo", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    lines: list[str] = []
    ready = threading.Event()
    threading.Thread(target=_read, args=(process, lines, ready), daemon=True).start()
    ready.wait(READY_S)
    if not any(line.startswith(READY) for line in lines):
        end_robot(process)
        raise RobotUnreachable(f"{called} did not start: {lines[-1].strip() if lines else 'no output'}")
    return process


def end_robot(process: subprocess.Popen[str]) -> None:
    """End the robot's process; kill it if it does not end in time."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _read(process: subprocess.Popen[str], lines: list[str], ready: threading.Event) -> None:
    """Read the robot's output, so that a full pipe never blocks it."""
    assert process.stderr is not None
    for line in process.stderr:
        lines.append(line)
        if line.startswith(READY):
            ready.set()
    ready.set()
