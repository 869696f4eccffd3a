"""Sets a run's events beside the mission's plan, stop by stop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from mission.comparison import Comparison, StopComparison
from mission.document import Mission, Stop
from mission.events import (
    Aborted,
    AnyEvent,
    Arrived,
    Failed,
    Finished,
    Pose,
    Scanned,
    Settled,
    Skipped,
    Unconfirmed,
)
from mission.schedule import schedule


def compare(mission: Mission, events: Iterable[AnyEvent], *, earlier: Sequence[Mission] = ()) -> Comparison:
    """Compare the run that `events` are of with the mission's schedule and stops.

    Where the mission was revised during the run, `mission` is the revision followed last and `earlier`
    are those before it: each stop is compared with the revision by which it was reached. Stops that a
    revision withdrew come last, and then stops that only the run tells of.
    """
    told = sorted(events, key=lambda event: event.number)
    plans = [_Planned(item) for item in (*earlier, mission)]
    ends = [event.mission_time_s for event in told if isinstance(event, Finished | Aborted)]
    visited = [event.stop for event in told if isinstance(event, VISITS)]
    ids = dict.fromkeys([*plans[-1].stops, *(stop for plan in plans for stop in plan.stops), *visited])
    return Comparison(
        mission=mission,
        run_id=told[0].run_id if told else None,
        stops=tuple(_stop(stop, plans, told) for stop in ids),
        planned_s=schedule(mission).total_s,
        driven_s=ends[-1] if ends else None,
    )


VISITS = (Arrived, Settled, Scanned, Unconfirmed, Skipped, Failed)
"""Events at a stop."""


class _Planned:
    """One revision's stops, and when it plans to arrive there."""

    def __init__(self, mission: Mission) -> None:
        self.revision = mission.revision
        self.stops = {stop.id: stop for stop in mission.stops}
        arrivals = schedule(mission).arrival_s.tolist()
        self.arrival_s = {stop.id: s for stop, s in zip(mission.stops, arrivals, strict=True)}


def _stop(stop: str, plans: list[_Planned], events: list[AnyEvent]) -> StopComparison:
    mine = [event for event in events if isinstance(event, VISITS) and event.stop == stop]
    arrivals = [event for event in mine if isinstance(event, Arrived)]
    scans = [event for event in mine if isinstance(event, Scanned)]
    where = (scans or arrivals)[-1].pose if scans or arrivals else None
    plan = _followed(stop, plans, mine[-1].revision if mine else None)
    place = None if plan is None else plan.stops[stop]
    return StopComparison(
        stop=stop,
        planned_s=None if plan is None else plan.arrival_s[stop],
        driven_s=arrivals[-1].mission_time_s if arrivals else None,
        deviation_m=None if where is None or place is None else math.dist(_xy(where), _xy(place)),
        outcome=_outcome(mine) if mine or stop in plans[-1].stops else "withdrawn",
    )


def _followed(stop: str, plans: list[_Planned], revision: int | None) -> _Planned | None:
    """The plan by which a stop was reached, else the last one that has it."""
    having = [plan for plan in plans if stop in plan.stops]
    found = [plan for plan in having if plan.revision == revision] or having
    return found[-1] if found else None


def _xy(place: Pose | Stop) -> tuple[float, float]:
    return (place.x, place.y)


def _outcome(events: Sequence[AnyEvent]) -> str:
    words = {Scanned: "scanned", Unconfirmed: "unconfirmed", Skipped: "skipped", Failed: "failed"}
    last = [words[type(event)] for event in events if type(event) in words]
    return last[-1] if last else "not reached"


def comparison_table(comparison: Comparison) -> str:
    """The comparison as a table a person reads: times in seconds, deviations in millimetres."""
    rows: list[tuple[str, ...]] = [("stop", "outcome", "planned s", "driven s", "late s", "deviation mm")]
    for item in comparison.stops:
        late = _less(item.driven_s, item.planned_s)
        away = None if item.deviation_m is None else 1000 * item.deviation_m
        numbers = (_number(n) for n in (item.planned_s, item.driven_s, late, away))
        rows.append((item.stop, item.outcome, *numbers))
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows
    )


def _less(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
