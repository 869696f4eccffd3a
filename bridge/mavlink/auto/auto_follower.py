"""Follows a vehicle's run: what is seen is written down, and the vehicle told what follows from it."""

from __future__ import annotations

import threading
import uuid
from contextlib import suppress
from functools import partial

from stopgo.bridge.mavlink.auto.confirmed_commands import ConfirmedCommands, Denied
from stopgo.bridge.mavlink.auto.logbook import Logbook, Ordered, PendingCommand
from stopgo.bridge.mavlink.line.peer import Peer
from stopgo.bridge.mavlink.transfer.download import download
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots.kind import AUTO
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.following import steps as progress
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import CLOCKS, Observer
from stopgo.mission.mavlink.following.steps import (
    AT_STOP,
    COUNTS_NOT_YET,
    SOMEBODY,
    Observation,
    has_left,
    since_left,
    steps,
    tried_again,
)
from stopgo.mission.mavlink.read_back import differences
from stopgo.mission.mavlink.telemetry import has_restarted
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Arrived
from stopgo.mission.run.states import Change, Run

SETTLED_NS = 1_500_000_000
"""A heartbeat this soon after a change may have been sent before it."""
REMEMBERED_NS = 60 * 10**9
"""An order whose outcome was unknown is taken to be the cause of what the vehicle does so much later."""
AGAIN_S = 1.0


