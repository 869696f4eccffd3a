"""The robot's controller: one run, its journal, and the base and scanner that carry it out.

The parts, each in a module of its own; each uses only those above it:

work_control        `WorkControl`: stops the base, interrupts and wakes the work. It stores nothing.
current_mission     `CurrentMission`: the mission of the current run.
run_store           `RunStore`: the current run; writes each change to the journal before it counts;
                    restores the run after a restart; keeps in memory what a full disk does not take.
storage_watchdog    `StorageWatchdog`: stops the base where the journal does not answer while it drives.
run_driver          `RunDriver`: drives the legs, settles, scans and verifies, one piece of work at a time.
command_execution   `CommandExecutor`: decides commands, stores and answers them.
mission_acceptance  `MissionAcceptance`: accepts or rejects missions that stations push.

Threads
    The controller's own thread (`serve`) drives and scans. Only it calls `goto` and `scan`.
    The link's threads call `execute`, `take`, `hold` and `on_link_silence`. They change the run and interrupt
    work that no longer belongs to it. They never drive; they stop the base before they store a stop.
    The watchdog's thread (`StorageWatchdog.watch`) takes no lock; it stops the base while one is held long.
    Any thread may call `snapshot`, `position`, `battery`, `run`, `lease` and `close`.

Locks
    `RunStore.lock` guards the current run, its mission and the pending writes. It is
    held for a decision and its write, never while the robot drives, settles or scans. Slow checks of a long
    mission run without it. They are repeated if the run has changed meanwhile.
    The journal has a lock of its own, taken after `RunStore.lock` and never before it.
    `WorkControl` has no lock, only events. So a stop needs to wait for nothing (`WorkControl.standing`).

Invariants
    1. The journal has a change on disk before the robot acts on it and before it reports it to anybody. Only
       a stop is different: the base is commanded to stand first, and stays until the journal has the stop.
    2. A decision, its lease, its events and its answer are one transaction. So are a mission, its lease and
       the run's change to it.
    3. The result of work is stored only if the work still belongs to the current run (`same_work`).
    4. After a restart nothing moves until a command comes. An interrupted scan is taken again, unless the
       scanner says that it was completed.
    5. If the journal cannot be written, or does not answer for 0.5 s while the robot drives, the robot stands
       still and is HELD. `pause` and `abort` are carried out anyway.
"""

from __future__ import annotations

import sqlite3
import uuid
from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.protocol import Commit, Rejected
from stopgo.bridge.robot.base import Base, BaseHealth, Scanner
from stopgo.bridge.robot.command_execution import CommandExecutor
from stopgo.bridge.robot.current_mission import CurrentMission
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.mission_acceptance import MissionAcceptance
from stopgo.bridge.robot.run_driver import RunDriver
from stopgo.bridge.robot.run_store import RunStore
from stopgo.bridge.robot.runner import Position
from stopgo.bridge.robot.storage_watchdog import LATE, StorageWatchdog
from stopgo.bridge.robot.work_control import WorkControl
from stopgo.mission.document import Mission
from stopgo.mission.run import states as runs
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.revision import RevisionPolicy
from stopgo.mission.run.run_commands import Answer, RunCommand
from stopgo.mission.run.states import Run

REPORT_WITHIN_S = 0.1
"""Longest wait of a report for a decision that is being stored."""


def new_boot_id() -> str:
    """Return an id that no other start of a robot's program has."""
    return uuid.uuid4().hex[:12]


