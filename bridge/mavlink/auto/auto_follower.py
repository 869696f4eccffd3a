"""Follows the run that a vehicle does in AUTO: telemetry moves the run on, and the run commands the vehicle.

Where the state is
------------------
journal (`Logbook`)
    The truth about the run. It outlives this process, and other processes may move the run on as well.
`Observer`
    Last reports of the vehicle. It knows nothing of the run.
`ordered`, in the journal
    The operator's command that some process is carrying out, with a time limit. After an unknown outcome it
    stays for a minute as the possible cause of a change of mode (`ExternalChanges`).
`pending`, in the journal
    The command that the vehicle must get because of a step of the run, see `PendingCommands`.
`used`, in the journal
    The last scan that counts for a stop. Older scans count no more.
`_left`, here
    The stop that the vehicle has left before its scan was reported, and since when. Its scan is requested
    again.
`run`, here
    The run as this process sees it. A process that only looks computes it from the journal at every message.

Invariants
----------
1. Steps are computed from the stored run, and again inside the transaction that stores them. So two processes
   that see the same thing store it once, and no run goes back. Nor does it by reports that are older than its
   last change: another station may have had the newer ones first.
2. A step, the scan that it uses and the command that it requires are stored in one transaction. So a process
   that ends in between leaves no step without its command. A command past a skipped stop follows from the
   run's state at every look.
3. While a command is `ordered` or `pending`, telemetry moves nothing but a restart: the command's effects
   must not count as steps of the run, nor as changes by somebody else.
4. Steps of the run go before changes by somebody else, and end a look if they end the run or hold it.
5. Nothing is looked at before `begin`: before, the state of the vehicle is known only in part.
6. A process that only looks stores nothing and sends nothing.
7. A HOLD that the run requires is sent before it is stored, and again afterwards until confirmed.
8. A stop is done only once the list was found to be the one that was sent, after the work there was over.

Three threads work here. `look` runs in the one that receives messages, and must not wait. `act` runs in
another one: it sends commands, and waits until messages confirm them. `guard` reads the vehicle's list back,
in the third, so that no command waits for that.
"""

from __future__ import annotations

import threading
from dataclasses import replace
from functools import partial

from stopgo.bridge.mavlink.auto.confirmed_commands import ConfirmedCommands
from stopgo.bridge.mavlink.auto.external_changes import ExternalChanges
from stopgo.bridge.mavlink.auto.list_guard import ListGuard
from stopgo.bridge.mavlink.auto.logbook import Logbook
from stopgo.bridge.mavlink.auto.pending_commands import PendingCommands
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.errors import OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.following.steps import (
    AT_STOP,
    COUNTS_NOT_YET,
    Observation,
    has_left,
    is_back,
    since_left,
    steps,
    tried_again,
)
from stopgo.mission.mavlink.following.vehicle_status import CLOCKS
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Arrived
from stopgo.mission.run.states import Change, Run

RETRY_S = 1.0


