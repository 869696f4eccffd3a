"""Watching of one run: it is displayed, and all its data goes to a recording."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import msgspec

from stopgo.bridge.station.finished_run import past_reports
from stopgo.bridge.station.follow import Followed, Silence
from stopgo.bridge.station.freshness import LATE_S
from stopgo.bridge.station.logged_run import LoggedReport
from stopgo.bridge.station.station import Station
from stopgo.mission.comparing.run_collector import RunSink
from stopgo.mission.comparing.spans import paused_s
from stopgo.mission.console.table import counted, printable
from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.decision import STATES
from stopgo.mission.run.events import (
    AnyEvent,
    Arrived,
    Health,
    Held,
    PoseReport,
    PosesMissing,
    ReportsMissing,
    RevisionDropped,
    RevisionTaken,
    RevisionWaits,
    Scanned,
    StateReport,
    UnknownKind,
)
from stopgo.mission.run.health_text import health_text
from stopgo.mission.run.tolerance import StopErrors, stops_outside_text

UNNUMBERED = PoseReport | Silence | PosesMissing | ReportsMissing | LoggedReport
"""Items that are of no revision."""
REDRAW_S = 0.2
LOST_S = 2.0
"""Time without data after which a line reports it: a state comes every second, and may be late."""
LAST_EVENTS = 8


class RunDisplay(Protocol):
    """Display of a run."""

    def mission(self, mission: Mission) -> None:
        """Take the mission or the revision that follows."""
        ...

    def show(self, report: Followed) -> None:
        """Display one item of the run."""
        ...


def watch_run(station: Station, record: RunSink | None, *, say: Callable[[str], None]) -> StateReport:
    """Follow the run to its end, printed line by line, and return the last state."""
    return watch_with(station, record, EventLines(say))


def watch_with(
    station: Station, record: RunSink | None, display: RunDisplay, *, run_id: str | None = None
) -> StateReport:
    """Follow the run to its end, or replay the finished run `run_id`, and return the last state.

    Raises
    ------
    OutcomeUnknown
        If the run is over and no state was received.
    """
    state: StateReport | None = None
    shown: tuple[str | None, int | None] = (None, None)
    missions: dict[tuple[str, int], Mission] = {}
    past = None
    if run_id is not None:
        past = past_reports(station, run_id, lambda name, revision: missions.get((name, revision)))
    for report in station.reports() if past is None else past:
        revision = _revision_of(report)
        if revision is not None and revision != shown:
            shown = revision
            mission = _fetch_mission(station, report, record, display)
            missions[mission.id, mission.revision] = mission
        if isinstance(report, StateReport):
            state = report
        if record is not None:
            hand_over(record, report)
        display.show(report)
    if state is None:
        raise OutcomeUnknown(f"{station.keys.robot}: the run ended and no state was received")
    return state


def _revision_of(report: Followed) -> tuple[str | None, int | None] | None:
    """Return run and revision of a state or an event; `None` before a run.

    Events name every revision in turn; a state may come after two changes.
    """
    if isinstance(report, UNNUMBERED) or not report.run_id:
        return None
    return report.run_id, report.revision


def _fetch_mission(station: Station, report: Any, record: RunSink | None, display: RunDisplay) -> Mission:
    """Fetch the mission of a run for the display and the recording."""
    mission = station.mission(report.mission_id or "", report.revision or 0)
    display.mission(mission)
    if record is not None:
        record.mission(mission)
    return mission


def hand_over(record: RunSink, report: Followed) -> None:
    """Pass a report to the recording's method for it."""
    if isinstance(report, StateReport):
        record.state(report)
    elif isinstance(report, PoseReport):
        record.pose(report)
    elif isinstance(report, PosesMissing):
        record.missing(report)
    elif isinstance(report, ReportsMissing):
        record.incomplete(report)
    elif isinstance(report, LoggedReport):
        past = report.report
        record.health(past) if isinstance(past, Health) else record.state(past)
    elif not isinstance(report, Silence):
        record.event(report)


