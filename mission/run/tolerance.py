"""A robot's position error at its stop, and the one test against the mission's tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.events import AnyEvent, Pose, Scanned, Unconfirmed

MOST_NAMED = 6


def deviation(pose: Pose, stop: Stop) -> float:
    """Metres from the stop."""
    return math.hypot(pose.x - stop.x, pose.y - stop.y)


def is_outside(deviation_m: float, tolerance_m: float) -> bool:
    """True if a robot so far from its stop is outside the tolerance: the only test of it."""
    return deviation_m > tolerance_m


def position_error_text(deviation_m: float, tolerance_m: float) -> str:
    """Position error in words."""
    return f"{1000 * deviation_m:.0f} mm from its stop ({1000 * tolerance_m:.0f} mm are tolerated)"


def outside_tolerance_text(event: AnyEvent, stop: Stop | None) -> str:
    """Position error of a scanned or unconfirmed stop outside its tolerance, in words; empty if within."""
    if not isinstance(event, Scanned | Unconfirmed) or event.pose is None or stop is None:
        return ""
    away = deviation(event.pose, stop)
    return position_error_text(away, stop.tolerance_m) if is_outside(away, stop.tolerance_m) else ""


def stops_outside(
    events: Iterable[AnyEvent], mission_of: Callable[[str, int], Mission | None]
) -> Iterator[str]:
    """Yield stops scanned or passed outside tolerance, by the mission and revision of each event."""
    known: dict[tuple[str, int], dict[str, Stop]] = {}
    for event in events:
        if not isinstance(event, Scanned | Unconfirmed):
            continue
        name = (event.mission_id, event.revision)
        if name not in known:
            mission = mission_of(*name)
            known[name] = {} if mission is None else {stop.id: stop for stop in mission.stops}
        if outside_tolerance_text(event, known[name].get(event.stop)):
            yield event.stop


def stops_outside_text(outside: Sequence[str], count: int) -> str:
    """Text after a number of done stops; `outside` are the newest of `count` stops outside tolerance."""
    names = ", ".join((*outside[-MOST_NAMED:], *(["…"] if count > min(len(outside), MOST_NAMED) else [])))
    return f" ({count} scanned outside tolerance: {names})" if count else ""
