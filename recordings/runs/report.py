"""A run in words: what became of each stop, as the markdown report inside a field recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mission.document import Mission
from mission.events import AnyEvent, Arrived, Failed, Scanned, Skipped


@dataclass(frozen=True)
class StopRecord:
    """What is known of one stop of a run."""

    arrived_s: float | None = None
    deviation_m: float | None = None
    outcome: str = "on the way"
    """`arrived`, `scanned`, `skipped` or `failed`, with the reason."""

    def after(self, event: AnyEvent) -> StopRecord:
        """The record once the event has happened."""
        if isinstance(event, Arrived):
            return replace(
                self, arrived_s=event.mission_time_s, deviation_m=event.deviation_m, outcome="arrived"
            )
        if isinstance(event, Scanned):
            return replace(self, outcome="scanned")
        if isinstance(event, Skipped | Failed):
            return replace(self, outcome=f"{type(event).__name__.lower()}: {event.reason}")
        return self


def run_report(mission: Mission, run_id: str, records: dict[str, StopRecord], latest: AnyEvent) -> str:
    """The run so far in markdown."""
    scanned = sum(record.outcome == "scanned" for record in records.values())
    lines = [
        f"# Run {run_id}",
        "",
        f"Mission **{mission.name}**, revision {mission.revision}, robot {latest.robot}",
        "",
        f"{scanned} of {len(mission.stops)} stops scanned after {latest.mission_time_s:.1f} s"
        f" (last event: {type(latest).__name__})",
        "",
        "| stop | arrived s | deviation mm | outcome |",
        "|---|---|---|---|",
    ]
    lines += [_row(stop.id, records.get(stop.id)) for stop in mission.stops]
    return "\n".join(lines)


def _row(stop: str, record: StopRecord | None) -> str:
    if record is None:
        return f"| {stop} | | | not reached |"
    arrived = "" if record.arrived_s is None else f"{record.arrived_s:.1f}"
    deviation = "" if record.deviation_m is None else f"{record.deviation_m * 1000:.1f}"
    return f"| {stop} | {arrived} | {deviation} | {record.outcome} |"
