"""The work of a run, one piece at a time: drive a leg, settle at a stop, scan it, verify it, drive home.

Each stop goes WAITING, NAVIGATING, SETTLING, SCANNING, VERIFYING, DONE. The result of each piece of work is
stored before the next one begins. All of it runs in the controller's thread.
"""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Base, Scanner, watch_takeover
from stopgo.bridge.robot.current_task import faces, has_work, label, moved
from stopgo.bridge.robot.run_store import RunStore
from stopgo.bridge.robot.scan_standstill import ScanStandstill
from stopgo.bridge.robot.work_control import WorkControl
from stopgo.mission.document import Mission, Point
from stopgo.mission.run import route_position
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Pose, Scanned
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Run
from stopgo.mission.run.tolerance import deviation, is_outside

SETTLE_SAMPLE_S = 0.1
SETTLE_LIMIT_S = 30.0
"""Extra time beyond `settle_s` within which a robot must come to a standstill."""


class RunDriver:
    """Drives the legs of the current run and scans its stops."""

    def __init__(
        self, store: RunStore, *, control: WorkControl, base: Base, scanner: Scanner, clock: Clock
    ) -> None:
        self._store = store
        self._control = control
        self._base = base
        self._scanner = scanner
        self._clock = clock
        self.standstill = ScanStandstill(base)
        self.silent_s = 0.0
        """Seconds without data from any station; written by the link's thread."""

    def step(self) -> bool:
        """Do the next piece of work; false if there is none."""
        with self._store.lock:
            run, mission = self._store.snapshot()
            if mission is None or not has_work(run) or not self._control.clear_for_work():
                return False
        if run.state == "HOMING":
            self._drive_home(run, mission)
        else:
            WORK[run.stop_state](self, run, mission)
        return True

    def link_is_lost(self, mission: Mission) -> bool:
        """True if the link is lost by the mission's policy, and the policy wants something of the robot."""
        policy = mission.policy
        return policy.link_loss != "continue" and self.silent_s >= policy.link_loss_after_s

    def stops_for_link(self, run: Run, mission: Mission | None) -> bool:
        """True if the link is lost, and the policy stops at once what the robot is doing."""
        if mission is None or run.state != "RUNNING" or not self.link_is_lost(mission):
            return False
        at_once = mission.policy.link_loss in ("hold", "home")
        return at_once and run.stop_state in ("WAITING", "NAVIGATING", "SETTLING")

    def _leave(self, run: Run, mission: Mission) -> None:
        """Set out for the stop, unless the link or the battery forbids it."""
        advance, battery, silent_s = self._store.advance, self._base.battery(), self.silent_s
        if self.link_is_lost(mission):
            advance(run, lambda now: runs.link_lost(now, mission, silent_s))
        elif battery is not None and battery < mission.policy.battery_min:
            reason = f"battery at {battery:.0%}, below {mission.policy.battery_min:.0%}"
            advance(run, lambda now: runs.sent_home(now, mission, then="PAUSED", reason=reason))
        else:
            advance(run, runs.leaving)

    def _navigate(self, run: Run, mission: Mission) -> None:
        """Drive the rest of the leg, or the correction to the stop."""
        stop, pose = mission.stops[run.at], self._base.pose()
        at_stop = run.leg > run.at
        leg = mission.stops[min(run.leg, run.at)].approach
        onward = route_position.forward(leg, pose, within_m=stop.tolerance_m)
        path = ((stop.x, stop.y),) if at_stop else onward
        there = at_stop and not is_outside(deviation(pose, stop), stop.tolerance_m) and faces(pose, stop)
        heading = stop.heading if run.leg >= run.at else None
        outcome = "arrived" if there else self._goto(path, mission, heading)
        here = self._base.pose()
        if outcome == "blocked":
            self._hold_blocked(run, f"the path to {stop.id}", here)
        elif outcome == "arrived":
            self._store.advance(run, lambda now: runs.reached(now, mission, here))

    def _drive_home(self, run: Run, mission: Mission) -> None:
        """Drive one leg of the return, or one approach backwards."""
        legs, pose = route_position.legs_of(mission), self._base.pose()
        returning = run.leg == len(mission.stops)
        leg = legs[run.leg]
        along = route_position.forward if returning else route_position.backward
        path = along(leg, pose, within_m=mission.stops[min(run.at, len(mission.stops) - 1)].tolerance_m)
        outcome = self._goto(path, mission, None)
        if outcome == "blocked":
            self._hold_blocked(run, "the path home", self._base.pose())
        elif outcome == "arrived":
            self._store.advance(run, lambda now: runs.home_leg_driven(now, mission))

    def _goto(self, path: tuple[Point, ...], mission: Mission, heading: float | None) -> str:
        control = self._control
        control.driving = True
        try:
            return self._base.goto(path, heading=heading, limits=mission.robot, interrupt=control.interrupt)
        finally:
            control.driving = False

    def _hold_blocked(self, run: Run, path_name: str, here: Pose) -> None:
        """Hold the run, for the base could not drive on."""
        cause = self._base.blocked_by()
        reason = f"{path_name} is blocked at ({here.x:.2f}, {here.y:.2f})" + (f": {cause}" if cause else "")
        self._store.advance(run, lambda now: runs.held(now, reason))

    def _settle(self, run: Run, mission: Mission) -> None:
        """Wait until the robot stands still at the stop; hold the run if somebody takes it meanwhile."""
        stop, taken_by = mission.stops[run.at], watch_takeover(self._base)
        still = self._stands_still(stop.settle_s, taken_by)
        if still is None:
            return
        if taken := taken_by():
            self._store.advance(run, lambda now: runs.held(now, f"while it settled at {stop.id}: {taken}"))
            return
        if not still:
            reason = f"not still within {stop.settle_s + SETTLE_LIMIT_S:g} s"
            self._store.advance(run, lambda now: runs.failed(now, mission, reason))
            return
        here = self._base.pose()
        self._store.advance(run, lambda now: runs.settled(now, mission, here))

    def _stands_still(self, settle_s: float, taken_by: Callable[[], str]) -> bool | None:
        """True if the robot stood still for `settle_s`; False also if it is taken; `None` if interrupted."""
        waited, still_for, resting = 0.0, 0.0, self._base.pose()
        while still_for < settle_s:
            if waited > settle_s + SETTLE_LIMIT_S or taken_by():
                return False
            pause = min(SETTLE_SAMPLE_S, settle_s - still_for)
            if self._clock.wait(pause, self._control.interrupt):
                return None
            waited, still_for, pose = waited + pause, still_for + pause, self._base.pose()
            if moved(resting, pose, self._base.rest()):
                still_for, resting = 0.0, pose
        return True

    def _scan(self, run: Run, mission: Mission) -> None:
        stop = mission.stops[run.at]
        with self.standstill.watching(stop.tolerance_m):
            result = self._scanner.scan(label(run, stop), stop.scan, interrupt=self._control.scan_interrupt)
        if isinstance(result, ScanResult):
            why = self.standstill.why or self._counted_before(run, result)
            result = ScanFailed(reason=why) if why else result
        self._store.advance(run, lambda now: runs.scan_ended(now, mission, result))

    def _counted_before(self, run: Run, result: ScanResult) -> str:
        """Return which stop the same file was counted for already; empty if it is a new one."""
        for event in self._store.journal.events(run_id=run.run_id):
            if isinstance(event, Scanned) and (event.file, event.sha256) == (result.file, result.sha256):
                return f"the scanner named {event.file} again, which is the scan of {event.stop}"
        return ""

    def _verify(self, run: Run, mission: Mission) -> None:
        here = self._base.pose()
        self._store.advance(run, lambda now: runs.verified(now, mission, here))


WORK: dict[str, Callable[[RunDriver, Run, Mission], None]] = {
    "WAITING": RunDriver._leave,
    "NAVIGATING": RunDriver._navigate,
    "SETTLING": RunDriver._settle,
    "SCANNING": RunDriver._scan,
    "VERIFYING": RunDriver._verify,
}
"""The work of each stage of a stop."""
