"""Locks whose waits are measured, so that another thread notices a controller that does not answer.

A section begins when a thread asks for its lock, and ends when the thread gives the lock back. It lasts long
only if a thread holds the lock that long: while the disk writes. Drives and scans hold no lock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType


class LockWaits:
    """The sections that have begun and not ended yet; it has no lock itself."""

    def __init__(self, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._now_ns = now_ns
        self._began_ns: dict[object, int] = {}

    def begin(self) -> object:
        """Note that a section begins; return its mark for `end`."""
        mark = object()
        self._began_ns[mark] = self._now_ns()
        return mark

    def end(self, mark: object) -> None:
        self._began_ns.pop(mark, None)

    def oldest(self) -> object | None:
        """Return the mark of the oldest section that has not ended; `None` if there is none."""
        return next(iter(list(self._began_ns)), None)

    def longest_s(self) -> float:
        """Return the age of the oldest section that has not ended; 0 if there is none."""
        began_ns = list(self._began_ns.values())
        return (self._now_ns() - min(began_ns)) / 1e9 if began_ns else 0.0


class WatchedLock:
    """A reentrant lock; its sections are noted in `waits`."""

    def __init__(self, waits: LockWaits) -> None:
        self._waits = waits
        self._lock = threading.RLock()
        self._marks = threading.local()

    def __enter__(self) -> None:
        marks = self._marks.__dict__.setdefault("open", [])
        marks.append(self._waits.begin())
        self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()
        self._waits.end(self._marks.open.pop())

    @contextmanager
    def within(self, longest_s: float) -> Iterator[bool]:
        """Hold the lock if it is free within that time; the block learns if it is."""
        mark = self._waits.begin()
        free = self._lock.acquire(timeout=longest_s)
        try:
            yield free
        finally:
            if free:
                self._lock.release()
            self._waits.end(mark)
