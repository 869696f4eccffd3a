"""The two interfaces of the controller to its hardware: a base and a scanner."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Event
from typing import Literal, Protocol, runtime_checkable

import msgspec

from stopgo.mission.document import Mission, Point, RobotSpec, Scan
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult

Outcome = Literal["arrived", "interrupted", "blocked"]


class Rest(msgspec.Struct, frozen=True, kw_only=True):
    """Greatest difference between two poses of a base at standstill; it depends on the localisation."""

    metres: float = 0.002
    radians: float = 0.002


class BaseHealth(msgspec.Struct, frozen=True, kw_only=True):
    """Health of a base besides its battery; each value is `None` if the base does not report it."""

    localisation: float | None = None
    """Quality of the localisation, 0 to 1."""
    emergency_stop: bool | None = None
    safety_field: bool | None = None
    """True if an object is in the field of its safety scanners."""
    battery_ok: bool | None = None
    """False while a failsafe of the battery lasts."""
    position_ok: bool | None = None
    """False while the estimator has no position."""
    fence_ok: bool | None = None
    """False while the geofence is breached."""


class Base(Protocol):
    """The vehicle that carries the scanner. Poses are in the mission's frame."""

    def pose(self) -> Pose: ...

    def speed(self) -> float:
        """Metres per second, now."""

    def battery(self) -> float | None:
        """0 to 1; `None` if it is not known."""

    def health(self) -> BaseHealth:
        """Return the health besides the battery."""

    def endurance_s(self) -> float | None:
        """Return the seconds that a full battery lasts at work; `None` if unknown."""

    def rest(self) -> Rest:
        """Return the limits within which the base counts as stationary."""

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        """Drive along `path`, turn to `heading`, and stop; stop early when `interrupt` is set."""

    def stop(self) -> None:
        """Stand still, whatever the base is doing (after a reboot the wheels may still turn)."""

    def unfit(self, mission: Mission) -> str:
        """Return why the base can never drive this mission; empty if it can."""

    def not_ready(self) -> str:
        """Return why the base cannot drive at present; empty if it can."""

    def blocked_by(self) -> str:
        """Return the cause of the last blocked drive; empty if unknown."""


@runtime_checkable
class WayFinder(Protocol):
    """A base that may find its own way to a path's end."""

    def finds_way(self) -> bool:
        """Return True if the present mission allows that."""


def finds_way(base: object) -> bool:
    """Return True if a base finds its own way; most drive along the path that they are given."""
    return isinstance(base, WayFinder) and base.finds_way()


@runtime_checkable
class SharedBase(Protocol):
    """A base that somebody else may take from the robot's program, as an autopilot by its remote control."""

    def watch_takeover(self) -> Callable[[], str]:
        """Return a function that reports who has taken the base since now; empty if nobody has."""


def watch_takeover(base: object) -> Callable[[], str]:
    """Return what reports who takes a base from now on; of a base that is not shared, it reports nobody."""
    return base.watch_takeover() if isinstance(base, SharedBase) else lambda: ""


class Scanner(Protocol):
    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        """Scan, and give up when `interrupt` is set or `scan.timeout_s` has passed."""

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Return the outcome of a scan that began before the program restarted; `None` if unknown."""

    @property
    def profiles(self) -> tuple[str, ...] | None:
        """Names of the scan profiles; `None` if the scanner accepts any."""