class AutoFollower:
    """Looks at each message with what is known by then; `act` sends the vehicle the command that is pending.

    One that only looks keeps to itself what it sees, and tells the vehicle nothing.
    """

    def __init__(
        self,
        book: Logbook,
        peer: Peer,
        observer: Observer,
        commands: ConfirmedCommands,
        *,
        looks_only: bool = False,
    ) -> None:
        self._book = book
        self._peer = peer
        self._observer = observer
        self._commands = commands
        self._looks_only = looks_only
        self._closing = threading.Event()
        self._due = threading.Event()
        self._differs: str | None = None
        """How the vehicle's mission differs from what it was sent; `None` while nobody has compared them."""
        self._compare_due = False
        self.looking = False
        """Nothing is made of what comes in before all is known that can be asked for."""
        self._left: tuple[tuple[str, int, int], int] | None = None
        """The stop that the vehicle has left without a word of a scan, and since when."""
        self.run = book.run
        """As it is by now."""

    def close(self) -> None:
        self._closing.set()
        self._due.set()

    def begin(self) -> None:
        """All is known that can be asked for: look from now on, first whether it was started anew.

        A reboot changes the mode too, and nobody has chosen that one.
        """
        self.looking = True
        self._look_at_clock()
        self.look("HEARTBEAT")

    def look(self, name: str) -> None:
        """A message of this name has come."""
        self.run = self._book.run
        listed = self._book.listed
        if not self.looking:
            return
        if name in CLOCKS:
            self._look_at_clock()
        if listed is None or self.run.state == "IDLE" or self._busy():
            return
        while self._look_once(listed):
            pass

    def _look_once(self, listed: ListedMission) -> bool:
        """Take in what is seen of the stop that is worked on; whether the run went on by it."""
        before, observed = self.run, self._observe(listed)
        if observed is None:
            return False
        happened = self._happened(before, listed, observed)
        if self._looks_only:
            self.run = happened[-1].run if happened else before
        elif happened:
            self._write_down(listed, observed, before)
        self._lead_past(listed, observed)
        return self.run.at > before.at and self._book.pending is None

    def _write_down(self, listed: ListedMission, observed: Observation, before: Run) -> None:
        """Store what has happened, with what it wants of the vehicle, and the scan that counts no more."""
        capture = self._observer.capture(before, listed, self._arrived(listed), self._book.used)
        with self._book.journal.transaction():
            self.run = self._book.move(
                lambda run: () if run != before else self._happened(run, listed, observed),
                partial(self._pending_after, listed),
            )
            waiting = self.run.at == before.at and self.run.stop_state in COUNTS_NOT_YET
            if capture is not None and self.run != before and not waiting:
                self._book.use(*capture.name)
        if self.run.state == "RUNNING" and before.state in ("READY", "PAUSED", "HELD"):
            self._compare_due = True  # somebody else let it go on, perhaps with another mission
            self._due.set()

    def _observe(self, listed: ListedMission) -> Observation | None:
        """The vehicle as it is seen now; asked once more for a scan of a stop that it has left."""
        run, now_ns = self.run, self._book.clock.now_ns()
        observed = self._observer.observe(run, listed, self._arrived(listed), after=self._book.used)
        if observed is None or not has_left(run, listed, observed):
            return observed
        stop = (run.run_id or "", run.at, run.attempt)
        if self._left is None or self._left[0] != stop:
            self._left = (stop, now_ns)
        if observed.scan is None:
            self._commands.ask_for(MessageId.CAMERA_IMAGE_CAPTURED)
        return since_left(run, listed, observed, now_ns - self._left[1])

    def _busy(self) -> bool:
        """Whether the vehicle is being told something: what it does until then is neither here nor there."""
        ordered, pending = self._book.ordered, self._book.pending
        if pending is not None:
            self._due.set()
        return pending is not None or (ordered is not None and ordered.until_ns > self._book.clock.now_ns())

    def _look_at_clock(self) -> None:
        """A vehicle that was started anew stands, and has forgotten its mode, origin and item."""
        began_ns, before_ms = self._observer.began_ns, self._book.boot_ms
        self._book.boot_ms = self._observer.boot_ms
        went_back = has_restarted(before_ms, self._book.boot_ms)
        if self._looks_only or began_ns is None or not self._book.booted(began_ns, went_back=went_back):
            return
        self._commands.ask_for_telemetry()
        self.run = self._book.move(_rebooted)

    def _happened(self, run: Run, listed: ListedMission, observed: Observation) -> tuple[Change, ...]:
        """The steps of the run, or what others have done to it."""
        told = steps(run, listed, observed)
        now = told[-1].run if told else run
        if told and (now.over or tried_again(run, now) or now.state == "HELD"):
            return told
        settled = self._observer.mode_ns >= self._book.changed_ns + SETTLED_NS
        if not (settled and self._observer.mode_explained(self._book.clock.now_ns())):
            return told
        other = (
            self._strange_list(now, listed)
            or self._begun_elsewhere(now, listed, observed)
            or progress.taken_over(now, listed, observed, by=self._by(observed))
        )
        return told if other is None else (*told, other)

    def _strange_list(self, run: Run, listed: ListedMission) -> Change | None:
        """Held, if the vehicle holds something else than it was sent."""
        if run.over or run.state == "HELD":
            return None
        items, why = self._observer.items, self._differs
        if items is not None and items != listed.end:
            why = f"it holds {items} items, {listed.end} were sent"
        return runs.held(run, f"somebody has changed the vehicle's mission: {why}") if why else None

    def _begun_elsewhere(self, run: Run, listed: ListedMission, observed: Observation) -> Change | None:
        """A run that began without an answer here: the vehicle drives what it was sent."""
        by = self._by(observed)
        ours = by != SOMEBODY or self._differs == ""
        if run.state != "READY" or not observed.drives or observed.place >= listed.end or not ours:
            return None
        now_ns = self._book.clock.now_ns()
        return runs.started(run, run_id=uuid.uuid4().hex[:12], now_ns=now_ns, by=by)

    def _by(self, observed: Observation) -> str:
        """Who has changed the mode: whoever gave an order to that effect whose outcome was unknown."""
        ordered = self._book.ordered
        if ordered is None or not self._recent(ordered) or ordered.mode != observed.mode:
            return SOMEBODY
        return ordered.by

    def _recent(self, ordered: Ordered) -> bool:
        return self._book.clock.now_ns() < ordered.until_ns + REMEMBERED_NS

    def _arrived(self, listed: ListedMission) -> Arrived | None:
        """That the robot was seen at the stop that is worked on: scans told before are of other times."""
        run = self.run
        if run.at >= len(listed.stops) or run.stop_state not in AT_STOP:
            return None
        event = self._book.journal.last_event(run.run_id or "", "Arrived")
        own = isinstance(event, Arrived) and event.stop == listed.stops[run.at].stop
        return event if own and isinstance(event, Arrived) else None

    # What the vehicle is told

    def _pending_after(self, listed: ListedMission, before: Run, after: Run) -> PendingCommand | None:
        """What a step of the run wants of the vehicle; of a run that somebody else has halted, nothing."""
        since_ns = self._book.clock.now_ns()
        if tried_again(before, after):
            return PendingCommand(command="jump", place=listed.stops[after.at].at, since_ns=since_ns)
        early = after.state == "FINISHED" and (self._observer.sequence or 0) < listed.sequence(listed.end - 1)
        stops = before.state == "RUNNING" and (after.state in ("HELD", "ABORTED") or early)
        if stops and self._observer.mode == AUTO and self._strange_list(before, listed) is None:
            return PendingCommand(command="hold", place=0, since_ns=since_ns)
        return None

    def _lead_past(self, listed: ListedMission, observed: Observation) -> None:
        """A vehicle that waits at a stop that was left out goes on at once."""
        if self.run.state not in ("RUNNING", "HOMING") or not observed.drives or self._looks_only:
            return
        place = progress.after_skipped(self.run, listed, observed)
        if place is not None:
            pending = PendingCommand(command="jump", place=place, since_ns=self._book.clock.now_ns())
            self._book.journal.store_fact("pending", pending)
            self._due.set()

    def act(self) -> None:
        """Send the vehicle what is pending, until closed, and then what is pending still."""
        while not self._closing.is_set():
            self._due.wait()
            self._due.clear()
            if self._compare_due:
                self._compare_due = False
                self.compare()
            pending, listed = self._book.pending, self._book.listed
            if pending is None or listed is None or self._looks_only:
                continue
            try:
                self._send(pending, listed)
            except (OutcomeUnknown, RobotUnreachable):
                self._closing.wait(AGAIN_S)  # it is asked for again as long as it is pending

    def _send(self, pending: PendingCommand, listed: ListedMission) -> None:
        try:
            if pending.command == "hold":
                self._commands.hold()
            else:
                self._commands.jump(listed.sequence(pending.place))
        except Denied as denied:
            reason = denied.refused.message
            self._book.move(lambda run: () if run.state != "RUNNING" else (runs.held(run, reason),))
        self._book.clear_pending(pending)

    def compare(self) -> None:
        """Find out whether the vehicle holds what it was sent, item by item; unless it will not tell now."""
        listed, state = self._book.listed, self._book.run.state
        if listed is None or state in ("FINISHED", "ABORTED"):
            return
        with suppress(NegativeResult, RobotUnreachable):
            self._differs = next(iter(differences(listed.sent, download(self._peer))), "")


def _rebooted(run: Run) -> tuple[Change, ...]:
    if run.over:
        return ()
    return (runs.rebooted(run),)
