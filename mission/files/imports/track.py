"""What an imported file says: which places are visited in which order, and what is known of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stopgo.mission.document import OnFailure, Point
from stopgo.mission.frames.transform import SiteOrigin


@dataclass(frozen=True)
class Visit:
    """A place to scan from, in the site's metres; `None` is what the file does not say."""

    xy: Point
    via: tuple[Point, ...] = ()
    """Places driven through on the way to it, in order."""
    id: str | None = None
    heading: float | None = None
    """Radians counter-clockwise from +x."""
    settle_s: float | None = None
    scan_s: float | None = None
    timeout_s: float | None = None
    profile: str | None = None
    tolerance_m: float | None = None
    on_failure: OnFailure | None = None
    retries: int | None = None
    doorway: bool = False


@dataclass(frozen=True)
class ImportedRoute:
    """Visits in the order of driving."""

    visits: tuple[Visit, ...]
    back: tuple[Point, ...] = ()
    """Places driven through after the last visit."""
    start: Point | None = None
    origin: SiteOrigin | None = None
    speed: float | None = None
    """Metres per second."""
    notes: tuple[str, ...] = ()
    """What of the file was not taken over, a line each."""


@dataclass(frozen=True)
class ImportOptions:
    """What the person says that the file may not."""

    origin: SiteOrigin | None = None
    autopilot: str | None = None
    """By whose rule degrees are metres, one of `stopgo.mission.mavlink.autopilots.AUTOPILOTS`."""


MissionReader = Callable[[bytes, str, ImportOptions], ImportedRoute]
"""`(data, source, given)`; `source` stands in error messages."""
