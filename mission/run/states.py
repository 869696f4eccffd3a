"""States of a run: the robot's progress through a mission, and the transition that each outcome causes.

Nothing here touches a robot, a clock or a disk. Every function takes a run and returns the next one with
the events of the change. The controller stores both before anything else happens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Literal

import msgspec

from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Arrived,
    Failed,
    Finished,
    Held,
    Homing,
    LinkLost,
    Paused,
    Pose,
    Resumed,
    Scanned,
    Settled,
    Skipped,
    Started,
    State,
    StopState,
)
from stopgo.mission.run.scans import ScanFailed, ScanResult, missing_fields
from stopgo.mission.run.tolerance import deviation, stop_error_text

After = Literal["FINISHED", "ABORTED", "PAUSED"]
DetailedState = State | Literal["PAUSED homing", "HELD homing"]


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """The robot's progress through a mission, as stored before every transition."""

    state: State = "IDLE"
    mission_id: str | None = None
    revision: int | None = None
    run_id: str | None = None
    started_ns: int = 0
    leg: int = 0
    """The leg the robot is on; `len(stops)` is the return."""
    at: int = 0
    """Index of the current stop; `len(stops)` when all are done."""
    stop_state: StopState = "WAITING"
    attempt: int = 0
    approaches: int = 0
    """Corrections driven at this stop."""
    scans: int = 0
    """Scans begun in this run; the last one's number is in its file's name."""
    scan: ScanResult | None = None
    """The scan that waits to be verified."""
    done: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()
    jumped: tuple[str, ...] = ()
    """Those of `skipped` that somebody jumped over: they are offered again at the end of the route."""
    offered: bool = False
    """True while they are offered, and the robot is still at the end of the route."""
    revisits: bool = False
    """True once they were offered: the route is driven again, past the stops that are done."""
    outside: tuple[str, ...] = ()
    """Those of `done` that were scanned outside the stop's tolerance."""
    reason: str = ""
    """Reason why it is paused, held or homing."""
    homing: bool = False
    """True if the robot was on its way home when it was paused or held, or is on it now."""
    homing_reason: str = ""
    """Reason why it goes home, even if something else has paused or held it since."""
    then: After = "FINISHED"
    """State of the run once the robot is home."""
    next_revision: int | None = None
    """Revision that the robot follows once the current stop is done."""

    @property
    def over(self) -> bool:
        return self.state in ("IDLE", "READY", "FINISHED", "ABORTED")

    @property
    def detailed_state(self) -> DetailedState:
        """The state as commands see it: a paused or held run may be on its way home."""
        if self.homing and self.state == "PAUSED":
            return "PAUSED homing"
        return "HELD homing" if self.homing and self.state == "HELD" else self.state


UnstampedEvent = Callable[..., AnyEvent]
"""An event that lacks its envelope (number, robot, times)."""


@dataclass(frozen=True)
class Change:
    """The next run, and the events of the change to it."""

    run: Run
    events: tuple[UnstampedEvent, ...] = ()


def events_of(change: Change, *, robot: str, boot_id: str, now_ns: int) -> Iterator[AnyEvent]:
    """Yield the events of a change, as of the run that it leads to; the journal numbers them."""
    run = change.run
    for event in change.events:
        yield event(
            number=0, robot=robot, boot_id=boot_id, run_id=run.run_id or "",
            mission_id=run.mission_id or "", revision=run.revision or 0, robot_ns=now_ns,
            mission_time_s=(now_ns - run.started_ns) / 1e9,
        )  # fmt: skip


changed = msgspec.structs.replace

REAPPROACHES = 3
"""Corrections driven to a stop before it counts as not reached."""


def installed(run: Run, mission: Mission) -> Run:
    """Return the run of a newly stored mission; there was no run, or it is over."""
    return Run(state="READY", mission_id=mission.id, revision=mission.revision)


def rebooted(run: Run, became: ScanResult | ScanFailed | None = None) -> Change:
    """Return the run after a reboot: nothing moves until somebody resumes.

    `became` is the scanner's outcome of the scan that was running. A finished scan is verified; any other is
    taken again, under a number of its own.
    """
    if run.over:
        return Change(run)
    if run.stop_state == "SCANNING" and isinstance(became, ScanResult):
        run = changed(run, stop_state="VERIFYING", scan=became)
    change = paused(run, "reboot", stands=False)
    return Change(changed(change.run, reason=run.reason), change.events) if run.state == "PAUSED" else change


def started(run: Run, *, run_id: str, now_ns: int, by: str, left_out: tuple[str, ...] = ()) -> Change:
    """Return a new run of the stored mission; `left_out` are first stops to begin beyond."""
    fresh = Run(
        state="RUNNING", mission_id=run.mission_id, revision=run.revision, run_id=run_id, started_ns=now_ns,
        leg=len(left_out), at=len(left_out), skipped=left_out,
    )  # fmt: skip
    skips = (partial(Skipped, stop=stop, reason="started beyond it") for stop in left_out)
    return Change(fresh, (partial(Started, commander=by), *skips))


