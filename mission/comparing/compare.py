"""A run and its mission -> their comparison, stop by stop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.acquiring import acquired_by
from stopgo.mission.comparing.blocked_stops import held_reasons
from stopgo.mission.comparing.comparison import Comparison, StopComparison
from stopgo.mission.comparing.evidence import disputed_m, missing_events
from stopgo.mission.comparing.path_deviation import cross_track_of
from stopgo.mission.comparing.sighting import sighted_path
from stopgo.mission.comparing.spans import spans_of
from stopgo.mission.document import Mission, ScannerSpec, Stop
from stopgo.mission.document.schedule import schedule
from stopgo.mission.run.events import (
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
from stopgo.mission.run.run_log import RunLog
from stopgo.mission.run.scans import heading_error
from stopgo.mission.run.tolerance import deviation
from stopgo.mission.stages.sight import Sight

VISITS = (Arrived, Settled, Scanned, Unconfirmed, Skipped, Failed)
"""Events at a stop."""
OUTCOMES: dict[type[object], str] = {
    Scanned: "scanned",
    Unconfirmed: "unconfirmed",
    Skipped: "skipped",
    Failed: "failed",
}


def compare(
    log: RunLog, missions: Sequence[Mission], sights: Iterable[Sight] = (), *, headings: bool = True
) -> Comparison:
    """Compare a run with the schedule, stops, legs and sight of its mission.

    Parameters
    ----------
    log
        The run, in the mission's frame.
    The mission's revisions in ascending order. Of those that the run followed, the last one counts, and
    each stop is compared with the revision by which it was reached. Stops that a revision withdrew come
    last, and after them stops that only the run contains.
    sights
        Visibility data of stops, of any revisions.
    headings
        True if the poses have headings that were measured.
    """
    followed = _followed(log, missions)
    plans = [_Planned(item, headings=headings) for item in followed]
    visited = [event.stop for event in log.events if isinstance(event, VISITS)]
    ids = dict.fromkeys([*plans[-1].stops, *(stop for plan in plans for stop in plan.stops), *visited])
    held = held_reasons(log, [stop.id for stop in followed[-1].stops])
    conclusive = log.ended and not missing_events(log)
    stops = [_stop(stop, plans, log, held.get(stop, ""), conclusive=conclusive) for stop in ids]
    acquired = acquired_by(stops, followed, sights)
    cross_track = cross_track_of(log, followed)
    return Comparison(
        missions=followed,
        log=log,
        stops=tuple(replace(item, lost=_lost(item, acquired, log.ended)) for item in stops),
        spans=spans_of(log),
        cross_track=cross_track,
        sighted=sighted_path(log, followed[0], cross_track),
        planned_s=schedule(followed[-1]).total_s,
        driven_s=_end_s(log),
        acquired=acquired,
    )


def _followed(log: RunLog, missions: Sequence[Mission]) -> tuple[Mission, ...]:
    """Return the revisions that the run followed; all, if its events name none of them."""
    found = tuple(mission for mission in missions if mission.revision in log.revisions)
    return found or tuple(missions)


def _end_s(log: RunLog) -> float | None:
    ends = [event.mission_time_s for event in log.events if isinstance(event, Finished | Aborted)]
    return ends[-1] if ends else None


def _lost(item: StopComparison, acquired: Acquired | None, ended: bool) -> float | None:
    """Return the loss by a stop's missing scan; None while the run may still go there."""
    final = item.outcome in ("skipped", "failed") or ended
    return acquired.lost.get(item.stop) if final and acquired is not None else None


class _Planned:
    """Stops of one revision, with planned arrivals; the scanner, if poses have measured headings."""

    def __init__(self, mission: Mission, *, headings: bool) -> None:
        self.revision = mission.revision
        self.scanner = mission.scanner if headings else None
        self.stops = {stop.id: stop for stop in mission.stops}
        arrivals = schedule(mission).arrival_s
        self.arrival_s = {stop.id: s for stop, s in zip(mission.stops, arrivals, strict=True)}


