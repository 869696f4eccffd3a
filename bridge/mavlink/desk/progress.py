"""What is seen of a vehicle in AUTO, told as the steps of a run: arrived, settled, scanned, or why not.

Nothing here touches a vehicle, a clock or a disk. That a waypoint is reached is the vehicle's word; whether
the robot stands at the stop is measured here, by its pose. That a scan was made is believed only of the
vehicle's camera or scanner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from bridge.mavlink.desk.visits import Course, Visit
from mission.document import Stop
from mission.events import Pose, Settled, Unconfirmed
from mission.run import states as runs
from mission.run.scans import ScanFailed, ScanResult, turned_away
from mission.run.states import Change, Run, changed, deviation

SOMEBODY = "the vehicle's operator"
"""Who gives orders that were not given here."""


@dataclass(frozen=True)
class Sight:
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
    """No word of the scanner is to be expected any more."""

    @property
    def drives(self) -> bool:
        """Whether it follows its mission."""
        return self.mode == "AUTO" and self.armed


def steps(run: Run, course: Course, sight: Sight) -> tuple[Change, ...]:
    """What has happened since the run was stored, one after another, up to the end of the present stop."""
    taken: list[Change] = []
    while (change := step(run, course, sight)) is not None:
        taken.append(change)
        if change.run.at != run.at or tried_again(run, change.run):  # the sight is of this stop, this time
            break
        run = change.run
    return tuple(taken)


def step(run: Run, course: Course, sight: Sight) -> Change | None:
    """The next thing that has happened, if anything has."""
    if run.state == "PAUSED":
        return _ends_scan(run, course, sight)
    if run.state == "HOMING":
        return runs.ended(run, run.then) if sight.place >= course.end else None
    if run.state != "RUNNING" or run.at >= len(course.visits):
        return None
    return STEPS[run.stop_state](run, course, sight, course.visits[run.at])


def _ends_scan(run: Run, course: Course, sight: Sight) -> Change | None:
    """A vehicle that is paused still ends the scan it was in."""
    if run.stop_state == "VERIFYING":
        return _verified(run, course, sight)
    if run.stop_state == "SCANNING" and isinstance(sight.scan, ScanResult):
        return runs.scan_ended(run, course.mission, sight.scan)
    return None


def _begun(run: Run, course: Course, sight: Sight, visit: Visit) -> Change | None:
    return runs.leaving(run)


def _driven(run: Run, course: Course, sight: Sight, visit: Visit) -> Change | None:
    """The vehicle says that it is there; is it?"""
    if sight.place <= visit.at:
        return None
    left = sight.place >= visit.after
    pose = sight.stood if left else sight.pose
    if pose is None:
        reason = "nobody saw where the vehicle stood"
        return _unconfirmed(run, course, None, reason) if left else None
    stop, wrong = course.mission.stops[run.at], misplaced(pose, run, course)
    if not wrong:
        return runs.reached(changed(run, leg=run.at), course.mission, pose, deviation(pose, stop))
    if left:
        return runs.failed(_last_try(run, stop), course.mission, wrong)
    if sight.still or sight.place >= visit.scan:
        return runs.failed(run, course.mission, wrong)
    return None


def _settled(run: Run, course: Course, sight: Sight, visit: Visit) -> Change | None:
    if sight.place <= visit.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if sight.place < visit.scan:
        return None
    if sight.place >= visit.after or sight.pose is None:
        return Change(changed(run, stop_state="SCANNING")) if sight.place >= visit.after else None
    wrong = misplaced(sight.pose, run, course)
    if wrong:
        return runs.failed(run, course.mission, f"moved while it settled: {wrong}")
    settled = partial(Settled, stop=visit.stop, pose=sight.pose)
    return Change(changed(run, stop_state="SCANNING"), (settled,))


def _scanned(run: Run, course: Course, sight: Sight, visit: Visit) -> Change | None:
    """The scanner's word is taken when it comes; the stop is done when its wait is over."""
    if sight.place <= visit.at:
        return Change(changed(run, stop_state="NAVIGATING"))
    if isinstance(sight.scan, ScanResult):
        return runs.scan_ended(run, course.mission, sight.scan)
    if isinstance(sight.scan, ScanFailed):
        left = sight.place >= visit.after
        tried = _last_try(run, course.mission.stops[run.at]) if left else run
        return runs.scan_ended(tried, course.mission, sight.scan)
    if sight.place < visit.after or not sight.in_vain:
        return None
    return _unconfirmed(run, course, sight.stood, "the vehicle told nothing of a scan")


def _last_try(run: Run, stop: Stop) -> Run:
    """From a stop that was left there is no planned way back to it."""
    return changed(run, attempt=stop.retries)


def _scan_over(run: Run, course: Course, sight: Sight, visit: Visit) -> Change | None:
    """A scan that has come in counts once its wait is over."""
    return None if visit.at < sight.place < visit.after else _verified(run, course, sight)


def _verified(run: Run, course: Course, sight: Sight) -> Change | None:
    pose = sight.stood or sight.pose
    return None if pose is None else runs.verified(run, course.mission, pose)


def _unconfirmed(run: Run, course: Course, pose: Pose | None, reason: str) -> Change:
    """The vehicle is through with the stop, and that is all that is known."""
    stop = course.mission.stops[run.at].id
    behind = runs.next_stop(changed(run, leg=run.at + 1, done=(*run.done, stop)), course.mission)
    telling = partial(Unconfirmed, stop=stop, pose=pose, reason=reason)
    return Change(behind.run, (telling, *behind.events))


STEPS: dict[str, Callable[[Run, Course, Sight, Visit], Change | None]] = {
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


def passed_by(run: Run, course: Course, sight: Sight) -> int | None:
    """Where a vehicle goes on that waits at a stop that was left out; `None` if it does not."""
    for visit in course.visits[: run.at]:
        if visit.stop in run.skipped and visit.at < sight.place < visit.after < course.end:
            return visit.after
    return None


def taken_over(run: Run, course: Course, sight: Sight, *, by: str = SOMEBODY) -> Change | None:
    """What a change of the vehicle's mode that was not ordered here means for the run."""
    going = run.state in ("RUNNING", "HOMING")
    if going and not sight.drives and sight.place < course.end:
        why = "disarmed" if sight.mode == "AUTO" else f"mode {sight.mode}"
        return runs.paused(run, f"{why}, by {by}", stands=sight.mode == "HOLD")
    if run.state in ("PAUSED", "HELD") and sight.drives and sight.place < course.end:
        return runs.resumed(run, by)
    if run.state == "PAUSED" and sight.place >= course.end:  # it went on unseen, to the end
        return runs.resumed(run, by)
    return None


def held_by_vehicle(run: Run, items: int | None) -> Run:
    """The run as it is told; a mission that lay ready is gone if the vehicle says that it holds none."""
    return Run() if run.state == "READY" and items == 0 else run


def misplaced(pose: Pose, run: Run, course: Course) -> str:
    """How the robot stands elsewhere than at its stop, or turned away; empty if it stands there."""
    stop, away = course.mission.stops[run.at], deviation(pose, course.mission.stops[run.at])
    if away > stop.tolerance_m:
        return (
            f"{away:.3f} m from the stop, tolerance is {stop.tolerance_m:g} m; the vehicle calls it reached"
        )
    turned = turned_away(course.mission.scanner, stop.heading, pose.heading)
    if turned:
        return f"turned {math.degrees(turned):.1f}° from the heading that its scanner needs"
    return ""
