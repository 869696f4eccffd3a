"""What holds for every test."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """Let processes that tests start be interrupted, also where the tests themselves run in the background.

    A shell without job control starts background programs with SIGINT ignored, and children inherit that.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
