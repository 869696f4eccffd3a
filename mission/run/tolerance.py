"""How far a robot stands from its stop, and whether that is farther than its mission tolerates."""

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
    """Whether a robot so far from its stop stands elsewhere: the one answer, whoever asks."""
    return deviation_m > tolerance_m


def beside(deviation_m: float, tolerance_m: float) -> str:
    """How far it stands from its stop, in words."""
    return f"{1000 * deviation_m:.0f} mm beside its place ({1000 * tolerance_m:.0f} mm are tolerated)"


def scanned_beside(event: AnyEvent, stop: Stop | None) -> str:
    """That a stop was scanned, or left unconfirmed, from elsewhere, in words; empty if it was not."""
    if not isinstance(event, Scanned | Unconfirmed) or event.pose is None or stop is None:
        return ""
    away = deviation(event.pose, stop)
    return beside(away, stop.tolerance_m) if is_outside(away, stop.tolerance_m) else ""


def stops_outside(
    events: Iterable[AnyEvent], mission_of: Callable[[str, int], Mission | None]
) -> Iterator[str]:
    """Stops that were scanned, or left, from elsewhere, by the mission and revision of each event."""
    known: dict[tuple[str, int], dict[str, Stop]] = {}
    for event in events:
        if not isinstance(event, Scanned | Unconfirmed):
            continue
        name = (event.mission_id, event.revision)
        if name not in known:
            mission = mission_of(*name)
            known[name] = {} if mission is None else {stop.id: stop for stop in mission.stops}
        if scanned_beside(event, known[name].get(event.stop)):
            yield event.stop


def told_outside(outside: Sequence[str], count: int) -> str:
    """What to say behind a number of stops that are done; `outside` are the newest of `count`."""
    names = ", ".join((*outside[-MOST_NAMED:], *(["…"] if count > min(len(outside), MOST_NAMED) else [])))
    return f" ({count} scanned outside tolerance: {names})" if count else ""
