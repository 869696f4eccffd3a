"""A zenoh router as a process, until SIGTERM.

`python -m tests.bridge.router tcp/127.0.0.1:7447 [KEYS [RULES]]`; rules of `stopgo keys router-rules`.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
from pathlib import Path

from stopgo.bridge.link.keys import now_utc, read_keys
from stopgo.bridge.link.zenoh_link import Guard, listening


def leave(signum: int, frame: object) -> None:
    raise SystemExit(0)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, leave)
    keys = read_keys(Path(sys.argv[2]), now=now_utc()) if len(sys.argv) > 2 else None
    rules = json.loads(Path(sys.argv[3]).read_text())["access_control"] if len(sys.argv) > 3 else None
    with listening(sys.argv[1], Guard(keys, access=rules)):
        print("ready", flush=True)
        threading.Event().wait()
