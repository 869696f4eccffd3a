"""The robot's current run, and the journal that every change of it is written to first.

A change is written in one transaction and becomes the current run only when the journal has it. If the disk
takes nothing, the robot stands still, and what happened meanwhile waits in memory (`pending`) for the next
transaction that succeeds.
"""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Callable, Iterator

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Scanner
from stopgo.bridge.robot.current_mission import CurrentMission
from stopgo.bridge.robot.current_task import label, same_work
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.lock_waits import WatchedLock
from stopgo.bridge.robot.pending_writes import PendingWrites
from stopgo.bridge.robot.work_control import WorkControl
from stopgo.mission.document import Mission
from stopgo.mission.run import revision
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.lease import Lease, lasting_ns
from stopgo.mission.run.run_commands import Answer, Refused, RunCommand
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Change, Run


class RunStore:
    """The current run and its mission; `lock` guards both, and is held by whoever changes them."""

    def __init__(
        self,
        *,
        robot: str,
        boot_id: str,
        journal: Journal,
        clock: Clock,
        control: WorkControl,
        current: CurrentMission,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called after every change of the run."""
        self.lock = WatchedLock(journal.rows.waits)
        self.robot = robot
        self.boot_id = boot_id
        self.journal = journal
        self.current = current
        self.pending = PendingWrites()
        self._clock = clock
        self._control = control
        self._changed = changed
        self._run = Run()

    @property
    def run(self) -> Run:
        return self._run

    @property
    def lease(self) -> Lease | None:
        """The lease of the station that commands the robot, or was the last to."""
        return self.journal.fact("lease", Lease)

    def snapshot(self) -> tuple[Run, Mission | None]:
        """Return the run and its mission at one moment."""
        with self.lock:
            return self._run, self.current.mission

    def snapshot_within(self, longest_s: float) -> tuple[Run, Mission | None]:
        """Return the same, or a glance if somebody has the lock for longer than that."""
        with self.lock.within(longest_s):
            return self._run, self.current.mission

    def glance(self) -> tuple[Run, Mission | None]:
        """Return run and mission without the lock: good enough to stop the base, not to store anything."""
        return self._run, self.current.mission

    # Reading back after a restart

    def restore(self, scanner: Scanner, *, command_ns: int) -> None:
        """Continue with the run that the journal has; it waits for a command if it was not over."""
        self._shorten_lease(command_ns)
        stored = self.journal.fact("run", Run)
        if stored is None:
            return
        self._run = stored
        self.current.follow(stored)
        change = runs.rebooted(stored, self._scan_outcome(stored, scanner))
        if change.events:
            self.apply(change)

    def _scan_outcome(self, run: Run, scanner: Scanner) -> ScanResult | ScanFailed | None:
        """Ask the scanner how the scan ended that was running when the program ended."""
        stop = runs.stop_of(run, self.current.mission)
        if stop is None or run.stop_state != "SCANNING":
            return None
        return scanner.scan_outcome(label(run, stop))

    def _shorten_lease(self, command_ns: int) -> None:
        """Shorten a lease that was stored while the date was far ahead; it would last until then."""
        lease = self.lease
        until_ns = command_ns + lasting_ns()
        if lease is not None and lease.until_ns > until_ns:
            self.store_lease(msgspec.structs.replace(lease, until_ns=until_ns))

    # Storing, then adopting

    def advance(self, run: Run, move: Callable[[Run], Change]) -> None:
        """Store the result of work that began in `run`, if the work still belongs to the current run."""
        with self.lock:
            if self._control.closing or not same_work(run, self._run):
                return
            self.apply(move(self._run))

    def apply(self, change: Change, *, interrupts: bool = False) -> None:
        """Store the change and make its run the current one; if it `interrupts`, the current work ends."""
        self.adopt(self.store(change), interrupts=interrupts)

    def store(self, change: Change) -> Run:
        """Store the change, and the change to a revision that waited for it; return the resulting run."""
        change = revision.dropped(change)
        run = change.run
        with self.journal.transaction():
            self.pending.store(self.journal)
            self._store_change(change)
            if run.next_revision is None or run.at <= self._run.at:
                return run
            mission = self.current.accepted(run.mission_id, run.next_revision)
            assert mission is not None
            revised = revision.taken(run, mission)
            self._store_change(revised)
        return revised.run

    def store_lease(self, lease: Lease | None) -> None:
        if lease is not None:
            self.journal.store_fact("lease", lease)

    def adopt(self, run: Run, *, interrupts: bool = False) -> None:
        """Make a stored run the current one; with it all pending writes are stored."""
        self.pending.clear()
        self._set_current(run, interrupts=interrupts)

    def _store_change(self, change: Change) -> None:
        self.journal.store_change(change, robot=self.robot, boot_id=self.boot_id, now_ns=self._clock.now_ns())

    def _set_current(self, run: Run, *, interrupts: bool) -> None:
        self._run = run
        self.current.follow(run)
        if interrupts:
            self._control.interrupt_work(run)
        self._control.wake.set()
        self._changed()

    # When the disk takes nothing

    def hold_unstored(self, error: sqlite3.DatabaseError) -> Refused:
        """Stop, for the robot must not do what it cannot store; HELD until somebody decides.

        A robot that is held for this already stays as it is, so that pending writes do not grow.
        """
        reason = f"the journal cannot be written: {error}"
        with self._control.standing(), self.lock:
            held_before = self._run.state == "HELD" and self._run.reason == reason
            if not (self._run.over or held_before):
                held = runs.held(self._run, reason)
                self.pending.add(self._events_of(held))
                self._set_current(held.run, interrupts=True)
        return Refused("storage", reason)

    def adopt_unstored(self, change: Change, order: RunCommand, answer: Answer) -> None:
        """Make a run the current one that the journal could not take; it is stored later."""
        self.pending.add(self._events_of(change), order, answer)
        self._set_current(change.run, interrupts=True)

    def store_pending(self) -> None:
        """Store the pending writes if the disk has space again; until then the run stays as it is."""
        if self.pending:
            with contextlib.suppress(sqlite3.DatabaseError), self.lock:
                self.apply(Change(self._run))

    def _events_of(self, change: Change) -> Iterator[AnyEvent]:
        now_ns = self._clock.now_ns()
        return runs.events_of(change, robot=self.robot, boot_id=self.boot_id, now_ns=now_ns)
