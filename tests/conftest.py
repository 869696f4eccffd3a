"""What holds for every test."""

from __future__ import annotations

import os
import signal


def pytest_configure() -> None:
    """Let no test depend on where the tests run, or on which of them ran before in the same process.

    A shell without job control starts background programs with SIGINT ignored, and children inherit that.
    pymavlink asks this variable for its version, at its import and again later; the bridge sets it.
    """
    os.environ["MAVLINK20"] = "1"
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
