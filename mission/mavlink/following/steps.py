"""Events of a vehicle in AUTO from observations: arrived, settled, scanned, or why not.

Nothing here touches a vehicle, a clock or a disk. The vehicle reports a reached waypoint; the robot's pose is
checked here against the stop. Only the vehicle's camera or scanner can confirm a scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import msgspec

from stopgo.mission.document import Stop
from stopgo.mission.mavlink.following.listed_mission import ListedMission, StopItems
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import JUMPED_OVER, Pose, Settled, Unconfirmed
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Change, Run, changed
from stopgo.mission.run.tolerance import stop_error_text

SOMEBODY = "somebody (not known who)"
"""Commander of commands that were not sent from here, and whose sender was not heard."""
BEYOND = "the vehicle's current item was set beyond it; it is offered again at the end of the route"
LATE_REPORTS = ("NAVIGATING", "SCANNING")
"""States in which a scanner's report is still expected after the stop was left."""
GRACE_NS = 2 * 10**9
"""Time that a confirmation may come after a scan's wait, if the next stop is not reached before."""
COUNTS_NOT_YET = ("NAVIGATING", "SETTLING", "SCANNING")
"""States in which a reported scan does not count yet."""
AT_STOP = ("SETTLING", "SCANNING", "VERIFYING")


@dataclass(frozen=True)
class Observation:
    """A vehicle at one moment, as far as it is known."""

    mode: str
    """"AUTO", "HOLD", or what else it calls itself."""
    armed: bool
    place: int
    """Index of the current item in the list; the list's length once all is done."""
    pose: Pose | None = None
    """Measured while it was at that item."""
    still: bool = False
    """True for a standstill, by that measurement."""
    scan: ScanResult | ScanFailed | None = None
    """Scanner's report for the current stop."""
    stood: Pose | None = None
    """Pose of the robot at that stop, as the scanner reported it, or as it was observed before."""
    jumped: bool = False
    """True if the current item passed that stop's waits without time for them: somebody ordered it."""
    report_overdue: bool = False
    """True if no scanner report, with its pose, is expected any more."""
    is_jumped: bool = False
    """True if somebody has made a later item the current one before the current stop's waits were over."""
    jumped_by: str = SOMEBODY
    """Whoever did that."""
    failsafe: str = ""
    """Failsafe that put it in its present mode, with its cause; empty if it reports none."""
    moved: str = ""
    """How the vehicle moved during the scan at the current stop; empty if it stood, as far as known."""
    is_ours: bool = True
    """True if the vehicle's list is known to be the one that was sent; before that no stop is done."""

    @property
    def drives(self) -> bool:
        """True if it follows its mission."""
        return self.mode == "AUTO" and self.armed


def has_left(run: Run, listed: ListedMission, observed: Observation) -> bool:
    """Return True if it has left the current stop, and the scanner's report may still come."""
    at_work = run.stop_state in LATE_REPORTS and run.at < len(listed.stops)
    return at_work and observed.place >= listed.stops[run.at].after


def is_back(run: Run, listed: ListedMission, observed: Observation) -> bool:
    """Return True for a vehicle on its way to the stop at which the run has it."""
    at_stop = run.stop_state in AT_STOP and run.at < len(listed.stops)
    return at_stop and observed.place <= listed.stops[run.at].at


def since_left(run: Run, listed: ListedMission, observed: Observation, waited_ns: int) -> Observation:
    """Return the observation after waiting: is a report still expected from the stop that was left?"""
    beyond = run.at + 1 < len(listed.stops) and observed.place > listed.stops[run.at + 1].at
    return replace(observed, report_overdue=beyond or waited_ns > GRACE_NS)


def steps(run: Run, listed: ListedMission, observed: Observation) -> tuple[Change, ...]:
    """Return the changes since the run was stored, in order, up to the end of the current stop."""
    taken: list[Change] = []
    while (change := step(run, listed, observed)) is not None:
        taken.append(change)
        if change.run.at != run.at or tried_again(
            run, change.run
        ):  # what was observed is of this stop, this time
            break
        run = change.run
    return tuple(taken)