def paused(run: Run, reason: str, *, stands: bool = True) -> Change:
    """Pause the run. A stationary robot ends the scan it is in, so that no stop is scanned twice."""
    kept = ("SCANNING", "VERIFYING") if stands else ("VERIFYING",)
    waiting = changed(
        run, state="PAUSED", stop_state=run.stop_state if run.stop_state in kept else "WAITING",
        reason=reason, homing=run.homing or run.state == "HOMING",
    )  # fmt: skip
    return Change(waiting, (partial(Paused, reason=reason),))


def resumed(run: Run, by: str) -> Change:
    """Resume the run; after a hold all tries are available again."""
    going = changed(
        run, state="HOMING" if run.homing else "RUNNING", reason=run.homing_reason,
        stop_state=run.stop_state if run.stop_state in ("SCANNING", "VERIFYING") else "WAITING",
        offered=False,
    )  # fmt: skip
    if run.state == "HELD":
        going = changed(going, attempt=0, approaches=0)
    return Change(going, (partial(Resumed, commander=by),))


def leaving(run: Run) -> Change:
    """Mark that the robot is about to drive."""
    return Change(changed(run, stop_state="NAVIGATING"))


def reached(run: Run, mission: Mission, pose: Pose) -> Change:
    """Mark that the robot reached the end of the leg, or the stop after a correction."""
    if run.leg < run.at:
        return Change(changed(run, leg=run.leg + 1))
    stop = mission.stops[run.at]
    if error := stop_error_text(pose, stop, mission.scanner):
        if run.approaches < REAPPROACHES:
            return Change(
                changed(run, leg=run.at + 1, stop_state="NAVIGATING", approaches=run.approaches + 1)
            )
        reason = f"{error} after {REAPPROACHES} corrections"
        return failed(changed(run, leg=run.at + 1), mission, reason)
    arrived = partial(Arrived, stop=stop.id, pose=pose, deviation_m=deviation(pose, stop))
    return Change(changed(run, leg=run.at + 1, stop_state="SETTLING"), (arrived,))


def settled(run: Run, mission: Mission, pose: Pose) -> Change:
    """Mark that the robot is stationary; outside the tolerance, it drives to the stop again."""
    stop = mission.stops[run.at]
    if stop_error_text(pose, stop, mission.scanner):
        return reached(run, mission, pose)
    event = partial(Settled, stop=stop.id, pose=pose)
    return Change(changed(run, stop_state="SCANNING", scans=run.scans + 1), (event,))


def scan_ended(run: Run, mission: Mission, result: ScanResult | ScanFailed) -> Change:
    if isinstance(result, ScanFailed):
        return failed(run, mission, f"scan: {result.reason}")
    return Change(changed(run, stop_state="VERIFYING", scan=result))


def verified(run: Run, mission: Mission, pose: Pose) -> Change:
    """Complete the stop if the scanner's result is complete.

    The robot is at the pose now, and was there while it scanned unless the result says otherwise.
    """
    stop, scan = mission.stops[run.at], run.scan
    if scan is None:
        return Change(changed(run, stop_state="WAITING"))
    pose = scan.pose or pose
    missing = missing_fields(scan)
    if missing:
        result = f"{scan.file} ({scan.size} bytes, {scan.points} points)"
        reason = f"scan not confirmed: {result} without {', '.join(missing)}"
        return failed(changed(run, scan=None), mission, reason)
    event = partial(
        Scanned, stop=stop.id, pose=pose,
        file=scan.file, size=scan.size, sha256=scan.sha256, points=scan.points,
    )  # fmt: skip
    done = next_stop(with_done(run, mission, pose), mission)
    return Change(done.run, (event, *done.events))


def with_done(run: Run, mission: Mission, pose: Pose | None) -> Run:
    """Mark the stop as done; outside its tolerance, if the robot was there."""
    stop = mission.stops[run.at]
    outside = pose is not None and stop_error_text(pose, stop, mission.scanner)
    return changed(
        run, done=(*run.done, stop.id), outside=(*run.outside, stop.id) if outside else run.outside
    )


def next_stop(run: Run, mission: Mission) -> Change:
    """Go on to the next stop; a new revision that waits determines itself what is next."""
    at, finished = run.at + 1, {*run.done, *run.skipped}
    while at < len(mission.stops) and mission.stops[at].id in finished:
        at += 1
    between = changed(run, at=at, stop_state="WAITING", attempt=0, approaches=0, scan=None)
    return Change(between) if between.next_revision is not None else next_leg(between, mission)


def next_leg(run: Run, mission: Mission) -> Change:
    """Go on to the next stop, the return leg, or the end of the run."""
    if run.at < len(mission.stops):
        return Change(run)
    if mission.return_ is None or run.offered:
        return ended(run, "FINISHED")
    return sent_home(run, mission, then="FINISHED", reason="all stops are behind")


def sent_home(run: Run, mission: Mission, *, then: After, reason: str) -> Change:
    return Change(heading_home(run, mission, then=then, reason=reason), (partial(Homing, reason=reason),))


