"""Surroundings that a shell hands down, made the same for every test run."""

from __future__ import annotations

import os
import signal
import time
from types import FrameType

OUTLIVES = "STOPGO_TESTS_OUTLIVE_HANGUP"
"""Tells the workers that the shell had SIGHUP ignored: they themselves start with nothing ignored."""

DROPPED = (
    "CLICOLOR_FORCE",
    "COLUMNS",
    "FORCE_COLOR",
    "LC_ALL",
    "LC_CTYPE",
    "LINES",
    "NO_COLOR",
    "PYTHONDONTWRITEBYTECODE",
    "PYTHONIOENCODING",
    "PYTHONWARNINGS",
    "TZ",
)
GIVEN = {"LANG": "C.UTF-8", "TERM": "dumb"}


def forget_the_shell() -> None:
    """Give this process and its children the signals, file modes and environment of a plain shell."""
    _handle_ignored_signals()
    os.umask(0o022)
    for name in DROPPED:
        os.environ.pop(name, None)
    os.environ.update(GIVEN)
    if hasattr(time, "tzset"):
        time.tzset()


def _handle_ignored_signals() -> None:
    """Ignore no signal: children would inherit that.

    They do not inherit a handler: so `nohup make test` outlives its terminal, while a robot that a test
    starts hears a hang-up.
    """
    ignored = [number for number in signal.valid_signals() if signal.getsignal(number) is signal.SIG_IGN]
    for name in ("SIGCHLD", "SIGHUP", "SIGQUIT", "SIGTERM", "SIGUSR1", "SIGUSR2"):
        if getattr(signal, name, None) in ignored:
            signal.signal(getattr(signal, name), signal.SIG_DFL)
            os.environ |= {OUTLIVES: "yes"} if name == "SIGHUP" else {}
    if OUTLIVES in os.environ:
        signal.signal(signal.SIGHUP, _outlive)
    if signal.SIGINT in ignored:  # as in a background program of a shell without job control
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_SETMASK, [])


def _outlive(number: int, frame: FrameType | None) -> None:
    """Go on."""
