"""The run of a vehicle that is only listened to, as in a log: its messages become the run's events.

Nothing is told to the vehicle and nothing decided for it. What it did after a failure is seen, and so is a
second visit to a stop.
"""

from __future__ import annotations

from dataclasses import replace

from stopgo.mission.document import Mission, Stop
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.captures import NEAR_M, Picture
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import CLOCKS, NONE_YET, Observer
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
from stopgo.mission.mavlink.telemetry import Message, began_again
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import AnyEvent, Arrived
from stopgo.mission.run.states import Change, Run, changed, events_of


class FollowedRun:
    """Takes the messages of one vehicle, in order; `events` are those of its newest run of the mission.

    Parameters
    ----------
    listed
        The mission and the list that the vehicle holds.
    name
        A run's id: this, and from the second on its number behind it.
    """

    def __init__(self, listed: ListedMission, autopilot: Autopilot, *, name: str, robot: str) -> None:
        self._listed = replace(listed, mission=as_seen(listed.mission))
        self._observer = Observer(autopilot)
        self._name, self._robot = name, robot
        self._run = runs.installed(Run(), listed.mission)
        self._used: Picture = NONE_YET
        self._boot_ms = 0
        self._left_ns: int | None = None
        """Since when the vehicle is beyond the stop that is worked on, without a word of its scan."""
        self._runs = 0
        self.events: list[AnyEvent] = []

    def know(self, message: Message, now_ns: int) -> None:
        """A message from before the vehicle was given this list: it tells of no run of it."""
        self._observer.take(message, self._listed, now_ns)
        self._boot_ms = self._observer.boot_ms

    def hear(self, message: Message, now_ns: int) -> None:
        """A message that the vehicle sent at this time."""
        name = self._observer.take(message, self._listed, now_ns)
        if name in CLOCKS:
            self._look_at_clock(now_ns)
        while self._step(now_ns):
            pass

    def end(self, now_ns: int) -> None:
        """Nothing more is heard: no scan can be confirmed later."""
        while self._step(now_ns + GRACE_NS + 1):
            pass

    def _step(self, now_ns: int) -> bool:
        """Take in what is seen of the stop that is worked on; whether the run went on by it."""
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
        if observed is None or not has_left(run, listed, observed):
            return observed
        self._left_ns = now_ns if self._left_ns is None else self._left_ns
        return since_left(run, listed, observed, now_ns - self._left_ns)

    def _happened(self, observed: Observation, now_ns: int) -> tuple[Change, ...]:
        if self._run.over:
            return self._begun(observed, now_ns)
        told = steps(self._run, self._listed, observed)
        now = told[-1].run if told else self._run
        if now.over or not self._observer.mode_explained(now_ns):
            return told
        other = taken_over(now, self._listed, observed)
        return told if other is None else (*told, other)

    def _begun(self, observed: Observation, now_ns: int) -> tuple[Change, ...]:
        """A run begins when the vehicle begins to drive its list; the one before is no longer the newest."""
        if not observed.drives or observed.place > self._listed.stops[0].at:
            return ()
        self._runs += 1
        self._used, self._left_ns, self.events = NONE_YET, None, []
        name = self._name if self._runs == 1 else f"{self._name}-{self._runs}"
        return (runs.started(self._run, run_id=name, now_ns=now_ns, by=SOMEBODY),)

    def _go_back(self, observed: Observation) -> None:
        """A vehicle that is at an earlier stop again, which was left out, has another try at it."""
        for at, items in enumerate(self._listed.stops[: self._run.at]):
            if items.stop in self._run.skipped and items.first <= observed.place < items.after:
                left_out = tuple(stop for stop in self._run.skipped if stop != items.stop)
                self._run = changed(self._run, at=at, leg=at, stop_state="WAITING", skipped=left_out)
                self._left_ns = None
                return

    def _look_at_clock(self, now_ns: int) -> None:
        before_ms, self._boot_ms = self._boot_ms, self._observer.boot_ms
        if began_again(before_ms, self._boot_ms) and not self._run.over:
            self._take(runs.rebooted(self._run), now_ns)

    def _take(self, change: Change, now_ns: int) -> None:
        self._run = change.run
        for event in events_of(change, robot=self._robot, boot_id="", now_ns=now_ns):
            self.events.append(changed(event, number=len(self.events) + 1))

    def _arrived(self) -> Arrived | None:
        """That the vehicle was seen at the stop that is worked on."""
        if self._run.at >= len(self._listed.stops) or self._run.stop_state not in AT_STOP:
            return None
        last = next((event for event in reversed(self.events) if isinstance(event, Arrived)), None)
        own = last is not None and last.stop == self._listed.stops[self._run.at].stop
        return last if own else None


def as_seen(mission: Mission) -> Mission:
    """The mission for whoever only looks: what stands beside a stop has arrived there, with its distance.

    Whether that is within the stop's tolerance is for the comparison to say.
    """
    return changed(mission, stops=tuple(map(_as_seen, mission.stops)))


def _as_seen(stop: Stop) -> Stop:
    return changed(stop, tolerance_m=max(stop.tolerance_m, NEAR_M), on_failure="skip", retries=0)
