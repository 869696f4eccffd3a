"""Work that the first process of a test run leaves on disk for the others, such as compiled code."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no such locks: one process runs all tests there
    fcntl = None  # type: ignore[assignment]


@contextmanager
def first_alone(what: str) -> Iterator[None]:
    """The first process that comes here does it alone; the others wait for that, and then go all at once.

    Started together, each of them would do what one of them leaves for all. One that dies lets the next go.
    """
    folder = Path(os.environ["XDG_STATE_HOME"])
    done = folder / f"{what}.done"
    with (folder / f"{what}.lock").open("w") as lock:
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            yield
            done.touch()
            return
    yield
