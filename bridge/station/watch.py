"""Watches one run: shows it to a person, and hands everything to a recording."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import msgspec

from stopgo.bridge.station.finished_run import past_reports
from stopgo.bridge.station.follow import Followed, Silence
from stopgo.bridge.station.logged_run import LoggedReport
from stopgo.bridge.station.station import Station
from stopgo.mission.comparing.run_collector import RunSink
from stopgo.mission.comparing.spans import stood_s
from stopgo.mission.console.table import printable
from stopgo.mission.document import Mission, Stop
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
    RevisionDropped,
    RevisionTaken,
    RevisionWaits,
    Scanned,
    StateReport,
    UnknownKind,
)
from stopgo.mission.run.tolerance import scanned_beside, told_outside

REDRAW_S = 0.2
LOST_S = 3.0
"""After so long without a word a line says so: a state comes every second, and may be late."""
LAST_EVENTS = 8


class RunDisplay(Protocol):
    """How a person sees the run."""

    def mission(self, mission: Mission) -> None: ...

    def show(self, report: Followed) -> None: ...


def watch_run(station: Station, record: RunSink | None, *, say: Callable[[str], None]) -> StateReport:
    """Follow the run to its end, told line by line, and return the last state."""
    return watch_with(station, record, EventLines(say))


def watch_with(
    station: Station, record: RunSink | None, display: RunDisplay, *, run_id: str | None = None
) -> StateReport:
    """Follow the run to its end, or tell one that is over once more, and return the last state.

    Raises
    ------
    OutcomeUnknown
        If the run is over and the robot's last state was never heard.
    """
    state: StateReport | None = None
    known: tuple[str | None, int | None] = (None, None)
    missions: dict[tuple[str, int], Mission] = {}
    past = None if run_id is None else past_reports(station, run_id, lambda *name: missions.get(name))
    for report in station.reports() if past is None else past:
        plan = _plan_of(report)
        if plan is not None and plan != known:
            known = plan
            mission = _introduced(station, report, record, display)
            missions[mission.id, mission.revision] = mission
        if isinstance(report, StateReport):
            state = report
        if record is not None:
            hand_over(record, report)
        display.show(report)
    if state is None:
        raise OutcomeUnknown(f"{station.keys.robot}: the run ended and no state was heard")
    return state


def _plan_of(report: Followed) -> tuple[str | None, int | None] | None:
    """Run and revision that a state or an event is of; none before a run.

    Events tell of every revision in turn; a state may come when two have passed.
    """
    if isinstance(report, PoseReport | Silence | PosesMissing | LoggedReport) or not report.run_id:
        return None
    return report.run_id, report.revision


def _introduced(station: Station, report: Any, record: RunSink | None, display: RunDisplay) -> Mission:
    """Fetch the mission that is run, so that it can be drawn and counted down."""
    mission = station.mission(report.mission_id or "", report.revision or 0)
    display.mission(mission)
    if record is not None:
        record.mission(mission)
    return mission


def hand_over(record: RunSink, report: Followed) -> None:
    """Give a report to the recording's method for it."""
    if isinstance(report, StateReport):
        record.state(report)
    elif isinstance(report, PoseReport):
        record.pose(report)
    elif isinstance(report, PosesMissing):
        record.missing(report)
    elif isinstance(report, LoggedReport):
        past = report.report
        record.health(past) if isinstance(past, Health) else record.state(past)
    elif not isinstance(report, Silence):
        record.event(report)