class EventLines:
    """Display of one line per event, for a log or a pipe; link loss and its end have a line each."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._errors = StopErrors()
        self._has_state = False
        self._lost_s = 0.0

    def mission(self, mission: Mission) -> None:
        self._errors = StopErrors(mission)
        self._say(f"{mission.name}: {counted(len(mission.stops), 'stop')}")

    def show(self, report: Followed) -> None:
        if isinstance(report, Silence):
            self._take_silence(report.seconds)
            return
        if isinstance(report, ReportsMissing):
            if report.changed:
                self._say(report.words)
            return
        if self._lost_s:
            self._say(f"data again after {self._lost_s:.0f} s")
            self._lost_s = 0.0
        if isinstance(report, StateReport):
            if not self._has_state and report.run_id is None:
                self._say(f"{report.robot} is {report.state}; waiting for a run")
            self._has_state = True
        elif isinstance(report, PosesMissing):
            self._say(missing_line(report))
        elif not isinstance(report, PoseReport | LoggedReport):
            self._say(event_line(report, self._errors))
            if isinstance(report, Held):
                self._say(HINT)

    def _take_silence(self, seconds: float) -> None:
        if seconds >= LOST_S and not self._lost_s:
            self._say(f"no data for {seconds:.0f} s; retrying")
        if seconds >= LOST_S:
            self._lost_s = seconds


class EventObjects:
    """Display of one JSON object per event; `beside` describes errors outside the tolerance."""

    def __init__(self, write: Callable[[dict[str, Any]], None]) -> None:
        self._write = write
        self._errors = StopErrors()

    def mission(self, mission: Mission) -> None:
        """Take the stops of the mission; events and states name the mission themselves."""
        self._errors = StopErrors(mission)

    def show(self, report: Followed) -> None:
        if isinstance(report, PosesMissing):
            self._write({"missing": msgspec.to_builtins(report)})
        elif isinstance(report, ReportsMissing):
            if report.changed:
                state = None if report.state is None else report.state.state
                self._write({"stale": {"topics": report.topics, "state": state, "age_s": report.age_s}})
        elif not isinstance(report, StateReport | PoseReport | Silence | LoggedReport):
            error = self._errors.text(report)
            self._write(msgspec.to_builtins(report) | ({"beside": error} if error else {}))


_REMEDIES = [f"stopgo {verb}" for verb, states in STATES.items() if "HELD" in states]
HINT = f"{'':11} held: the robot waits for {', '.join(_REMEDIES[:-1])} or {_REMEDIES[-1]}"


class RunTable:
    """Display as a table for a terminal, drawn again in place."""

    def __init__(self, write: Callable[[str], object] = sys.stderr.write) -> None:
        self._write = write
        self._mission: Mission | None = None
        self._state: StateReport | None = None
        self._pose: PoseReport | None = None
        self._events: deque[AnyEvent] = deque(maxlen=LAST_EVENTS)
        self._silent_s = 0.0
        self._gaps: ReportsMissing | None = None
        self._missing = ""
        self._height = 0
        """Lines of the table that was drawn last."""
        self._next_s = 0.0

    def mission(self, mission: Mission) -> None:
        self._mission = mission

    def show(self, report: Followed) -> None:
        self._silent_s = report.seconds if isinstance(report, Silence) else 0.0
        if isinstance(report, StateReport):
            self._state = report
        elif isinstance(report, ReportsMissing):
            self._gaps = report if report.topics else None
            self._state = report.state or self._state
        elif isinstance(report, PoseReport):
            self._pose = report
        elif isinstance(report, PosesMissing):
            self._missing = missing_line(report)
        elif not isinstance(report, Silence | LoggedReport):
            self._events.append(report)
        if time.monotonic() >= self._next_s or not isinstance(report, PoseReport):
            self._next_s = time.monotonic() + REDRAW_S
            self._draw()

    def _draw(self) -> None:
        lines = table_lines(
            self._mission, self._state, self._pose, tuple(self._events), self._silent_s, self._gaps
        )
        lines += [self._missing] if self._missing else []
        up = f"\x1b[{self._height}A" if self._height else ""
        self._write(up + "".join(f"\x1b[2K{printable(line)}\n" for line in lines))
        # The table never shrinks: lines of a longer table would stay below.
        self._height = max(self._height, len(lines))


def table_lines(
    mission: Mission | None,
    state: StateReport | None,
    pose: PoseReport | None,
    events: tuple[AnyEvent, ...],
    silent_s: float,
    gaps: ReportsMissing | None = None,
) -> list[str]:
    """Return the lines of a table of the run, of fixed height."""
    told = () if gaps is None else gaps.topics
    if state is None:
        return ["waiting for the robot's state", *told]
    of = f" of {len(mission.stops)}" if mission else ""
    stop = f"{state.stop} {state.stop_state}" if state.stop else "-"
    elapsed = pose.mission_time_s if pose and pose.mission_time_s is not None else 0.0
    left = None if mission is None else remaining_s(mission, state, events, elapsed)
    outside = stops_outside_text(state.outside, state.outside_count)
    rows = [
        ("robot", f"{state.robot}  run {state.run_id or 'none yet'}"),
        ("state", f"{state.state}  {stop}{_age_text(silent_s, gaps)}"),
        ("stops", f"{state.done_count} done{outside}, {state.skipped_count} skipped{of}"),
        ("position", f"{pose.pose.x:.2f}, {pose.pose.y:.2f} m at {pose.speed:.2f} m/s" if pose else "-"),
        ("health", health_text(state)),
        ("time", f"{clock(elapsed)} run, {'-' if left is None else clock(left)} left as planned"),
        ("link", f"no data for {silent_s:.0f} s, retrying" if silent_s else "; ".join(told) or "alive"),
    ]
    errors = StopErrors(mission)
    lines = [event_line(event, errors) for event in events]
    if state.state == "HELD":
        lines = [*lines[1 - LAST_EVENTS :], HINT]
    return [f"  {name:8} {value}" for name, value in rows] + lines + [""] * (LAST_EVENTS - len(lines))


def _age_text(silent_s: float, gaps: ReportsMissing | None) -> str:
    """Return the age of a state that may be older than `LATE_S`; else nothing."""
    age_s = silent_s + (gaps.age_s if gaps is not None and not silent_s else 0.0)
    return f"  ({age_s:.0f} s ago)" if age_s >= LATE_S or gaps is not None else ""


def remaining_s(
    mission: Mission, state: StateReport, events: tuple[AnyEvent, ...], elapsed_s: float
) -> float:
    """Return the planned time left from the current stop on; a pause of the run does not count."""
    plan = schedule(mission)
    ids = [stop.id for stop in mission.stops]
    behind = state.done_count + state.skipped_count if state.stop is None else ids.index(state.stop)
    if behind == 0:
        began_s = 0.0
    else:
        last = mission.stops[behind - 1]
        began_s = plan.arrival_s[behind - 1] + last.settle_s + last.scan.duration_s
    since = max((event.mission_time_s for event in events if isinstance(event, Scanned)), default=0.0)
    worked_s = elapsed_s - since - paused_s(events, since_s=since, until_s=elapsed_s)
    return max(0.0, plan.total_s - began_s - max(0.0, worked_s))


def clock(seconds: float) -> str:
    """Format seconds as hours, minutes and seconds."""
    minutes, rest = divmod(int(max(0.0, seconds)), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def missing_line(gap: PosesMissing) -> str:
    """Return the line that reports missing poses."""
    return f"{gap.mission_time_s:8.1f} s  {gap.words}"


def event_line(event: AnyEvent, errors: StopErrors) -> str:
    """Return the line of an event; `errors` are those at the stops of its mission, as far as it is known."""
    name = type(event).__name__
    about = getattr(event, "stop", None) or ""
    detail = getattr(event, "reason", "") or getattr(event, "commander", "")
    if isinstance(event, RevisionWaits | RevisionDropped):
        detail = f"revision {event.waiting}"
    if isinstance(event, RevisionTaken):
        detail = f"revision {event.revision} after {event.before}"
    if isinstance(event, UnknownKind):
        detail = f"{event.kind}: unknown to this stopgo"
    if isinstance(event, Arrived):
        detail = f"position error {event.deviation_m * 1000:.0f} mm"
    if isinstance(event, Scanned):
        detail = f"{event.file}, {event.points / 1e6:.1f} million points"
    detail = "; ".join(word for word in (errors.text(event), detail) if word)
    return f"{event.mission_time_s:8.1f} s  {name:15} {about:6} {detail}".rstrip()
