"""What is seen of a vehicle in AUTO, told as the steps of a run: arrived, settled, scanned, or why not.

Nothing here touches a vehicle, a clock or a disk. That a waypoint is reached is the vehicle's word; whether
the robot stands at the stop is measured here, by its pose. That a scan was made is believed only of the
vehicle's camera or scanner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import msgspec

from stopgo.mission.document import Stop
from stopgo.mission.mavlink.following.listed_mission import ListedMission, StopItems
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Pose, Settled, Unconfirmed
from stopgo.mission.run.scans import ScanFailed, ScanResult, heading_error
from stopgo.mission.run.states import Change, Run, changed
from stopgo.mission.run.tolerance import deviation, is_outside

SOMEBODY = "the vehicle's operator"
"""Who gives orders that were not given here."""
TELLS_LATE = ("NAVIGATING", "SCANNING")
"""Of a stop that was left in these, the scanner's word is still waited for."""
GRACE_NS = 2 * 10**9
"""How long a confirmation may come after the end of a scan's wait, if the next stop is not reached before."""
COUNTS_NOT_YET = ("NAVIGATING", "SETTLING", "SCANNING")
"""At these a scan that was told of does not count yet."""
AT_STOP = ("SETTLING", "SCANNING", "VERIFYING")


@dataclass(frozen=True)
class Observation:
    """A vehicle at one moment, as far as it is known."""

    mode: str
    """"AUTO", "HOLD", or what else it calls itself."""
    armed: bool
    place: int
    """The item it works on, as a place in the list; the list's length once all is done."""
    pose: Pose | None = None
    """Measured while it worked on that item."""
    still: bool = False
    """Stands, by that measurement."""
    scan: ScanResult | ScanFailed | None = None
    """What the scanner told of the stop that is worked on."""
    stood: Pose | None = None
    """Where the robot stood at that stop, as the scanner told, or as it was seen there before."""
    in_vain: bool = False
    """No word of the scanner is to be expected any more, which would say where it stood too."""

    @property
    def drives(self) -> bool:
        """Whether it follows its mission."""
        return self.mode == "AUTO" and self.armed


def has_left(run: Run, listed: ListedMission, observed: Observation) -> bool:
    """Whether it has left the present stop, of which the scanner's word may still come."""
    at_work = run.stop_state in TELLS_LATE and run.at < len(listed.stops)
    return at_work and observed.place >= listed.stops[run.at].after


def since_left(run: Run, listed: ListedMission, observed: Observation, waited_ns: int) -> Observation:
    """The same of a stop that was left so long ago: whether the scanner's word is waited for in vain."""
    beyond = run.at + 1 < len(listed.stops) and observed.place > listed.stops[run.at + 1].at
    return replace(observed, in_vain=beyond or waited_ns > GRACE_NS)


def steps(run: Run, listed: ListedMission, observed: Observation) -> tuple[Change, ...]:
    """What has happened since the run was stored, one after another, up to the end of the present stop."""
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
    """The next thing that has happened, if anything has."""
    if run.state == "PAUSED":
        return _ends_scan(run, listed, observed)
    if run.state == "HOMING":
        return runs.ended(run, run.then) if observed.place >= listed.end else None
    if run.state != "RUNNING" or run.at >= len(listed.stops):
        return None
    return STEPS[run.stop_state](run, listed, observed, listed.stops[run.at])


