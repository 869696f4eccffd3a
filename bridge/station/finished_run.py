"""Replay of a finished run: events from the robot's journal, poses from its telemetry log."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.station.follow import Followed
from stopgo.bridge.station.logged_run import LoggedReport, read_index, read_run
from stopgo.bridge.station.station import Station
from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import (
    UNKNOWN_CHARGE,
    Aborted,
    AnyEvent,
    Finished,
    Scanned,
    Skipped,
    StateReport,
    Unconfirmed,
)
from stopgo.mission.run.tolerance import stops_outside


def past_reports(
    station: Station, run_id: str, mission_of: Callable[[str, int], Mission | None]
) -> Iterator[Followed]:
    """Yield events, poses and states of a finished run in the order of their times; last its final state.

    `mission_of` returns a mission and revision after the first event of that revision was yielded.

    Raises
    ------
    NegativeResult
        If the robot has no such run, or it is not finished.
    OutcomeUnknown
        If the robot stopped answering.
    """
    robot, recorded = station.keys.robot, RECORD in station.info().capabilities
    events = station.log(run_id=run_id)
    if not events:
        raise NegativeResult(
            f"{robot}: no run {run_id}; its runs are {_runs(station) if recorded else 'others'}"
        )
    end = events[-1]
    if not isinstance(end, Finished | Aborted):
        raise NegativeResult(f"run {run_id} of {robot}: not finished; follow it without --run")
    pending, battery = list(events), UNKNOWN_CHARGE
    entries = read_run(station.link, station.keys, run_id, patience_s=station.patience_s) if recorded else ()
    for item in entries:
        if isinstance(item, LoggedReport):
            battery = item.report.battery
        else:
            while pending and pending[0].robot_ns <= item.robot_ns:
                yield pending.pop(0)
        yield item
    yield from pending
    yield _final_state(events, end, battery, tuple(stops_outside(events, mission_of)))


def _runs(station: Station) -> str:
    index = read_index(station.link, station.keys, timeout_s=station.timeout_s)
    run_ids = () if index is None else tuple(run.run_id for run in index.runs)
    return ", ".join(run_ids) or "none"


def _final_state(
    events: tuple[AnyEvent, ...], end: Finished | Aborted, battery: float, outside: tuple[str, ...]
) -> StateReport:
    done = tuple(event.stop for event in events if isinstance(event, Scanned | Unconfirmed))
    skipped = tuple(event.stop for event in events if isinstance(event, Skipped))
    return StateReport(
        robot=end.robot, boot_id=end.boot_id, seq=0, robot_ns=end.robot_ns,
        state="FINISHED" if isinstance(end, Finished) else "ABORTED",
        run_id=end.run_id, mission_id=end.mission_id, revision=end.revision, stop=None, stop_state=None,
        done=done, skipped=skipped, battery=battery, last_event=end.number,
        done_count=len(done), skipped_count=len(skipped), outside=outside, outside_count=len(outside),
    )  # fmt: skip
