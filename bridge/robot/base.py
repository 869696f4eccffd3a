"""What the controller needs of a robot and of a scanner: two small interfaces, so that each is one class."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Event
from typing import Literal, Protocol

import msgspec

from stopgo.mission.document import Mission, Point, RobotSpec, Scan
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult

Outcome = Literal["arrived", "interrupted", "blocked"]


class Rest(msgspec.Struct, frozen=True, kw_only=True):
    """By how much the poses of a base that stands still differ: what its localisation makes of standing."""

    metres: float = 0.002
    radians: float = 0.002


class BaseHealth(msgspec.Struct, frozen=True, kw_only=True):
    """What a base tells of itself besides its battery; each thing is `None` where it does not."""

    localisation: float | None = None
    """How well it knows where it is, 0 to 1."""
    emergency_stop: bool | None = None
    safety_field: bool | None = None
    """Whether something stands in the field that its safety scanners watch."""


class Base(Protocol):
    """What carries the scanner. Poses are in the mission's frame."""

    def pose(self) -> Pose: ...

    def speed(self) -> float:
        """Metres per second, now."""

    def battery(self) -> float:
        """0 to 1."""

    def health(self) -> BaseHealth:
        """What else is known of it now."""

    def endurance_s(self) -> float | None:
        """Seconds that a full battery lasts at work; `None` if it cannot tell."""

    def rest(self) -> Rest:
        """What counts as standing still while a robot settles."""

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        """Drive along `path`, turn to `heading`, and stand still; also when `interrupt` is set meanwhile."""

    def stop(self) -> None:
        """Stand still, whatever was going on (after a reboot the wheels may still turn)."""

    def unfit(self, mission: Mission) -> str:
        """Why it can never drive this mission; empty if it can."""

    def not_ready(self) -> str:
        """Why it cannot drive at present; empty if it can."""

    def blocked_by(self) -> str:
        """What ended the last drive as blocked, if more is known than where; else empty."""


class Scanner(Protocol):
    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        """Scan, and give up when `interrupt` is set or `scan.timeout_s` has passed."""

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """How a scan ended that was begun before the program was started anew; `None` if it cannot say."""

    @property
    def profiles(self) -> tuple[str, ...] | None:
        """Scan profiles it knows; `None` if it takes any."""
