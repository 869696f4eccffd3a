"""The run of a vehicle that is only observed, as in a log: its messages become the run's events.

No command is sent to the vehicle, and no decision is made for it. Its reaction to a failure is detected, and
so is a second visit to a stop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from stopgo.mission.document import Mission, Stop
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.captures import NEAR_M, Picture
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import NONE_YET, Observer
from stopgo.mission.mavlink.following.steps import (
    AT_STOP,
    COUNTS_NOT_YET,
    GRACE_NS,
    SOMEBODY,
    Observation,
    has_left,
    since_left,
    steps,
    taken_over,
)
from stopgo.mission.mavlink.following.vehicle_status import CLOCKS
from stopgo.mission.mavlink.telemetry import Message, has_restarted
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import AnyEvent, Arrived, Pose, Scanned
from stopgo.mission.run.states import Change, Run, changed, events_of


class FollowedRun:
    """Takes the messages of one vehicle, in order; `events` are those of its newest run of the mission.

    Parameters
    ----------
    listed
        The mission and the list that the vehicle holds.
    name
        Id of the first run; later runs append their number.
    pose_at
        Returns the vehicle's pose at a time from the log's poses; used where its messages give none.
    """

    def __init__(
        self,
        listed: ListedMission,
        autopilot: Autopilot,
        *,
        name: str,
        robot: str,
        pose_at: Callable[[int], Pose | None] = lambda ns: None,
    ) -> None:
        self._listed = replace(listed, mission=as_observed(listed.mission))
        self._observer = Observer(autopilot)
        self._pose_at = pose_at
        self._name, self._robot = name, robot
        self._run = runs.installed(Run(), listed.mission)
        self._used: Picture = NONE_YET
        self._boot_ms = 0
        self._left_ns: int | None = None
        """Time since when the vehicle is beyond the current stop, without a confirmed scan."""
        self._place = 0
        """Current item at the last observation."""
        self._behind: set[str] = set()
        """Skipped stops that the vehicle has left."""
        self._runs = 0
        self.events: list[AnyEvent] = []

    def take_earlier(self, message: Message, now_ns: int) -> None:
        """Take a message from before the vehicle got this list: it belongs to no run of it."""
        self._observer.take(message, self._listed, now_ns)
        self._boot_ms = self._observer.status.boot_ms

    def take(self, message: Message, now_ns: int) -> None:
        """Take a message that the vehicle sent at this time."""
        name = self._observer.take(message, self._listed, now_ns)
        if name in CLOCKS:
            self._look_at_clock(now_ns)
        while self._step(now_ns):
            pass

    def end(self, now_ns: int) -> None:
        """End the log: no scan can be confirmed later."""
        while self._step(now_ns + GRACE_NS + 1):
            pass
        if self._run.offered:  # nobody drove to the stops that were jumped over
            self._take(runs.ended(self._run, "FINISHED"), now_ns)

    def _step(self, now_ns: int) -> bool:
        """Apply the observation of the current stop; return True if the run went on to another stop."""
        observed = self._observe(now_ns)
        if observed is None:
            return False
        self._go_back(observed)
        before = self._run
        capture = self._observer.capture(before, self._listed, self._arrived(), self._used)
        for change in self._happened(observed, now_ns):
            self._take(change, now_ns)
        waiting = self._run.at == before.at and self._run.stop_state in COUNTS_NOT_YET
        if capture is not None and self._run != before and not waiting:
            self._used = capture.name
        if self._run.at != before.at:
            self._left_ns = None
        return self._run.at > before.at

    def _observe(self, now_ns: int) -> Observation | None:
        run, listed = self._run, self._listed
        observed = self._observer.observe(run, listed, self._arrived(), after=self._used)
        if observed is not None and observed.pose is None:
            observed = replace(observed, pose=self._pose_at(now_ns))
        if observed is None or not has_left(run, listed, observed):
            return observed
        self._left_ns = now_ns if self._left_ns is None else self._left_ns
        return since_left(run, listed, observed, now_ns - self._left_ns)

    def _happened(self, observed: Observation, now_ns: int) -> tuple[Change, ...]:
        if self._run.over:
            return self._begun(observed, now_ns)
        changes = steps(self._run, self._listed, observed)
        now = changes[-1].run if changes else self._run
        if now.over or not self._observer.mode_explained(now_ns):
            return changes
        other = taken_over(now, self._listed, observed)
        return changes if other is None else (*changes, other)

    def _begun(self, observed: Observation, now_ns: int) -> tuple[Change, ...]:
        """Return the start of a run, when the vehicle begins to drive its list; the newest run counts."""
        if not observed.drives or observed.place > self._listed.stops[0].at:
            return ()
        self._runs += 1
        self._used, self._left_ns, self.events = NONE_YET, None, []
        name = self._name if self._runs == 1 else f"{self._name}-{self._runs}"
        return (runs.started(self._run, run_id=name, now_ns=now_ns, by=SOMEBODY),)

    def _go_back(self, observed: Observation) -> None:
        """Give a skipped stop another try, if the vehicle has left it, or its items, and is at it again."""
        before, self._place = self._place, observed.place
        for at, items in enumerate(self._listed.stops[: self._run.at]):
            if items.stop not in self._run.skipped:
                continue
            if not items.first <= observed.place < items.after:
                self._behind.add(items.stop)
            elif items.stop in self._behind or observed.place < before:
                self._behind.discard(items.stop)
                left_out = tuple(stop for stop in self._run.skipped if stop != items.stop)
                self._run = changed(self._run, at=at, leg=at, stop_state="WAITING", skipped=left_out)
                self._left_ns = None
                return

    def _look_at_clock(self, now_ns: int) -> None:
        before_ms, self._boot_ms = self._boot_ms, self._observer.status.boot_ms
        if has_restarted(before_ms, self._boot_ms) and not self._run.over:
            self._take(runs.rebooted(self._run), now_ns)

    def _take(self, change: Change, now_ns: int) -> None:
        self._run = change.run
        for event in events_of(change, robot=self._robot, boot_id="", now_ns=now_ns):
            self.events.append(changed(event, number=len(self.events) + 1))
            if isinstance(event, Scanned):
                captures = self._observer.captures
                captures.counted = captures.counted | {(event.file, event.sha256)}

    def _arrived(self) -> Arrived | None:
        """Return the arrival at the current stop, if the vehicle was seen there."""
        if self._run.at >= len(self._listed.stops) or self._run.stop_state not in AT_STOP:
            return None
        last = next((event for event in reversed(self.events) if isinstance(event, Arrived)), None)
        own = last is not None and last.stop == self._listed.stops[self._run.at].stop
        return last if own else None


def as_observed(mission: Mission) -> Mission:
    """Return the mission for observation: a robot near a stop has arrived there, with its position error.

    The comparison decides later if that is within the stop's tolerance.
    """
    return changed(mission, stops=tuple(map(_as_observed, mission.stops)))


def _as_observed(stop: Stop) -> Stop:
    return changed(stop, tolerance_m=max(stop.tolerance_m, NEAR_M), on_failure="skip", retries=0)
