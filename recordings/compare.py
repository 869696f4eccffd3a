"""Sets a run's events beside the mission's plan, stop by stop."""

from __future__ import annotations

import math
from collections.abc import Iterable

from mission.comparison import Comparison, StopComparison
from mission.document import Mission, Stop
from mission.events import Aborted, AnyEvent, Arrived, Failed, Finished, Scanned, Skipped
from mission.schedule import schedule


def compare(mission: Mission, events: Iterable[AnyEvent]) -> Comparison:
    """Compare the run that `events` are of with the mission's schedule and stops."""
    told = sorted(events, key=lambda event: event.number)
    planned = schedule(mission)
    ends = [event.mission_time_s for event in told if isinstance(event, Finished | Aborted)]
    return Comparison(
        mission=mission,
        run_id=told[0].run_id if told else None,
        stops=tuple(
            _stop(stop, float(arrival), told)
            for stop, arrival in zip(mission.stops, planned.arrival_s, strict=True)
        ),
        planned_s=planned.total_s,
        driven_s=ends[-1] if ends else None,
    )


def _stop(stop: Stop, planned_s: float, events: list[AnyEvent]) -> StopComparison:
    mine = [event for event in events if getattr(event, "stop", None) == stop.id]
    arrivals = [event for event in mine if isinstance(event, Arrived)]
    scans = [event for event in mine if isinstance(event, Scanned)]
    where = (scans or arrivals)[-1].pose if scans or arrivals else None
    return StopComparison(
        stop=stop.id,
        planned_s=planned_s,
        driven_s=arrivals[-1].mission_time_s if arrivals else None,
        deviation_m=None if where is None else math.hypot(where.x - stop.x, where.y - stop.y),
        outcome=_outcome(mine),
    )


def _outcome(events: list[AnyEvent]) -> str:
    words = {Scanned: "scanned", Skipped: "skipped", Failed: "failed"}
    last = [words[type(event)] for event in events if type(event) in words]
    return last[-1] if last else "not reached"


def comparison_table(comparison: Comparison) -> str:
    """The comparison as a table a person reads: times in seconds, deviations in millimetres."""
    rows: list[tuple[str, ...]] = [("stop", "outcome", "planned s", "driven s", "late s", "deviation mm")]
    for item in comparison.stops:
        late = None if item.driven_s is None else item.driven_s - item.planned_s
        away = None if item.deviation_m is None else 1000 * item.deviation_m
        numbers = (_number(n) for n in (item.planned_s, item.driven_s, late, away))
        rows.append((item.stop, item.outcome, *numbers))
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
