"""A robot's position and heading error at its stop, and the one test against the mission's tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

from stopgo.mission.document import Mission, ScannerSpec, Stop
from stopgo.mission.run.events import AnyEvent, Pose, Scanned, Unconfirmed
from stopgo.mission.run.scans import HEADING_RAD, heading_error

MOST_NAMED = 6


def deviation(pose: Pose, stop: Stop) -> float:
    """Metres from the stop."""
    return math.hypot(pose.x - stop.x, pose.y - stop.y)


def is_outside(deviation_m: float, tolerance_m: float) -> bool:
    """True if a robot so far from its stop is outside the tolerance: the only test of it."""
    return deviation_m > tolerance_m


def error_text(deviation_m: float, tolerance_m: float, turned_rad: float) -> str:
    """Errors outside tolerance in words; empty if there are none. `turned_rad`: see `heading_error`."""
    words = []
    if is_outside(deviation_m, tolerance_m):
        words.append(f"{1000 * deviation_m:.0f} mm from its stop ({1000 * tolerance_m:.0f} mm are tolerated)")
    if turned_rad:
        degrees, limit = math.degrees(turned_rad), math.degrees(HEADING_RAD)
        words.append(f"turned {degrees:.1f}° from its heading ({limit:g}° are tolerated)")
    return " and ".join(words)


def stop_error_text(pose: Pose, stop: Stop, scanner: ScannerSpec) -> str:
    """Errors of a robot at its stop that are outside tolerance, in words; empty if there are none."""
    turned_rad = heading_error(scanner, stop.heading, pose.heading)
    return error_text(deviation(pose, stop), stop.tolerance_m, turned_rad)


class StopErrors:
    """Errors at the stops of a mission that are outside tolerance; without a mission none are known."""

    def __init__(self, mission: Mission | None = None) -> None:
        self._mission = mission
        self.stops: dict[str, Stop] = {} if mission is None else {stop.id: stop for stop in mission.stops}

    def text(self, event: AnyEvent) -> str:
        """Return the errors at a scanned or unconfirmed stop, in words; empty if it is within tolerance."""
        if self._mission is None or not isinstance(event, Scanned | Unconfirmed) or event.pose is None:
            return ""
        stop = self.stops.get(event.stop)
        return "" if stop is None else stop_error_text(event.pose, stop, self._mission.scanner)


def stops_outside(
    events: Iterable[AnyEvent], mission_of: Callable[[str, int], Mission | None]
) -> Iterator[str]:
    """Yield stops scanned or passed outside tolerance, by the mission and revision of each event."""
    known: dict[tuple[str, int], StopErrors] = {}
    for event in events:
        if not isinstance(event, Scanned | Unconfirmed):
            continue
        name = (event.mission_id, event.revision)
        if name not in known:
            known[name] = StopErrors(mission_of(*name))
        if known[name].text(event):
            yield event.stop


def stops_outside_text(outside: Sequence[str], count: int) -> str:
    """Text after a number of done stops; `outside` are the newest of `count` stops outside tolerance."""
    names = ", ".join((*outside[-MOST_NAMED:], *(["…"] if count > min(len(outside), MOST_NAMED) else [])))
    return f" ({count} scanned outside tolerance: {names})" if count else ""