class Controller:
    """Carries out a mission with a base and a scanner, and the commands of stations."""

    def __init__(
        self,
        *,
        robot: str,
        journal: Journal,
        base: Base,
        scanner: Scanner,
        clock: Clock,
        command_clock: Clock | None = None,
        mission_taken: Callable[[Mission], None] = lambda mission: None,
        revisions: RevisionPolicy = "next-stop",
        boot_id: str | None = None,
        say: Callable[[str], None] = lambda line: None,
    ) -> None:
        command_clock = command_clock or clock
        self.changed: Callable[[], None] = lambda: None
        """Called after every stored change."""
        self._base = base
        self._clock = clock
        self._control = control = WorkControl(base)
        self._store = store = RunStore(
            robot=robot, boot_id=boot_id or new_boot_id(), journal=journal, clock=clock, control=control,
            current=CurrentMission(journal, mission_taken), changed=self._report_change,
        )  # fmt: skip
        self._watchdog = StorageWatchdog(control, journal.rows.waits, self.hold, say)
        self.works: tuple[Callable[[], None], ...] = (self.serve, self._watchdog.watch)
        self._driver = RunDriver(store, control=control, base=base, scanner=scanner, clock=clock)
        self._commands = CommandExecutor(
            store, control=control, base=base, clock=clock, command_clock=command_clock
        )
        self._missions = MissionAcceptance(store, base=base, command_clock=command_clock, revisions=revisions)
        fault = control.try_to_stop()
        if fault is not None and not base.not_ready():
            raise fault
        store.restore(scanner, command_ns=command_clock.now_ns())

    @property
    def boot_id(self) -> str:
        return self._store.boot_id

    @property
    def run(self) -> Run:
        return self._store.run

    @property
    def lease(self) -> Lease | None:
        """The lease of the station that commands the robot, or was the last to."""
        return self._store.lease

    def _report_change(self) -> None:
        self.changed()

    # Commands and missions, from the link's threads

    def execute(self, order: RunCommand) -> Answer:
        """Carry out a command once, however often it comes, and store the answer."""
        with self._control.standing_on_error():
            return self._commands.execute(order)

    def take(self, commit: Commit, mission: Mission) -> Rejected | None:
        """Store a whole mission and make it the one to be run, or to be followed from the next stop on."""
        with self._control.standing_on_error():
            try:
                return self._missions.take(commit, mission)
            except sqlite3.DatabaseError as error:
                refused = self._store.hold_unstored(error)
                return Rejected(reason=refused.reason, messages=(refused.message,))

    def waits(self, mission: Mission) -> bool:
        """True if the robot will follow the mission from the next stop on."""
        return self._missions.waits(mission)

    def hold(self, reason: str) -> None:
        """Hold the run, if the robot drives or scans, until a command comes."""
        if self._store.run.state in ("RUNNING", "HOMING"):
            self._stop_and_store(lambda: self._hold(reason))

    def _hold(self, reason: str) -> None:
        if self._store.run.state in ("RUNNING", "HOMING"):
            self._store.apply(runs.held(self._store.run, reason), interrupts=True)

    def pause_scanning(self, reason: str) -> bool:
        """Pause a run whose base somebody else has put on hold; the scan goes on. True if it is paused."""
        with self._store.lock:
            run = self._store.run
            if (run.state, run.stop_state) == ("RUNNING", "SCANNING"):
                self._store.apply(runs.paused(run, reason))
            return self._store.run.state == "PAUSED"

    def on_link_silence(self, silent_s: float) -> None:
        """Do what the mission's policy wants after `silent_s` seconds without data from any station."""
        with self._control.standing_on_error():
            self._driver.silent_s = silent_s
            if self._driver.stops_for_link(*self._store.glance()):
                self._stop_and_store(lambda: self._lose_link(silent_s))
            self._store.store_pending()

    def _lose_link(self, silent_s: float) -> None:
        run, mission = self._store.snapshot()
        if mission is not None and self._driver.stops_for_link(run, mission):
            self._store.apply(runs.link_lost(run, mission, silent_s), interrupts=True)

    def _stop_and_store(self, change: Callable[[], None]) -> None:
        """Command the base to stand, then change the run; HELD if the journal does not take the change."""
        with self._control.standing():
            try:
                with self._store.lock:
                    change()
            except sqlite3.DatabaseError as error:
                self._store.hold_unstored(error)

    def stand_still(self, error: BaseException) -> None:
        """Command the base to stand until the program ends, before anything is written."""
        self._control.stand_for_good(error)

    # The work, in the controller's own thread

    def serve(self) -> None:
        """Work until closed, then stop the base."""
        control = self._control
        try:
            while not control.closing:
                control.wake.clear()
                if control.failure is not None:
                    raise control.failure
                if not self._step_if_storable():
                    control.wake.wait()
        finally:
            control.stop_base()

    def step(self) -> bool:
        """Do the next piece of work; false if there is none."""
        return self._driver.step()

    def _step_if_storable(self) -> bool:
        """Do the next piece of work; false if there is none, or if its result could not be stored."""
        try:
            return self.step()
        except sqlite3.DatabaseError as error:
            self._store.hold_unstored(error)
            return False

    def close(self) -> None:
        """End the work where the robot is; the next boot continues with the run as it is stored."""
        self._control.close()

    # Reports, to any thread

    def snapshot(self) -> tuple[Run, Mission | None]:
        """Return the run and its mission; HELD while the robot stands because its journal does not answer."""
        run, mission = self._store.snapshot_within(REPORT_WITHIN_S)
        if self._watchdog.late and run.state in ("RUNNING", "HOMING"):
            run = runs.changed(run, state="HELD", reason=LATE)
        return run, mission

    def position(self) -> Position:
        ns, pose, speed = self._clock.now_ns(), self._base.pose(), self._base.speed()
        self._driver.standstill.take(pose, speed)
        return Position(pose, speed, ns)

    def battery(self) -> float | None:
        return self._base.battery()

    def health(self) -> BaseHealth:
        return self._base.health()
