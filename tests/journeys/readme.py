"""Takes the commands out of README.md, and puts their output back in: `python -m tests.journeys.readme`."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path

import pytest

from tests.called import stopgo
from tests.ports import free_port

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
ENDPOINT = "tcp/127.0.0.1:7447"
PRINTED = ("plan", "show", "export")
"""Journeys whose output stands in the README word for word, in the order they depend on one another."""
BLOCK = re.compile(r"<!-- journey: (?P<name>\w+) -->\n```console\n(?P<text>.*?)```", re.DOTALL)


def blocks() -> dict[str, str]:
    """Text of each console block of the README by the name of its journey."""
    return {found["name"]: found["text"] for found in BLOCK.finditer(README.read_text(encoding="utf-8"))}


def commands(block: str) -> list[str]:
    """The commands of a block, without their output."""
    return [line.removeprefix("$ ") for line in block.splitlines() if line.startswith("$ ")]


@contextmanager
def workplace() -> Iterator[Path]:
    """An empty folder in which the README's relative paths work."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "recordings").symlink_to(ROOT / "recordings", target_is_directory=True)
        yield folder


def arguments(command: str, endpoint: str) -> list[str]:
    """The command's arguments, with another endpoint than the README's."""
    words = [endpoint if word == ENDPOINT else word for word in shlex.split(command)]
    assert words[0] == "stopgo", command
    return words[1:]


def run(command: str, folder: Path, endpoint: str = ENDPOINT) -> subprocess.CompletedProcess[str]:
    """Run one command in the folder to its end, in this process: no library is loaded again."""
    with chdir(folder), pytest.MonkeyPatch.context() as patched:
        patched.setenv("COLUMNS", "110")
        return stopgo(*arguments(command, endpoint))


@contextmanager
def robot(command: str, folder: Path, endpoint: str) -> Iterator[subprocess.Popen[str]]:
    """The README's robot, from its first word until the block ends."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-m", "stopgo", *arguments(command, endpoint)],
        cwd=folder, env=environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if line.startswith("ready"):
                break
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=120)


def with_output(block: str, folder: Path, endpoint: str) -> str:
    """The block with what its commands print now."""
    lines = []
    for command in commands(block):
        done = run(command, folder, endpoint)
        lines += [f"$ {command}", *done.stdout.rstrip().splitlines()]
    return "\n".join(lines) + "\n"


def refreshed() -> str:
    """The README with every journey's output as it is now."""
    text, endpoint = README.read_text(encoding="utf-8"), f"tcp/127.0.0.1:{free_port()}"
    found = blocks()
    with workplace() as folder:
        new = {name: with_output(found[name], folder, endpoint) for name in PRINTED}
        with robot(commands(found["robot"])[0], folder, endpoint):
            new["run"] = with_output(found["run"], folder, endpoint).replace(endpoint, ENDPOINT)
    for name, block in new.items():
        text = text.replace(found[name], block, 1)
    return text


if __name__ == "__main__":
    README.write_text(refreshed(), encoding="utf-8")
