"""A zenoh router as a process: `python -m tests.bridge.router tcp/127.0.0.1:7447 [KEYS]`, until SIGTERM."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path

from bridge.link.keys import now_utc, read_keys
from bridge.link.zenoh_link import Guard, listening


def leave(signum: int, frame: object) -> None:
    raise SystemExit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, leave)
    keys = read_keys(Path(sys.argv[2]), now=now_utc()) if len(sys.argv) > 2 else None
    with listening(sys.argv[1], Guard(keys)):
        print("ready", flush=True)
        threading.Event().wait()