class AutoFollower:
    """Follows one vehicle; `look` takes in each message, `act` sends the pending commands."""

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
        self._observer = observer
        self._commands = commands
        self._guard = ListGuard(book, peer, observer)
        self._others = ExternalChanges(book, peer, observer, self._guard)
        self._pending = PendingCommands(book, peer, observer, commands, self._guard)
        self._looks_only = looks_only
        self._closing = threading.Event()
        self._due = threading.Event()
        """Set when `act` has something to do."""
        self._compare_due = threading.Event()
        self._in_doubt = False
        """True if the vehicle may have been restarted, or its reports are late; the next ones show which."""
        self.looking = False
        """False until all state of the vehicle that can be requested is known."""
        self._left: tuple[tuple[str, int, int], int] | None = None
        """Run, stop and attempt that the vehicle has left without a report of a scan, and since when."""
        self._ended: tuple[tuple[str, int, int], int] | None = None
        """Run, stop and attempt that was left or whose scan was reported, and since when."""
        self.run = book.run
        """The present run, as this process sees it."""

    def close(self) -> None:
        self._closing.set()
        self._due.set()
        self._compare_due.set()

    def begin(self) -> None:
        """Look from now on, first for a restart of the vehicle.

        A reboot changes the mode as well, and nobody has chosen that one.
        """
        self.looking = True
        self._check_clock()
        self.look("HEARTBEAT")

    def compare(self) -> None:
        """Compare the vehicle's list with the one that was sent."""
        self._guard.compare()

    # In the thread that receives messages

    def look(self, name: str) -> None:
        """Take in a message of this name."""
        self.run = self._book.run
        listed = self._book.listed
        if not self.looking:
            return
        if not self._looks_only and self._guard.is_due(self.run):
            self._compare_due.set()
        if name in CLOCKS:
            self._check_clock()
        if listed is None or self.run.state == "IDLE" or self._busy():
            return
        while self._look_once(listed):
            pass

    def overhear(self, message: Message) -> None:
        """Take in a message of another station's upload."""
        self._guard.hear(message)

    def _check_clock(self) -> None:
        """Reset the run of a vehicle that was restarted: it stopped, and lost its mode, origin and item."""
        clock = self._observer.status.clock
        if clock is None:
            return
        boot_ms = self._observer.status.boot_ms
        if self._looks_only:
            self._book.boots.boot_ms = boot_ms
            return
        verdict = self._book.boots.take(clock.ns, boot_ms, armed=self._observer.status.armed)
        self._in_doubt = verdict == "in doubt"
        if verdict != "restarted":
            return
        self._commands.ask_for_telemetry()
        self.run = self._book.move(_rebooted)

    def _busy(self) -> bool:
        """True while the vehicle gets a command, or may have been restarted.

        Its behaviour until that is known means nothing for the run.
        """
        if self._in_doubt:
            return True
        ordered, pending = self._book.ordered, self._book.pending
        if pending is not None:
            self._due.set()
        return pending is not None or (ordered is not None and ordered.until_ns > self._book.clock.now_ns())

    def _look_once(self, listed: ListedMission) -> bool:
        """Take in the state at the current stop; true if the run went on to another one."""
        before, observed = self.run, self._observe(listed)
        if observed is None or (self._book.is_behind and is_back(before, listed, observed)):
            return False
        changes = self._changes(before, listed, observed)
        if self._looks_only:
            self.run = changes[-1].run if changes else before
            return self.run.at > before.at and self._book.pending is None
        if changes:
            self._pending.hold_before_storing(self._pending.after_step(listed, before, changes[-1].run))
            self._store(listed, observed, before)
        pending = self._pending.past_skipped(self.run, listed, observed) or self._pending.held_again(
            self.run, listed, observed
        )
        if pending is not None:
            self._pending.hold_before_storing(pending)
            self._book.journal.store_fact("pending", pending)
            self._due.set()
        return self.run.at > before.at and self._book.pending is None

    def _observe(self, listed: ListedMission) -> Observation | None:
        """The vehicle's present state; requests again the scan of a stop that the vehicle has left."""
        run, now_ns = self.run, self._book.clock.now_ns()
        self._observer.captures.counted = self._book.scanned_files(run)
        observed = self._observer.observe(run, listed, self._arrived(listed), after=self._book.used)
        if observed is None:
            return None
        has_gone = has_left(run, listed, observed)
        ends = has_gone or run.stop_state == "VERIFYING"
        observed = replace(observed, is_ours=ends and self._is_ours(run, listed, now_ns))
        if observed.is_jumped:
            observed = replace(observed, jumped_by=self._others.jumped_by())
        if not has_gone:
            return observed
        stop = (run.run_id or "", run.at, run.attempt)
        if self._left is None or self._left[0] != stop:
            self._left = (stop, now_ns)
        if observed.scan is None:
            self._commands.ask_for_picture()
        return since_left(run, listed, observed, now_ns - self._left[1])

    def _is_ours(self, run: Run, listed: ListedMission, now_ns: int) -> bool:
        """True if the list was found to be ours after the work at the current stop was over."""
        stop = (run.run_id or "", run.at, run.attempt)
        if self._ended is None or self._ended[0] != stop:
            self._ended = (stop, now_ns)
        is_ours = self._guard.is_ours(listed, self._ended[1])
        if not is_ours:
            self._guard.want()
        return is_ours

    def _arrived(self, listed: ListedMission) -> Arrived | None:
        """The arrival at the current stop: scans reported before it are older ones."""
        run = self.run
        if run.at >= len(listed.stops) or run.stop_state not in AT_STOP:
            return None
        event = self._book.journal.last_event(run.run_id or "", "Arrived")
        own = isinstance(event, Arrived) and event.stop == listed.stops[run.at].stop
        return event if own and isinstance(event, Arrived) else None

    def _changes(self, run: Run, listed: ListedMission, observed: Observation) -> tuple[Change, ...]:
        """The steps of the run, and then the change that somebody else has made to it."""
        own = steps(run, listed, observed)
        now = own[-1].run if own else run
        if own and (now.over or tried_again(run, now) or now.state == "HELD"):
            return own
        other = self._others.change(now, listed, observed)
        return own if other is None else (*own, other)

    def _store(self, listed: ListedMission, observed: Observation, before: Run) -> None:
        """Store the changes, with the command that they require and the scan that they use."""
        capture = self._observer.capture(before, listed, self._arrived(listed), self._book.used)
        with self._book.journal.transaction():
            self.run = self._book.move(
                lambda run: () if run != before else self._changes(run, listed, observed),
                partial(self._pending.after_step, listed),
            )
            waiting = self.run.at == before.at and self.run.stop_state in COUNTS_NOT_YET
            if capture is not None and self.run != before and not waiting:
                self._book.use(*capture.name)
        if self.run.state == "RUNNING" and before.state in ("READY", "PAUSED", "HELD"):
            self._guard.want()  # somebody else let it go on, perhaps with another mission

    # In threads of their own

    def guard(self) -> None:
        """Until closed: compare the lists when that is due."""
        while not self._closing.is_set():
            self._compare_due.wait()
            self._compare_due.clear()
            if not self._closing.is_set():
                self.compare()

    def act(self) -> None:
        """Until closed: send the pending command until confirmed."""
        while not self._closing.is_set():
            self._due.wait()
            self._due.clear()
            pending, listed = self._book.pending, self._book.listed
            if pending is None or listed is None or self._looks_only:
                continue
            try:
                self._pending.send(pending, listed)
            except (OutcomeUnknown, RobotUnreachable):
                self._closing.wait(RETRY_S)  # `look` sets `_due` again as long as it is pending


def _rebooted(run: Run) -> tuple[Change, ...]:
    if run.over:
        return ()
    return (runs.rebooted(run),)
