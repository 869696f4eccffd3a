"""A command that is asked to end leaves by its own way out."""

from __future__ import annotations

import signal
import subprocess
import sys

from tests.journeys.readme import ROOT

ENDED = """
import os, signal, sys
from contextlib import contextmanager
import mission.__main__ as front

@contextmanager
def left_open():
    try:
        yield
    finally:
        print("closed", flush=True)

def app():
    import typer
    made = typer.Typer()
    @made.command()
    def wait(when: str) -> None:
        with left_open():
            os.kill(os.getpid(), signal.SIGTERM)
            signal.pause()
    return made

front.build_app = app
sys.exit(front.main(["now"]))
"""


def test_sigterm_closes_what_is_open() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ENDED], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stdout == "closed\n"
    assert done.stderr == ""
