"""Tests and the processes that they start are the same, whatever the shell handed down."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CHILD = """
import os, signal
ignored = [name for name in NAMES if signal.getsignal(getattr(signal, name)) is signal.SIG_IGN]
print(ignored, len(signal.pthread_sigmask(signal.SIG_BLOCK, [])), oct(os.umask(0)), os.environ.get("COLUMNS"))
"""
HOSTILE = """
import os, signal, subprocess, sys
for name in NAMES:
    signal.signal(getattr(signal, name), signal.SIG_IGN)
signal.pthread_sigmask(signal.SIG_SETMASK, [signal.SIGTERM])
os.umask(0o777)
os.environ["COLUMNS"] = "40"
from tests.shell import forget_the_shell
forget_the_shell()
os.kill(os.getpid(), signal.SIGHUP)
subprocess.run([sys.executable, "-S", "-c", sys.argv[1]], check=True)
"""
NAMES = "NAMES = 'SIGCHLD SIGHUP SIGINT SIGQUIT SIGTERM'.split()\n"


def test_nothing_that_the_shell_ignores_or_blocks_reaches_what_a_test_starts() -> None:
    """A hang-up, which nohup has ignored, does not end the tests themselves."""
    done = subprocess.run(
        [sys.executable, "-c", NAMES + HOSTILE, NAMES + CHILD],
        cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "[] 0 0o22 None\n"), done.stderr