def step(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    """Return the next change, if there is any; stops that were jumped over are offered before the end."""
    change = _next(run, listed, observed)
    if change is None or change.run.state != "FINISHED" or not change.run.jumped:
        return change
    *before, _ = change.events  # without Finished
    offer = runs.offered(change.run, listed.mission, f"stopgo retry{listed.address}")
    return Change(offer.run, (*before, *offer.events))


def _next(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    if run.state == "PAUSED":
        return _ends_scan(run, listed, observed)
    if run.state == "HOMING":
        return runs.ended(run, run.then) if observed.place >= listed.end else None
    if run.state != "RUNNING" or run.at >= len(listed.stops):
        return None
    return STEPS[run.stop_state](run, listed, observed, listed.stops[run.at])


def _ends_scan(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    """Return the end of a scan: a paused vehicle still ends it."""
    if run.stop_state == "VERIFYING":
        return _verified(run, listed, observed)
    if run.stop_state == "SCANNING" and isinstance(observed.scan, ScanResult) and not observed.moved:
        return _ended(run, listed, observed, observed.scan)
    return None


def _ended(run: Run, listed: ListedMission, observed: Observation, scan: ScanResult) -> Change:
    """End the scan with the pose known now; once the vehicle has left, it is not known."""
    return runs.scan_ended(run, listed.mission, msgspec.structs.replace(scan, pose=observed.stood))


def _begun(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    return runs.leaving(run)


def _driven(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """Check a waypoint that the vehicle reports as reached."""
    if observed.place <= items.at:
        return None
    if observed.place >= items.after:
        return _passed(run, listed, observed)
    if observed.pose is None:
        return None
    wrong = arrival_error_text(observed.pose, run, listed)
    if not wrong:
        return _reached(run, listed, observed.pose)
    if observed.still or observed.place >= items.scan:
        return runs.failed(run, listed.mission, wrong)
    return None


def _passed(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    """Check a stop that the vehicle has left before its arrival was seen."""
    if observed.is_jumped:
        return _jumped(run, listed, observed)
    if observed.stood is None:
        over = observed.report_overdue and observed.is_ours
        return _unconfirmed(run, listed, None, "no pose of the vehicle at the stop") if over else None
    wrong = arrival_error_text(observed.stood, run, listed)
    if wrong:
        return runs.failed(_last_try(run, listed.mission.stops[run.at]), listed.mission, wrong)
    return _reached(run, listed, observed.stood)


def _reached(run: Run, listed: ListedMission, pose: Pose) -> Change:
    return runs.reached(changed(run, leg=run.at), listed.mission, pose)


def _settled(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    if observed.place <= items.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if observed.place < items.scan:
        return None
    if observed.place >= items.after or observed.pose is None:
        return Change(changed(run, stop_state="SCANNING")) if observed.place >= items.after else None
    wrong = arrival_error_text(observed.pose, run, listed)
    if wrong:
        return runs.failed(run, listed.mission, f"moved while it settled: {wrong}")
    settled = partial(Settled, stop=items.stop, pose=observed.pose)
    return Change(changed(run, stop_state="SCANNING"), (settled,))


def _scanned(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """Take the scanner's report when it comes; the stop is done when its wait is over."""
    if observed.place <= items.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if observed.moved:
        return _failed(run, listed, observed, items, ScanFailed(reason=observed.moved))
    if isinstance(observed.scan, ScanResult):
        return _ended(run, listed, observed, observed.scan)
    if isinstance(observed.scan, ScanFailed):
        return _failed(run, listed, observed, items, observed.scan)
    return _late(run, listed, observed, items)


def _late(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """Leave a stop without a report of its scan, once none is expected any more."""
    if observed.place < items.after or not (observed.report_overdue and observed.is_ours):
        return None
    if observed.is_jumped:
        return _jumped(run, listed, observed)
    return _unconfirmed(run, listed, observed.stood, "no scan report from the vehicle")


def _failed(
    run: Run, listed: ListedMission, observed: Observation, items: StopItems, scan: ScanFailed
) -> Change:
    """End a failed scan, or one during which the vehicle moved; a stop that was left has no tries left."""
    left = observed.place >= items.after
    tried = _last_try(run, listed.mission.stops[run.at]) if left else run
    return runs.scan_ended(tried, listed.mission, scan)


def _last_try(run: Run, stop: Stop) -> Run:
    """Use up the tries: there is no planned way back to a stop that was left."""
    return changed(run, attempt=stop.retries)


def _scan_over(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """Verify a reported scan once its wait is over."""
    if observed.moved:
        return _failed(run, listed, observed, items, ScanFailed(reason=observed.moved))
    return None if items.at < observed.place < items.after else _verified(run, listed, observed)


def _verified(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    pose = observed.stood or observed.pose
    return None if pose is None or not observed.is_ours else runs.verified(run, listed.mission, pose)


def _unconfirmed(run: Run, listed: ListedMission, pose: Pose | None, reason: str) -> Change:
    """Complete the stop without a confirmed scan."""
    mission = listed.mission
    behind = runs.next_stop(runs.with_done(changed(run, leg=run.at + 1), mission, pose), mission)
    event = partial(Unconfirmed, stop=mission.stops[run.at].id, pose=pose, reason=reason)
    return Change(behind.run, (event, *behind.events))


def _jumped(run: Run, listed: ListedMission, observed: Observation) -> Change:
    return runs.jumped_over(run, listed.mission, f"{JUMPED_OVER} {observed.jumped_by}: {BEYOND}")


STEPS: dict[str, Callable[[Run, ListedMission, Observation, StopItems], Change | None]] = {
    "WAITING": _begun,
    "NAVIGATING": _driven,
    "SETTLING": _settled,
    "SCANNING": _scanned,
    "VERIFYING": _scan_over,
}


def tried_again(before: Run, after: Run) -> bool:
    """Return True if the vehicle must go back to the stop's waypoint for another attempt."""
    same = (before.at, after.state, after.stop_state) == (after.at, "RUNNING", "WAITING")
    return same and after.attempt > before.attempt


def after_skipped(run: Run, listed: ListedMission, observed: Observation) -> int | None:
    """Return the item to go on with for a vehicle at a skipped stop; `None` if it is not there.

    A vehicle that drives the route again passes the finished stops in the same way.
    """
    passed = (*run.skipped, *run.done) if run.revisits else run.skipped
    for items in listed.stops[: run.at]:
        if items.stop in passed and items.at < observed.place < items.after < listed.end:
            return items.after
    return None


def taken_over(
    run: Run, listed: ListedMission, observed: Observation, *, by: str = SOMEBODY
) -> Change | None:
    """Return the change of the run by a change of the vehicle's mode that was not commanded here."""
    going = run.state in ("RUNNING", "HOMING")
    if going and not observed.drives and observed.place < listed.end:
        why = "disarmed" if observed.mode == "AUTO" else f"mode {observed.mode}"
        return runs.paused(run, f"{why}, by {_author(observed, by)}", stands=observed.mode == "HOLD")
    if run.state in ("PAUSED", "HELD") and observed.drives and observed.place < listed.end:
        return runs.resumed(run, by)
    if run.state == "PAUSED" and observed.place >= listed.end:  # it went on unseen, to the end
        return runs.resumed(run, by)
    return None


def _author(observed: Observation, by: str) -> str:
    """Return who changed the mode: a failsafe, unless somebody is known to have commanded it."""
    return observed.failsafe if observed.failsafe and by == SOMEBODY else by


COUNTED_TOO = 1
"""Items by which two counts of one list may differ: a firmware may count home."""


def is_replaced(items: int | None, listed: ListedMission) -> bool:
    """True if the vehicle reports no items, or so many that they are not those of the list."""
    return items is not None and (items == 0 or abs(items - listed.end) > COUNTED_TOO)


def run_on_vehicle(run: Run, items: int | None, listed: ListedMission | None) -> Run:
    """Return the run as reported; a ready mission is dropped if its items are not on the vehicle."""
    lies_ready = run.state == "READY" and listed is not None
    return Run() if lies_ready and is_replaced(items, listed) else run


def arrival_error_text(pose: Pose, run: Run, listed: ListedMission) -> str:
    """Return the errors outside tolerance of a stop that the vehicle reports as reached; empty if within."""
    error = stop_error_text(pose, listed.mission.stops[run.at], listed.mission.scanner)
    return error and f"{error}; the vehicle reports it reached"