def link_lost(run: Run, mission: Mission, silent_s: float) -> Change:
    """Apply the mission's policy after a link loss; no scan is cut short."""
    policy = mission.policy.link_loss
    reason = f"no data from a station for {silent_s:.0f} s"
    event = partial(LinkLost, silent_s=silent_s, policy=policy)
    goes_home = policy == "home"
    change = sent_home(run, mission, then="PAUSED", reason=reason) if goes_home else held(run, reason)
    return Change(change.run, (event, *change.events))


def heading_home(run: Run, mission: Mission, *, then: After, reason: str) -> Run:
    """Set the run on its way home; a paused robot stays paused, and goes home when it is resumed."""
    state: State = "PAUSED" if run.state == "PAUSED" else "HOMING"
    last_leg = len(mission.stops) - (mission.return_ is None)
    return changed(
        run, state=state, homing=True, then=then, leg=min(run.leg, last_leg),
        stop_state="WAITING", scan=None, reason=reason, homing_reason=reason,
    )  # fmt: skip


def home_leg_driven(run: Run, mission: Mission) -> Change:
    """Mark one leg of the way home as driven."""
    if run.leg == len(mission.stops) or run.leg == 0:
        return ended(changed(run, reason=run.homing_reason), run.then)
    return Change(changed(run, leg=run.leg - 1))


def ended(run: Run, then: After) -> Change:
    over = changed(run, state=then, stop_state="WAITING", scan=None, homing=False, homing_reason="")
    if then == "FINISHED":
        return Change(changed(over, reason=""), (Finished,))
    if then == "ABORTED":
        return Change(over, (partial(Aborted, reason=run.reason),))
    return Change(over, (partial(Paused, reason=run.reason),))


def held(run: Run, reason: str) -> Change:
    """Hold the run: somebody must decide to retry, skip, home or abort."""
    waiting = changed(
        run, state="HELD", stop_state="RETRIABLE", reason=reason, homing=run.homing or run.state == "HOMING"
    )
    return Change(waiting, (partial(Held, reason=reason),))


def failed(run: Run, mission: Mission, reason: str) -> Change:
    """Record a failed attempt at a stop: retry while tries are left, then apply the stop's `on_failure`."""
    stop = mission.stops[run.at]
    if run.attempt < stop.retries:
        again = changed(run, stop_state="WAITING", attempt=run.attempt + 1, approaches=0, scan=None)
        return Change(again)
    event = partial(Failed, stop=stop.id, reason=reason)
    change = ON_FAILURE[stop.on_failure](changed(run, scan=None), mission, f"{stop.id}: {reason}")
    return Change(change.run, (event, *change.events))


def skipped(run: Run, mission: Mission, reason: str) -> Change:
    """Leave the stop out; its approach is still driven, because it is part of the route."""
    stop = mission.stops[run.at]
    behind = next_stop(changed(run, skipped=(*run.skipped, stop.id)), mission)
    return Change(behind.run, (partial(Skipped, stop=stop.id, reason=reason), *behind.events))


def _ask(run: Run, mission: Mission, reason: str) -> Change:
    return held(run, reason)


def _abort(run: Run, mission: Mission, reason: str) -> Change:
    return ended(changed(run, reason=reason), "ABORTED")


def _home(run: Run, mission: Mission, reason: str) -> Change:
    return sent_home(run, mission, then="ABORTED", reason=reason)


ON_FAILURE: dict[str, Callable[[Run, Mission, str], Change]] = {
    "retry": _ask,
    "ask": _ask,
    "skip": skipped,
    "abort": _abort,
    "home": _home,
}
"""Reaction when a stop's tries are used up; `retry` can then only ask."""


def jumped_over(run: Run, mission: Mission, reason: str) -> Change:
    """Leave the stop out for now, because somebody has sent the robot past it."""
    beyond = changed(run, leg=run.at + 1, jumped=(*run.jumped, mission.stops[run.at].id))
    return skipped(beyond, mission, reason)


def offered(run: Run, mission: Mission, command: str) -> Change:
    """Offer the stops that were jumped over, at the end of the route: `command` drives to the first of them.

    A robot that has returned drives the route again from its start. Another one is driven there by hand.
    """
    at = next(index for index, stop in enumerate(mission.stops) if stop.id in run.jumped)
    stop, returns = mission.stops[at], mission.return_ is not None
    again = changed(
        run, at=at, leg=0 if returns else at, attempt=0, approaches=0, offered=True, revisits=True, jumped=(),
        skipped=tuple(name for name in run.skipped if name not in run.jumped),
    )  # fmt: skip
    x, y = stop.approach[0]
    way = "" if returns else f"drive it by hand to ({x:.2f}, {y:.2f}), where the leg to {stop.id} begins; "
    others = f" (then {', '.join(run.jumped[1:])})" if len(run.jumped) > 1 else ""
    return held(
        again,
        f"{stop.id} was jumped over, and is not scanned: {way}{command} drives to it on the route"
        f"{others}; skip ends the run without it",
    )


def stop_of(run: Run, mission: Mission | None) -> Stop | None:
    """The current stop; None if there is none."""
    if mission is None or run.state in ("IDLE", "READY") or run.at >= len(mission.stops):
        return None
    return mission.stops[run.at]