class EventLines:
    """One line for every event, for a log or a pipe; one when the link is lost, and one when it is back."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._stops: Mapping[str, Stop] = {}
        self._greeted = False
        self._lost_s = 0.0

    def mission(self, mission: Mission) -> None:
        self._stops = {stop.id: stop for stop in mission.stops}
        self._say(f"{mission.name}: {len(mission.stops)} stops")

    def show(self, report: Followed) -> None:
        if isinstance(report, Silence):
            self._silent(report.seconds)
            return
        if self._lost_s:
            self._say(f"heard again after {self._lost_s:.0f} s")
            self._lost_s = 0.0
        if isinstance(report, StateReport):
            if not self._greeted and report.run_id is None:
                self._say(f"{report.robot} is {report.state}; waiting for a run")
            self._greeted = True
        elif isinstance(report, PosesMissing):
            self._say(missing_line(report))
        elif not isinstance(report, PoseReport | LoggedReport):
            self._say(event_line(report, self._stops))
            if isinstance(report, Held):
                self._say(HINT)

    def _silent(self, seconds: float) -> None:
        if seconds >= LOST_S and not self._lost_s:
            self._say(f"no word for {seconds:.0f} s; asking until it is heard again")
        if seconds >= LOST_S:
            self._lost_s = seconds


class EventObjects:
    """One JSON object for every event; with `beside`, in words, where a stop was scanned from elsewhere."""

    def __init__(self, write: Callable[[dict[str, Any]], None]) -> None:
        self._write = write
        self._stops: Mapping[str, Stop] = {}

    def mission(self, mission: Mission) -> None:
        """Its stops; events and the state name themselves the mission they are of."""
        self._stops = {stop.id: stop for stop in mission.stops}

    def show(self, report: Followed) -> None:
        if isinstance(report, PosesMissing):
            self._write({"missing": msgspec.to_builtins(report)})
        elif not isinstance(report, StateReport | PoseReport | Silence | LoggedReport):
            beside = scanned_beside(report, self._stops.get(getattr(report, "stop", "")))
            self._write(msgspec.to_builtins(report) | ({"beside": beside} if beside else {}))


_WAITED_FOR = [f"stopgo {verb}" for verb, places in STATES.items() if "HELD" in places]
HINT = f"{'':11} held: the robot waits for {', '.join(_WAITED_FOR[:-1])} or {_WAITED_FOR[-1]}"


class RunTable:
    """A table that is drawn anew in place, for a terminal."""

    def __init__(self, write: Callable[[str], object] = sys.stderr.write) -> None:
        self._write = write
        self._mission: Mission | None = None
        self._state: StateReport | None = None
        self._pose: PoseReport | None = None
        self._events: deque[AnyEvent] = deque(maxlen=LAST_EVENTS)
        self._silent_s = 0.0
        self._missing = ""
        self._drawn = 0
        self._next = 0.0

    def mission(self, mission: Mission) -> None:
        self._mission = mission

    def show(self, report: Followed) -> None:
        self._silent_s = report.seconds if isinstance(report, Silence) else 0.0
        if isinstance(report, StateReport):
            self._state = report
        elif isinstance(report, PoseReport):
            self._pose = report
        elif isinstance(report, PosesMissing):
            self._missing = missing_line(report)
        elif not isinstance(report, Silence | LoggedReport):
            self._events.append(report)
        if time.monotonic() >= self._next or not isinstance(report, PoseReport):
            self._next = time.monotonic() + REDRAW_S
            self._draw()

    def _draw(self) -> None:
        lines = table_lines(self._mission, self._state, self._pose, tuple(self._events), self._silent_s)
        lines += [self._missing] if self._missing else []
        up = f"\x1b[{self._drawn}A" if self._drawn else ""
        self._write(up + "".join(f"\x1b[2K{printable(line)}\n" for line in lines))
        # Lines of a longer table drawn before would stay below: the table never shrinks.
        self._drawn = max(self._drawn, len(lines))


def table_lines(
    mission: Mission | None,
    state: StateReport | None,
    pose: PoseReport | None,
    events: tuple[AnyEvent, ...],
    silent_s: float,
) -> list[str]:
    """The run as a table of fixed height."""
    if state is None:
        return ["waiting for the robot's state"]
    of = f" of {len(mission.stops)}" if mission else ""
    stop = f"{state.stop} {state.stop_state}" if state.stop else "-"
    elapsed = pose.mission_time_s if pose and pose.mission_time_s is not None else 0.0
    left = None if mission is None else remaining_s(mission, state, events, elapsed)
    outside = told_outside(state.outside, state.outside_count)
    rows = [
        ("robot", f"{state.robot}  run {state.run_id or 'none yet'}"),
        ("state", f"{state.state}  {stop}"),
        ("stops", f"{state.done_count} done{outside}, {state.skipped_count} skipped{of}"),
        ("place", f"{pose.pose.x:.2f}, {pose.pose.y:.2f} m at {pose.speed:.2f} m/s" if pose else "-"),
        ("battery", f"{state.battery:.0%}"),
        ("time", f"{clock(elapsed)} run, {'-' if left is None else clock(left)} left as planned"),
        ("link", "no word for " + f"{silent_s:.0f} s, asking" if silent_s else "alive"),
    ]
    stops = {} if mission is None else {stop.id: stop for stop in mission.stops}
    told = [event_line(event, stops) for event in events]
    if state.state == "HELD":
        told = [*told[1 - LAST_EVENTS :], HINT]
    return [f"  {name:8} {value}" for name, value in rows] + told + [""] * (LAST_EVENTS - len(told))


def remaining_s(
    mission: Mission, state: StateReport, events: tuple[AnyEvent, ...], elapsed_s: float
) -> float:
    """Seconds left if all goes as planned from the stop that is worked on, however long the run stands."""
    plan = schedule(mission)
    ids = [stop.id for stop in mission.stops]
    behind = state.done_count + state.skipped_count if state.stop is None else ids.index(state.stop)
    if behind == 0:
        begun = 0.0
    else:
        last = mission.stops[behind - 1]
        begun = float(plan.arrival_s[behind - 1]) + last.settle_s + last.scan.duration_s
    since = max((event.mission_time_s for event in events if isinstance(event, Scanned)), default=0.0)
    worked = elapsed_s - since - stood_s(events, since_s=since, until_s=elapsed_s)
    return max(0.0, plan.total_s - begun - max(0.0, worked))


def clock(seconds: float) -> str:
    """Seconds as hours, minutes and seconds."""
    minutes, rest = divmod(int(max(0.0, seconds)), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def missing_line(gap: PosesMissing) -> str:
    """That poses are missing, as one line."""
    return f"{gap.mission_time_s:8.1f} s  {gap.words}"


def event_line(event: AnyEvent, stops: Mapping[str, Stop]) -> str:
    """An event as one line a person reads, beside the stops of its mission as far as they are known."""
    name = type(event).__name__
    about = getattr(event, "stop", None) or ""
    detail = getattr(event, "reason", "") or getattr(event, "commander", "")
    if isinstance(event, RevisionWaits | RevisionDropped):
        detail = f"revision {event.waiting}"
    if isinstance(event, RevisionTaken):
        detail = f"revision {event.revision} after {event.before}"
    if isinstance(event, UnknownKind):
        detail = f"{event.kind}: this stopgo does not know it"
    if isinstance(event, Arrived):
        detail = f"{event.deviation_m * 1000:.0f} mm beside"
    if isinstance(event, Scanned):
        detail = f"{event.file}, {event.points / 1e6:.1f} million points"
    detail = "; ".join(word for word in (scanned_beside(event, stops.get(about)), detail) if word)
    return f"{event.mission_time_s:8.1f} s  {name:15} {about:6} {detail}".rstrip()
