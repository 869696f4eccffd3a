"""A run of a mission: where the robot is in its work, and how each outcome moves it on.

Nothing here touches a robot, a clock or a disk: every function takes a run and gives the next one with
the events that tell of it. The controller stores both before anything else happens.
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
from stopgo.mission.run.scans import ScanFailed, ScanResult, missing_in
from stopgo.mission.run.tolerance import deviation, is_outside

After = Literal["FINISHED", "ABORTED", "PAUSED"]
DetailedState = State | Literal["PAUSED homing", "HELD homing"]


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """The robot's place in its work, as stored before every transition."""

    state: State = "IDLE"
    mission_id: str | None = None
    revision: int | None = None
    run_id: str | None = None
    started_ns: int = 0
    leg: int = 0
    """The leg the robot is on; `len(stops)` is the return."""
    at: int = 0
    """The stop that is worked on; `len(stops)` when all are behind."""
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
    outside: tuple[str, ...] = ()
    """Those that are done and were scanned farther from their places than is tolerated."""
    reason: str = ""
    """Why it is paused, held or homing."""
    homing: bool = False
    """Whether what is driven, paused or held is the way home."""
    homing_reason: str = ""
    """Why it goes home, whatever has paused or held it meanwhile."""
    then: After = "FINISHED"
    """What the run is once the robot is home."""
    next_revision: int | None = None
    """The revision that is followed once the stop that is worked on is behind."""

    @property
    def over(self) -> bool:
        return self.state in ("IDLE", "READY", "FINISHED", "ABORTED")

    @property
    def place(self) -> DetailedState:
        """The state as orders see it: what is paused or held may be the way home."""
        if self.homing and self.state == "PAUSED":
            return "PAUSED homing"
        return "HELD homing" if self.homing and self.state == "HELD" else self.state


Telling = Callable[..., AnyEvent]
"""An event that lacks its envelope (number, robot, times)."""


@dataclass(frozen=True)
class Change:
    """The next run and what is told of the step to it."""

    run: Run
    events: tuple[Telling, ...] = ()


def told_of(change: Change, *, robot: str, boot_id: str, now_ns: int) -> Iterator[AnyEvent]:
    """The events of a change, as of the run that it leads to; the journal numbers them."""
    run = change.run
    for telling in change.events:
        yield telling(
            number=0, robot=robot, boot_id=boot_id, run_id=run.run_id or "",
            mission_id=run.mission_id or "", revision=run.revision or 0, robot_ns=now_ns,
            mission_time_s=(now_ns - run.started_ns) / 1e9,
        )  # fmt: skip


changed = msgspec.structs.replace

REAPPROACHES = 3
"""Corrections driven to a stop before its place counts as not reached."""


def installed(run: Run, mission: Mission) -> Run:
    """A mission lies ready; there was no run, or it is over."""
    return Run(state="READY", mission_id=mission.id, revision=mission.revision)


def rebooted(run: Run, became: ScanResult | ScanFailed | None = None) -> Change:
    """After a reboot nothing moves until somebody resumes.

    `became` is what the scanner says of the scan that was under way; one that has ended is verified, any
    other is taken again, under a number of its own.
    """
    if run.over:
        return Change(run)
    if run.stop_state == "SCANNING" and isinstance(became, ScanResult):
        run = changed(run, stop_state="VERIFYING", scan=became)
    change = paused(run, "reboot", stands=False)
    return Change(changed(change.run, reason=run.reason), change.events) if run.state == "PAUSED" else change


def started(run: Run, *, run_id: str, now_ns: int, by: str, left_out: tuple[str, ...] = ()) -> Change:
    """A new run of the mission that lies ready or was run before, without the first stops if so said."""
    fresh = Run(
        state="RUNNING", mission_id=run.mission_id, revision=run.revision, run_id=run_id, started_ns=now_ns,
        leg=len(left_out), at=len(left_out), skipped=left_out,
    )  # fmt: skip
    skips = (partial(Skipped, stop=stop, reason="started beyond it") for stop in left_out)
    return Change(fresh, (partial(Started, commander=by), *skips))


def paused(run: Run, reason: str, *, stands: bool = True) -> Change:
    """The run waits. A robot that stands ends the scan it is in, so that no stop is scanned twice."""
    kept = ("SCANNING", "VERIFYING") if stands else ("VERIFYING",)
    waiting = changed(
        run, state="PAUSED", stop_state=run.stop_state if run.stop_state in kept else "WAITING",
        reason=reason, homing=run.homing or run.state == "HOMING",
    )  # fmt: skip
    return Change(waiting, (partial(Paused, reason=reason),))


def resumed(run: Run, by: str) -> Change:
    """The run goes on; one that was held has all its tries again."""
    going = changed(
        run, state="HOMING" if run.homing else "RUNNING", reason=run.homing_reason,
        stop_state=run.stop_state if run.stop_state in ("SCANNING", "VERIFYING") else "WAITING",
    )  # fmt: skip
    if run.state == "HELD":
        going = changed(going, attempt=0, approaches=0)
    return Change(going, (partial(Resumed, commander=by),))


def leaving(run: Run) -> Change:
    """The robot is about to drive."""
    return Change(changed(run, stop_state="NAVIGATING"))


def reached(run: Run, mission: Mission, pose: Pose, deviation_m: float) -> Change:
    """The end of the leg, or the stop after a correction, has been reached."""
    if run.leg < run.at:
        return Change(changed(run, leg=run.leg + 1))
    stop = mission.stops[run.at]
    if is_outside(deviation_m, stop.tolerance_m):
        if run.approaches < REAPPROACHES:
            return Change(
                changed(run, leg=run.at + 1, stop_state="NAVIGATING", approaches=run.approaches + 1)
            )
        return failed(
            changed(run, leg=run.at + 1),
            mission,
            f"{deviation_m:.3f} m from the stop after {REAPPROACHES} corrections;"
            f" tolerance is {stop.tolerance_m:g} m",
        )
    arrived = partial(Arrived, stop=stop.id, pose=pose, deviation_m=deviation_m)
    return Change(changed(run, leg=run.at + 1, stop_state="SETTLING"), (arrived,))


