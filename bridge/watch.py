"""Watches one run: tells it line by line, and hands everything to a recording."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from bridge.follow import Report, Silence
from bridge.station import Station
from mission.document import Mission
from mission.errors import OutcomeUnknown
from mission.events import AnyEvent, Arrived, PoseReport, Scanned, StateReport


class Recording(Protocol):
    """What a recording of a run takes; the field recording in `recordings` is one."""

    def mission(self, mission: Mission) -> None: ...

    def state(self, report: StateReport) -> None: ...

    def pose(self, report: PoseReport) -> None: ...

    def event(self, event: AnyEvent) -> None: ...


def watch_run(station: Station, record: Any, *, say: Callable[[str], None]) -> StateReport:
    """Follow the run to its end and return the last state; `record` may be no recording at all."""
    recording: Recording | None = record if hasattr(record, "event") else None
    state: StateReport | None = None
    for report in station.reports():
        if isinstance(report, StateReport):
            if state is None and report.run_id is None:
                say(f"{report.robot} is {report.state}; waiting for a run")
            if recording and report.run_id and (state is None or state.run_id != report.run_id):
                recording.mission(station.mission(report.mission_id or "", report.revision or 0))
            state = report
        _record(recording, report)
        _tell(report, say)
    if state is None:
        raise OutcomeUnknown(f"{station.keys.robot}: the run ended and no state was heard")
    return state


def _record(recording: Recording | None, report: Report) -> None:
    if recording is None or isinstance(report, Silence):
        return
    if isinstance(report, StateReport):
        recording.state(report)
    elif isinstance(report, PoseReport):
        recording.pose(report)
    else:
        recording.event(report)


def _tell(report: Report, say: Callable[[str], None]) -> None:
    if isinstance(report, Silence):
        say(f"no word for {report.seconds:.0f} s")
    elif not isinstance(report, StateReport | PoseReport):
        say(event_line(report))


def event_line(event: AnyEvent) -> str:
    """An event as one line a person reads."""
    name = type(event).__name__
    about = getattr(event, "stop", None) or ""
    detail = getattr(event, "reason", "")
    if isinstance(event, Arrived):
        detail = f"{event.deviation_m * 1000:.0f} mm beside"
    if isinstance(event, Scanned):
        detail = f"{event.file}, {event.points / 1e6:.1f} million points"
    return f"{event.mission_time_s:8.1f} s  {name:9} {about:6} {detail}".rstrip()