def _ends_scan(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    """A vehicle that is paused still ends the scan it was in."""
    if run.stop_state == "VERIFYING":
        return _verified(run, listed, observed)
    if run.stop_state == "SCANNING" and isinstance(observed.scan, ScanResult):
        return _ended(run, listed, observed, observed.scan)
    return None


def _ended(run: Run, listed: ListedMission, observed: Observation, scan: ScanResult) -> Change:
    """The scan is there; where from is known now, and no more once the vehicle has left."""
    return runs.scan_ended(run, listed.mission, msgspec.structs.replace(scan, pose=observed.stood))


def _begun(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    return runs.leaving(run)


def _driven(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """The vehicle says that it is there; is it?"""
    if observed.place <= items.at:
        return None
    left = observed.place >= items.after
    pose = observed.stood if left else observed.pose
    if pose is None:
        reason = "nobody saw where the vehicle stood"
        return _unconfirmed(run, listed, None, reason) if left and observed.in_vain else None
    stop, wrong = listed.mission.stops[run.at], misplaced(pose, run, listed)
    if not wrong:
        return runs.reached(changed(run, leg=run.at), listed.mission, pose, deviation(pose, stop))
    if left:
        return runs.failed(_last_try(run, stop), listed.mission, wrong)
    if observed.still or observed.place >= items.scan:
        return runs.failed(run, listed.mission, wrong)
    return None


def _settled(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    if observed.place <= items.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if observed.place < items.scan:
        return None
    if observed.place >= items.after or observed.pose is None:
        return Change(changed(run, stop_state="SCANNING")) if observed.place >= items.after else None
    wrong = misplaced(observed.pose, run, listed)
    if wrong:
        return runs.failed(run, listed.mission, f"moved while it settled: {wrong}")
    settled = partial(Settled, stop=items.stop, pose=observed.pose)
    return Change(changed(run, stop_state="SCANNING"), (settled,))


def _scanned(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """The scanner's word is taken when it comes; the stop is done when its wait is over."""
    if observed.place <= items.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if isinstance(observed.scan, ScanResult):
        return _ended(run, listed, observed, observed.scan)
    if isinstance(observed.scan, ScanFailed):
        left = observed.place >= items.after
        tried = _last_try(run, listed.mission.stops[run.at]) if left else run
        return runs.scan_ended(tried, listed.mission, observed.scan)
    if observed.place < items.after or not observed.in_vain:
        return None
    return _unconfirmed(run, listed, observed.stood, "the vehicle told nothing of a scan")


def _last_try(run: Run, stop: Stop) -> Run:
    """From a stop that was left there is no planned way back to it."""
    return changed(run, attempt=stop.retries)


def _scan_over(run: Run, listed: ListedMission, observed: Observation, items: StopItems) -> Change | None:
    """A scan that has come in counts once its wait is over."""
    return None if items.at < observed.place < items.after else _verified(run, listed, observed)


def _verified(run: Run, listed: ListedMission, observed: Observation) -> Change | None:
    pose = observed.stood or observed.pose
    return None if pose is None else runs.verified(run, listed.mission, pose)


def _unconfirmed(run: Run, listed: ListedMission, pose: Pose | None, reason: str) -> Change:
    """The vehicle is through with the stop, and that is all that is known."""
    stop = listed.mission.stops[run.at]
    behind = runs.next_stop(runs.with_done(changed(run, leg=run.at + 1), stop, pose), listed.mission)
    telling = partial(Unconfirmed, stop=stop.id, pose=pose, reason=reason)
    return Change(behind.run, (telling, *behind.events))


STEPS: dict[str, Callable[[Run, ListedMission, Observation, StopItems], Change | None]] = {
    "WAITING": _begun,
    "NAVIGATING": _driven,
    "SETTLING": _settled,
    "SCANNING": _scanned,
    "VERIFYING": _scan_over,
}


def tried_again(before: Run, after: Run) -> bool:
    """Whether the vehicle must go back to the stop's waypoint for another attempt."""
    same = (before.at, after.state, after.stop_state) == (after.at, "RUNNING", "WAITING")
    return same and after.attempt > before.attempt


def passed_by(run: Run, listed: ListedMission, observed: Observation) -> int | None:
    """Where a vehicle goes on that waits at a stop that was left out; `None` if it does not."""
    for items in listed.stops[: run.at]:
        if items.stop in run.skipped and items.at < observed.place < items.after < listed.end:
            return items.after
    return None


def taken_over(
    run: Run, listed: ListedMission, observed: Observation, *, by: str = SOMEBODY
) -> Change | None:
    """What a change of the vehicle's mode that was not ordered here means for the run."""
    going = run.state in ("RUNNING", "HOMING")
    if going and not observed.drives and observed.place < listed.end:
        why = "disarmed" if observed.mode == "AUTO" else f"mode {observed.mode}"
        return runs.paused(run, f"{why}, by {by}", stands=observed.mode == "HOLD")
    if run.state in ("PAUSED", "HELD") and observed.drives and observed.place < listed.end:
        return runs.resumed(run, by)
    if run.state == "PAUSED" and observed.place >= listed.end:  # it went on unseen, to the end
        return runs.resumed(run, by)
    return None


def held_by_vehicle(run: Run, items: int | None) -> Run:
    """The run as it is told; a mission that lay ready is gone if the vehicle says that it holds none."""
    return Run() if run.state == "READY" and items == 0 else run


def misplaced(pose: Pose, run: Run, listed: ListedMission) -> str:
    """How the robot stands elsewhere than at its stop, or turned away; empty if it stands there."""
    stop, away = listed.mission.stops[run.at], deviation(pose, listed.mission.stops[run.at])
    if is_outside(away, stop.tolerance_m):
        return (
            f"{away:.3f} m from the stop, tolerance is {stop.tolerance_m:g} m; the vehicle calls it reached"
        )
    turned = heading_error(listed.mission.scanner, stop.heading, pose.heading)
    if turned:
        return f"turned {math.degrees(turned):.1f}° from the heading that its scanner needs"
    return ""
