"""Waiting for what another thread or process does; a limit only as the last resort."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

LAST_RESORT_S = 60.0
"""Far above any wait on a busy machine."""
EVERY_S = 0.02
"""Interval of looking again: another process or thread reports to nobody what it has done."""

T = TypeVar("T")


def wait_until(seen: Callable[[], T]) -> T:
    """Return what is seen, once it is true."""
    deadline = time.monotonic() + LAST_RESORT_S
    while not (found := seen()):
        assert time.monotonic() < deadline
        time.sleep(EVERY_S)
    return found
