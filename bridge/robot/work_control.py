"""Stops, interrupts and wakes the work of a controller's thread.

Nothing here stores anything or waits for a lock that is held while something is stored. So a stop never waits
for the disk or for a decision.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from stopgo.bridge.robot.base import Base
from stopgo.mission.run.states import Run


class WorkControl:
    """Signals from other threads to the thread that drives and scans; each may be set from any thread.

    `standing` sets the interrupt after it has noted itself, and `clear_for_work` looks for it after it has
    cleared the interrupt. So no drive begins while anything keeps the robot standing.
    """

    def __init__(self, base: Base) -> None:
        self._base = base
        self.interrupt = threading.Event()
        """Ends the current drive or wait early."""
        self.scan_interrupt = threading.Event()
        """Ends the current scan early: a pause does not."""
        self.wake = threading.Event()
        """Ends the wait for work."""
        self.closed = threading.Event()
        self.driving = False
        """True while the controller's thread drives."""
        self.failure: BaseException | None = None
        """Error after which the robot stands until its program ends."""
        self._kept_standing: dict[object, None] = {}

    @property
    def closing(self) -> bool:
        return self.closed.is_set()

    @property
    def stands(self) -> bool:
        """True while anything keeps the robot standing."""
        return bool(self._kept_standing or self.failure)

    def stop_base(self) -> None:
        """Bring the base to a standstill."""
        self._base.stop()

    def try_to_stop(self) -> Exception | None:
        """Bring the base to a standstill; return the error of a base that does not take the command."""
        try:
            self.stop_base()
        except Exception as error:  # noqa: BLE001 (whatever a base raises; the program then ends by it)
            return error
        return None

    @contextmanager
    def standing(self) -> Iterator[Exception | None]:
        """Command the base to stand before the block begins; no drive begins before the block ends.

        Yields the error of a base that did not take the command. Then the robot's program ends after the
        block, for a base without a program stops by itself. After an error in the block it ends, too.
        """
        mark = object()
        self._kept_standing[mark] = None
        self.interrupt.set()
        fault = self.try_to_stop()
        with self.standing_on_error():
            yield fault
        if fault is not None:
            self.stand_for_good(fault)
        del self._kept_standing[mark]
        self.wake.set()

    @contextmanager
    def standing_on_error(self) -> Iterator[None]:
        """Command the base to stand if the block ends by an error; the robot's program then ends, too."""
        try:
            yield
        except BaseException as error:
            self.stand_for_good(error)
            raise

    def stand_for_good(self, error: BaseException) -> None:
        """Command the base to stand until the program ends, which the error does."""
        self.failure = self.failure or error
        self.interrupt.set()
        self.wake.set()
        self.try_to_stop()

    def clear_for_work(self) -> bool:
        """Clear the interrupts for new work; false if the robot must stand."""
        self.interrupt.clear()
        self.scan_interrupt.clear()
        if not (self._kept_standing or self.failure or self.closing):
            return True
        self.interrupt.set()
        self.scan_interrupt.set()
        return False

    def interrupt_work(self, run: Run) -> None:
        """End the current work early, except a scan: it may end, so that no stop is scanned twice."""
        if run.stop_state != "SCANNING":
            self.interrupt.set()
            self.scan_interrupt.set()

    def close(self) -> None:
        """End the current work, a scan too, and begin no other."""
        self.closed.set()
        self.interrupt.set()
        self.scan_interrupt.set()
        self.wake.set()
