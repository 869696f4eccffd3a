"""Clocks: the wall clock, the same sped up for a simulated robot, and a test's own."""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable
from threading import Event
from typing import Protocol


class Clock(Protocol):
    def now_ns(self) -> int:
        """Nanoseconds since 1970; never goes back."""

    def wait(self, seconds: float, until: Event | None = None) -> bool:
        """Wait, or return early and true when `until` is set."""


class WallClock:
    """The machine's time from `origin_ns` on, running `speed_up` times as fast.

    It counts on the monotonic clock, so that a correction of the date moves nothing.
    """

    def __init__(self, *, speed_up: float = 1.0, origin_ns: int | None = None) -> None:
        self._speed_up = speed_up
        self._origin_ns = time.time_ns() if origin_ns is None else origin_ns
        self._began_ns = time.monotonic_ns()

    def now_ns(self) -> int:
        return self._origin_ns + int((time.monotonic_ns() - self._began_ns) * self._speed_up)

    def wait(self, seconds: float, until: Event | None = None) -> bool:
        pause = max(0.0, seconds) / self._speed_up
        if until is None:
            time.sleep(pause)
            return False
        return until.wait(pause)


class SimulatedClock:
    """Clock whose time passes only during `wait`; scheduled calls happen while it passes."""

    def __init__(self, *, origin_ns: int = 1_700_000_000_000_000_000) -> None:
        self._now_ns = origin_ns
        self._due: list[tuple[int, int, Callable[[], object]]] = []
        self._scheduled = itertools.count()
        """Number of each scheduled call; those of one moment happen in that order."""

    def now_ns(self) -> int:
        return self._now_ns

    def at(self, seconds: float, happens: Callable[[], object]) -> None:
        """Call `happens` in `seconds` from now, in the thread that waits then."""
        heapq.heappush(self._due, (self._now_ns + round(seconds * 1e9), next(self._scheduled), happens))

    def jump(self, seconds: float) -> None:
        """Set the date forward or back; nothing waits for it, and scheduled calls come no sooner."""
        by_ns = round(seconds * 1e9)
        self._now_ns += by_ns
        self._due = [(due_ns + by_ns, order, happens) for due_ns, order, happens in self._due]

    def wait(self, seconds: float, until: Event | None = None) -> bool:
        if until is not None and until.is_set():
            return True
        end_ns = self._now_ns + round(max(0.0, seconds) * 1e9)
        while self._due and self._due[0][0] <= end_ns:
            self._now_ns, _, happens = heapq.heappop(self._due)
            happens()
            if until is not None and until.is_set():
                return True
        self._now_ns = max(self._now_ns, end_ns)
        return until is not None and until.is_set()
