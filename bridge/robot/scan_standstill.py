"""Standstill of the base during a scan: its poses are watched from the scan's begin to its end."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from stopgo.bridge.robot.base import Base
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scan_motion import ScanMotion


class ScanStandstill:
    """Takes the poses that are read during a scan, in whatever thread; `why` says how the base moved."""

    def __init__(self, base: Base) -> None:
        self._base = base
        self._lock = threading.Lock()
        self._motion: ScanMotion | None = None

    @contextmanager
    def watching(self, tolerance_m: float) -> Iterator[None]:
        """Watch from here to the end of the block; both ends are looked at in any case."""
        with self._lock:
            self._motion = ScanMotion(tolerance_m)
        self.look()
        yield
        self.look()

    def look(self) -> None:
        """Read the base's pose once."""
        self.take(self._base.pose(), self._base.speed())

    def take(self, pose: Pose, speed: float) -> None:
        """Take a pose that was read just now; outside of a scan it changes nothing that counts."""
        with self._lock:
            if self._motion is not None:
                self._motion.take(pose, speed)

    @property
    def why(self) -> str:
        """Motion of the base during the last scan, in words; empty if it stood, as far as its poses show."""
        with self._lock:
            return "" if self._motion is None else self._motion.why
