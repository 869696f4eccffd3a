"""A zenoh router as a process: `python -m tests.bridge.router tcp/127.0.0.1:7447`, until SIGTERM."""

from __future__ import annotations

import signal
import sys
import threading

from bridge.zenoh_link import listening


def leave(signum: int, frame: object) -> None:
    raise SystemExit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, leave)
    with listening(sys.argv[1]):
        print("ready", flush=True)
        threading.Event().wait()