def _stop(stop: str, plans: list[_Planned], log: RunLog, held: str, *, conclusive: bool) -> StopComparison:
    mine = [event for event in log.events if isinstance(event, VISITS) and event.stop == stop]
    arrivals = [event for event in mine if isinstance(event, Arrived)]
    ends = [event for event in mine if isinstance(event, Scanned | Unconfirmed)]
    plan = _reached_by(stop, plans, mine[-1].revision if mine else None)
    outcome = _outcome(mine) if mine or stop in plans[-1].stops else "withdrawn"
    item = StopComparison(
        stop=stop,
        planned_s=None if plan is None else plan.arrival_s[stop],
        arrived_s=arrivals[0].mission_time_s if arrivals else None,
        settle_s=_settling_s(mine),
        tries=_tries(mine),
        outcome=outcome,
        reason="; ".join(dict.fromkeys(why for why in (held, _reason(mine)) if why)),
        disputed_m=None if plan is None else disputed_m(plan.stops[stop], mine, log),
        is_open=outcome in ("arrived", "failed", "not reached") and not conclusive,
    )
    pose = next((event.pose for event in reversed([*arrivals, *ends]) if event.pose is not None), None)
    return item if plan is None or pose is None else _with_offset(item, pose, plan.stops[stop], plan.scanner)


def _reached_by(stop: str, plans: list[_Planned], revision: int | None) -> _Planned | None:
    """Return the plan by which a stop was reached, else the last one that has it."""
    having = [plan for plan in plans if stop in plan.stops]
    found = [plan for plan in having if plan.revision == revision] or having
    return found[-1] if found else None


def _with_offset(item: StopComparison, pose: Pose, stop: Stop, scanner: ScannerSpec | None) -> StopComparison:
    """Add the offset of a pose from the stop; without a scanner the pose has no measured heading."""
    x, y, ahead = pose.x - stop.x, pose.y - stop.y, arrival_direction(stop)
    return replace(
        item,
        deviation_m=deviation(pose, stop),
        along_m=x * math.cos(ahead) + y * math.sin(ahead),
        across_m=y * math.cos(ahead) - x * math.sin(ahead),
        heading_rad=None if scanner is None else math.remainder(pose.heading - stop.heading, math.tau),
        turned_rad=0.0 if scanner is None else heading_error(scanner, stop.heading, pose.heading),
        tolerance_m=stop.tolerance_m,
    )


def arrival_direction(stop: Stop) -> float:
    """Return the direction in which the robot arrives; without a leg, the stop's heading."""
    leg = np.asarray(stop.approach, dtype=np.float64).reshape(-1, 2)
    moves = np.diff(leg, axis=0)
    moves = moves[np.any(moves != 0, axis=1)]
    return float(np.arctan2(moves[-1, 1], moves[-1, 0])) if len(moves) else stop.heading


def _settling_s(events: Sequence[AnyEvent]) -> float | None:
    """Return the seconds between the last arrival and the following standstill."""
    settled = [k for k, event in enumerate(events) if isinstance(event, Settled)]
    before = [event for event in events[: settled[-1]] if isinstance(event, Arrived)] if settled else []
    return (events[settled[-1]].robot_ns - before[-1].robot_ns) / 1e9 if before else None


def _tries(events: Sequence[AnyEvent]) -> int:
    """Return the number of standstills; at least 1 if the robot scanned or passed the stop."""
    settled = sum(isinstance(event, Settled) for event in events)
    return max(settled, int(any(isinstance(event, Scanned | Unconfirmed) for event in events)))


def _outcome(events: Sequence[AnyEvent]) -> str:
    last = [OUTCOMES[type(event)] for event in events if type(event) in OUTCOMES]
    if last:
        return last[-1]
    return "arrived" if any(isinstance(event, Arrived) for event in events) else "not reached"


def _reason(events: Sequence[AnyEvent]) -> str:
    """Return why a stop was not scanned: the last reason, or both of a failure and the following skip."""
    ends = [event for event in events if type(event) in OUTCOMES]
    both = [type(event) for event in ends[-2:]] == [Failed, Skipped]
    reasons = [getattr(event, "reason", "") for event in ends[-2 if both else -1 :]]
    return "; ".join(dict.fromkeys(reason for reason in reasons if reason))
