"""Markdown report inside a field recording: the outcome of each stop of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Arrived,
    Failed,
    Finished,
    Scanned,
    Skipped,
    Unconfirmed,
)
from stopgo.mission.run.tolerance import deviation


@dataclass(frozen=True)
class StopRecord:
    """State of one stop of a run."""

    arrived_s: float | None = None
    deviation_m: float | None = None
    outcome: str = "driving there"
    """`arrived`, `scanned`, `unconfirmed`, `skipped` or `failed`, with the reason."""
    scanned: bool = False

    def after(self, event: AnyEvent, stop: Stop | None, error: str) -> StopRecord:
        """Return the record after an event at the stop; `error` is what is outside tolerance, in words."""
        if isinstance(event, Arrived):
            return replace(
                self, arrived_s=event.mission_time_s, deviation_m=event.deviation_m, outcome="arrived"
            )
        if isinstance(event, Scanned):
            deviation_m = self.deviation_m if stop is None else deviation(event.pose, stop)
            outcome = f"scanned {error}".rstrip()
            return replace(self, deviation_m=deviation_m, outcome=outcome, scanned=True)
        if isinstance(event, Unconfirmed | Skipped | Failed):
            details = (error, event.reason)
            words = "; ".join(word for word in details if word)
            return replace(self, outcome=f"{type(event).__name__.lower()}: {words}", scanned=False)
        return self


def run_report(
    revisions: Sequence[Mission],
    run_id: str,
    records: dict[str, StopRecord],
    latest: AnyEvent,
    coverage: str = "",
) -> str:
    """Return the run so far as markdown; the run follows the last of the mission's revisions.

    `coverage` describes the acquired coverage, if it is known.
    """
    mission = revisions[-1]
    scanned = sum(record.scanned for record in records.values())
    lines = [
        f"# Run {run_id}",
        "",
        f"Mission **{mission.name}**, revision {_numbers(revisions)}, robot {latest.robot}",
        "",
        f"{scanned} of {len(mission.stops)} stops scanned after {latest.mission_time_s:.1f} s"
        f" (last event: {type(latest).__name__})",
        *(["", coverage] if coverage else []),
        "",
        "| stop | arrived s | deviation mm | outcome |",
        "|---|---|---|---|",
    ]
    rows = [_row(stop, records.get(stop)) for stop in _listed(mission, latest)]
    rows += [f"| {stop} | | | withdrawn by revision {by} |" for stop, by in _withdrawn(revisions).items()]
    rest = len(mission.stops) - MOST_STOPS
    note = ["", f"*{rest} other stops are listed when the run is over.*"]
    return "\n".join([*lines, *rows, *(note if len(rows) < len(mission.stops) else [])])


MOST_STOPS = 60
"""Limit of stops listed during a run: with more, a report for each event would fill the disk."""


def _listed(mission: Mission, latest: AnyEvent) -> list[str]:
    """Return all stops once the run is over; before that, those around the stop of the last report."""
    ids = [stop.id for stop in mission.stops]
    if len(ids) <= MOST_STOPS or isinstance(latest, Finished | Aborted):
        return ids
    last = getattr(latest, "stop", None)
    middle = ids.index(last) if last in ids else 0
    first = max(0, min(middle - MOST_STOPS // 2, len(ids) - MOST_STOPS))
    return ids[first : first + MOST_STOPS]


def _numbers(revisions: Sequence[Mission]) -> str:
    """Return the current revision, and those before it."""
    before = ", ".join(str(mission.revision) for mission in revisions[:-1])
    return f"{revisions[-1].revision}" + (f" (before: {before})" if before else "")


def _withdrawn(revisions: Sequence[Mission]) -> dict[str, int]:
    """Return stops that the last revision does not have, and the revision that withdrew each."""
    withdrawn: dict[str, int] = {}
    for before, after in pairwise(revisions):
        ids = {stop.id for stop in after.stops}
        withdrawn.update({stop.id: after.revision for stop in before.stops if stop.id not in ids})
    return {stop: by for stop, by in withdrawn.items() if stop not in {s.id for s in revisions[-1].stops}}


def _row(stop: str, record: StopRecord | None) -> str:
    if record is None:
        return f"| {stop} | | | not reached |"
    arrived = "" if record.arrived_s is None else f"{record.arrived_s:.1f}"
    deviation = "" if record.deviation_m is None else f"{record.deviation_m * 1000:.1f}"
    return f"| {stop} | {arrived} | {deviation} | {record.outcome} |"