def settled(run: Run, mission: Mission, pose: Pose, deviation_m: float) -> Change:
    """The robot stands still; if not where it should, it goes there again."""
    if is_outside(deviation_m, mission.stops[run.at].tolerance_m):
        return reached(run, mission, pose, deviation_m)
    telling = partial(Settled, stop=mission.stops[run.at].id, pose=pose)
    return Change(changed(run, stop_state="SCANNING", scans=run.scans + 1), (telling,))


def scan_ended(run: Run, mission: Mission, result: ScanResult | ScanFailed) -> Change:
    if isinstance(result, ScanFailed):
        return failed(run, mission, f"scan: {result.reason}")
    return Change(changed(run, stop_state="VERIFYING", scan=result))


def verified(run: Run, mission: Mission, pose: Pose) -> Change:
    """Whether the scanner's result is one; then the stop is done.

    The robot stands at the pose by now, and stood there while it scanned unless the result says otherwise.
    """
    stop, scan = mission.stops[run.at], run.scan
    if scan is None:
        return Change(changed(run, stop_state="WAITING"))
    pose = scan.pose or pose
    missing = missing_in(scan)
    if missing:
        told = f"{scan.file} ({scan.size} bytes, {scan.points} points)"
        reason = f"scan not confirmed: {told} without {', '.join(missing)}"
        return failed(changed(run, scan=None), mission, reason)
    telling = partial(
        Scanned, stop=stop.id, pose=pose,
        file=scan.file, size=scan.size, sha256=scan.sha256, points=scan.points,
    )  # fmt: skip
    done = next_stop(with_done(run, stop, pose), mission)
    return Change(done.run, (telling, *done.events))


def with_done(run: Run, stop: Stop, pose: Pose | None) -> Run:
    """The stop is done; from elsewhere, if the robot stood there."""
    outside = pose is not None and is_outside(deviation(pose, stop), stop.tolerance_m)
    return changed(
        run, done=(*run.done, stop.id), outside=(*run.outside, stop.id) if outside else run.outside
    )


def next_stop(run: Run, mission: Mission) -> Change:
    """On to the next stop; a new revision that waits says itself what is next."""
    between = changed(run, at=run.at + 1, stop_state="WAITING", attempt=0, approaches=0, scan=None)
    return Change(between) if between.next_revision is not None else next_leg(between, mission)


def next_leg(run: Run, mission: Mission) -> Change:
    """To the stop that is next, the way back, or the end."""
    if run.at < len(mission.stops):
        return Change(run)
    if mission.return_ is None:
        return ended(run, "FINISHED")
    return sent_home(run, mission, then="FINISHED", reason="all stops are behind")


def sent_home(run: Run, mission: Mission, *, then: After, reason: str) -> Change:
    return Change(heading_home(run, mission, then=then, reason=reason), (partial(Homing, reason=reason),))


def link_lost(run: Run, mission: Mission, silent_s: float) -> Change:
    """No station has been heard for too long: as the mission's policy says, but no scan is cut short."""
    policy = mission.policy.link_loss
    reason = f"no station heard for {silent_s:.0f} s"
    telling = partial(LinkLost, silent_s=silent_s, policy=policy)
    goes_home = policy == "home"
    change = sent_home(run, mission, then="PAUSED", reason=reason) if goes_home else held(run, reason)
    return Change(change.run, (telling, *change.events))


def heading_home(run: Run, mission: Mission, *, then: After, reason: str) -> Run:
    """On the way home; a robot that is paused stays so, and goes home when it is resumed."""
    state: State = "PAUSED" if run.state == "PAUSED" else "HOMING"
    last_leg = len(mission.stops) - (mission.return_ is None)
    return changed(
        run, state=state, homing=True, then=then, leg=min(run.leg, last_leg),
        stop_state="WAITING", scan=None, reason=reason, homing_reason=reason,
    )  # fmt: skip


def came_home_by(run: Run, mission: Mission) -> Change:
    """One leg of the way home is behind."""
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
    """Somebody must decide: retry, skip, home or abort."""
    waiting = changed(
        run, state="HELD", stop_state="RETRIABLE", reason=reason, homing=run.homing or run.state == "HOMING"
    )
    return Change(waiting, (partial(Held, reason=reason),))


def failed(run: Run, mission: Mission, reason: str) -> Change:
    """An attempt at a stop has failed: again while tries are left, then as the stop's `on_failure` says."""
    stop = mission.stops[run.at]
    if run.attempt < stop.retries:
        again = changed(run, stop_state="WAITING", attempt=run.attempt + 1, approaches=0, scan=None)
        return Change(again)
    telling = partial(Failed, stop=stop.id, reason=reason)
    change = ON_FAILURE[stop.on_failure](changed(run, scan=None), mission, f"{stop.id}: {reason}")
    return Change(change.run, (telling, *change.events))


def skipped(run: Run, mission: Mission, reason: str) -> Change:
    """The stop is left out; its approach is still followed, for it is part of the way."""
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
"""What is done when a stop's tries are used up; `retry` has nothing left but to ask."""


def stop_of(run: Run, mission: Mission | None) -> Stop | None:
    """The stop that is worked on."""
    if mission is None or run.state in ("IDLE", "READY") or run.at >= len(mission.stops):
        return None
    return mission.stops[run.at]
