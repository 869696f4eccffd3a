"""Stops, interrupts and wakes the work of a controller's thread.

Nothing here stores anything or takes a lock, so a stop never waits for the disk or for a decision.
"""

from __future__ import annotations

import threading

from stopgo.bridge.robot.base import Base
from stopgo.mission.run.states import Run


class WorkControl:
    """Signals from other threads to the thread that drives and scans; each may be set from any thread."""

    def __init__(self, base: Base) -> None:
        self._base = base
        self.interrupt = threading.Event()
        """Ends the current drive, wait or scan early."""
        self.wake = threading.Event()
        """Ends the wait for work."""
        self.closing = False

    def stop_base(self) -> None:
        """Bring the base to a standstill."""
        self._base.stop()

    def interrupt_work(self, run: Run) -> None:
        """End the current work early, except a scan: it may end, so that no stop is scanned twice."""
        if run.stop_state != "SCANNING":
            self.interrupt.set()

    def close(self) -> None:
        """End the current work, a scan too, and begin no other."""
        self.closing = True
        self.interrupt.set()
        self.wake.set()
