"""Contents of an imported file: the visited positions in order, and the known values of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stopgo.mission.document import OnFailure, Point
from stopgo.mission.frames.transform import SiteOrigin


@dataclass(frozen=True)
class Visit:
    """A scan position, in the site's metres; `None` for values that the file does not contain."""

    xy: Point
    via: tuple[Point, ...] = ()
    """Points driven through on the leg to it, in order."""
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
    """Points driven through after the last visit."""
    start: Point | None = None
    origin: SiteOrigin | None = None
    speed: float | None = None
    """Metres per second."""
    notes: tuple[str, ...] = ()
    """Parts of the file that were not imported, a line each."""


@dataclass(frozen=True)
class ImportOptions:
    """Values given by the user, which the file may not contain."""

    origin: SiteOrigin | None = None
    autopilot: str | None = None
    """Autopilot whose rule is used for degrees, one of `stopgo.mission.mavlink.autopilots.AUTOPILOTS`."""


MissionReader = Callable[[bytes, str, ImportOptions], ImportedRoute]
"""`(data, source, given)`; `source` is used in error messages."""
