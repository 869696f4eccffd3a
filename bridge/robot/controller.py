"""Drives a mission stop by stop: every step is stored before it is taken, so that a crash repeats none.

Each stop goes WAITING, NAVIGATING, SETTLING, SCANNING, VERIFYING, DONE; `run` says what each outcome leads
to, `commands` what each order does. This module is where they meet the robot, the journal and the clock.
"""

from __future__ import annotations

import contextlib
import sqlite3
import threading
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.protocol import Commit, Rejected
from stopgo.bridge.robot.answers import answer_to, answered, remember_answer, situation_of
from stopgo.bridge.robot.base import Base, Scanner
from stopgo.bridge.robot.current_task import faces, has_work, label, moved, same_work
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.mission_fitness import follows, weighed_by, why_unfit
from stopgo.bridge.robot.mission_reading import read_mission
from stopgo.bridge.robot.pending_writes import PendingWrites
from stopgo.bridge.robot.runner import Position
from stopgo.mission.document import Mission
from stopgo.mission.run import revision, route_position
from stopgo.mission.run import states as runs
from stopgo.mission.run.decision import Decision, Situation, decide, handed_over
from stopgo.mission.run.events import AnyEvent, Pose
from stopgo.mission.run.lease import Lease, claimed, lasting_ns
from stopgo.mission.run.orders import FREE_VERBS, Answer, Order, Refused
from stopgo.mission.run.revision import RevisionPolicy
from stopgo.mission.run.scans import ScanFailed, ScanResult
from stopgo.mission.run.states import Change, Run
from stopgo.mission.run.tolerance import deviation, is_outside

SETTLE_SAMPLE_S = 0.1
SETTLE_LIMIT_S = 30.0
"""How much longer than `settle_s` a robot may take to stand still."""


def new_boot_id() -> str:
    """What tells one start of a robot's program from every other."""
    return uuid.uuid4().hex[:12]


@dataclass(frozen=True)
class TentativeDecision:
    """What an order leads to, if nothing has changed since of what it was decided by."""

    run: Run
    lease: Lease | None
    decision: Decision | Refused


class Controller:
    """The robot's run, its journal, and the base and scanner that carry it out.

    `step` does one piece of work; `serve` calls it until `close`. Orders come from other threads: they
    change the run under the lock and interrupt the piece of work that no longer belongs to it.
    """

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
    ) -> None:
        self.robot = robot
        self.boot_id = boot_id or new_boot_id()
        self.changed: Callable[[], None] = lambda: None
        """Called after every stored change."""
        self.works: tuple[Callable[[], None], ...] = (self.serve,)
        self._journal = journal
        self._base = base
        self._scanner = scanner
        self._clock = clock
        self._command_clock = command_clock or clock
        self._mission_taken = mission_taken
        self._revisions = revisions
        self._lock = threading.RLock()
        self._interrupt = threading.Event()
        self._wake = threading.Event()
        self._closing = False
        self._silent_s = 0.0
        self._mission: Mission | None = None
        self._newest_mission: Mission | None = None
        """The one that was taken last."""
        self._run = Run()
        self._unstored = PendingWrites()
        self._recover()

    @property
    def run(self) -> Run:
        return self._run

    @property
    def lease(self) -> Lease | None:
        """Who commands the robot, or was the last to."""
        return self._journal.fact("lease", Lease)

    def _recover(self) -> None:
        """Stand still, and wait where the journal says the run was."""
        self._base.stop()
        self._mend_lease()
        kept = self._journal.fact("run", Run)
        if kept is None:
            return
        self._run = kept
        self._hold(self._stored(kept.mission_id, kept.revision))
        change = runs.rebooted(kept, self._what_became(kept))
        if change.events:
            self._keep(change)

    def _what_became(self, run: Run) -> ScanResult | ScanFailed | None:
        """What the scanner says of the scan that was under way when the program ended."""
        stop = runs.stop_of(run, self._mission)
        if stop is None or run.stop_state != "SCANNING":
            return None
        return self._scanner.scan_outcome(label(run, stop))

    def _mend_lease(self) -> None:
        """A lease from a time when the date was far ahead would last until then."""
        lease = self.lease
        until_ns = self._command_clock.now_ns() + lasting_ns()
        if lease is not None and lease.until_ns > until_ns:
            self._store_lease(msgspec.structs.replace(lease, until_ns=until_ns))

    def _hold(self, mission: Mission | None) -> None:
        self._mission = mission
        if mission is not None:
            self._mission_taken(mission)

    def _stored(self, mission_id: str | None, revision: int | None) -> Mission | None:
        """A mission that was taken: the last one without reading it again."""
        last = self._newest_mission
        if last is not None and (last.id, last.revision) == (mission_id, revision):
            return last
        held = None if mission_id is None else self._journal.mission(mission_id, revision or 0)
        return None if held is None else read_mission(held[1])

    # Orders and missions, from the link's threads

    def execute(self, order: Order) -> Answer:
        """Carry out an order once, however often it comes, and remember what was answered.

        Whether a robot may drive takes long to say of a long mission, and is weighed without the lock: a stop
        must not wait for it. One that stops is decided at once.
        """
        while True:
            weighed = None if order.verb in FREE_VERBS else self._weigh(order)
            with self._lock:
                before = self._unstored.answered(order) or answered(self._journal, order, self._run)
                if before is not None:
                    return before
                if weighed is None:
                    return self._decided(order, decide(order, self._situation()))
                if (weighed.run, weighed.lease) == (self._run, self.lease):
                    return self._decided(order, weighed.decision)

    def _weigh(self, order: Order) -> TentativeDecision:
        """What an order would lead to as all is now."""
        with self._lock:
            run, mission, lease = self._run, self._mission, self.lease
        return TentativeDecision(run, lease, decide(order, self._situation_of(run, mission)))

    def _decided(self, order: Order, decision: Decision | Refused) -> Answer:
        """Store what was decided, and its answer, and let it be so."""
        answer = self._answer(order, decision)
        try:
            run = self._store_decision(order, decision, answer)
        except sqlite3.OperationalError as error:
            return self._obeyed_unstored(order, decision, error)
        if isinstance(decision, Decision):
            self._adopt(run, ordered=True)
        return answer

    def _store_decision(self, order: Order, decision: Decision | Refused, answer: Answer) -> Run:
        run = self._run
        with self._journal.transaction():
            if isinstance(decision, Decision):
                run = self._write(decision.change)
                self._store_lease(decision.lease)
            remember_answer(self._journal, order, answer)
        return run

    def _store_lease(self, lease: Lease | None) -> None:
        if lease is not None:
            self._journal.store_fact("lease", lease)

    def hold(self, reason: str) -> None:
        """Stand still until somebody decides, if the robot is on its way."""
        with self._lock:
            if self._run.state in ("RUNNING", "HOMING"):
                self._adopt(self._write(runs.held(self._run, reason)), ordered=True)

    def _situation(self) -> Situation:
        return self._situation_of(self._run, self._mission)

    def _situation_of(self, run: Run, mission: Mission | None) -> Situation:
        return situation_of(
            self._journal, mission, run=run, pose=self._base.pose(), now_ns=self._clock.now_ns(),
            command_ns=self._command_clock.now_ns(), battery=self._base.battery(),
            endurance_s=self._base.endurance_s(), not_ready=self._base.not_ready(), boot_id=self.boot_id,
        )  # fmt: skip

    def _answer(self, order: Order, decision: Decision | Refused) -> Answer:
        refused = decision if isinstance(decision, Refused) else None
        run = decision.change.run if isinstance(decision, Decision) else self._run
        return answer_to(order, refused, run)

    def take(self, commit: Commit, mission: Mission) -> Rejected | None:
        """Store a whole mission and make it the one to be run, or to be followed from the next stop on.

        What takes long for a long mission is done before, without the lock: a stop must not wait for it.
        """
        while True:
            run, held = self.snapshot()
            unfit = None
            if not follows(run, mission):
                unfit = why_unfit(mission, base=self._base, run=run, held=held, revisions=self._revisions)
            with self._lock:
                if weighed_by(run) == weighed_by(self._run):
                    return self._take(commit, mission, unfit)

    def _take(self, commit: Commit, mission: Mission, unfit: Refused | None) -> Rejected | None:
        before = self.lease
        lease = claimed(
            before, commit.commander,
            fence=commit.fence, take_over=commit.take_over, now_ns=self._command_clock.now_ns(),
        )  # fmt: skip
        if isinstance(lease, Refused):
            return Rejected(reason=lease.reason, messages=(lease.message,))
        known = follows(self._run, mission)
        refused = self._out_of_time(commit, known) or unfit
        if refused:
            return Rejected(reason=refused.reason, messages=(refused.message,))
        change = Change(self._run) if known else self._taking(mission)
        with self._journal.transaction():
            self._journal.keep_transfer(commit.manifest)
            self._journal.store_nonce(commit.nonce, mission.digest)
            self._store_lease(lease)
            run = self._write(Change(change.run, (*handed_over(before, lease), *change.events)))
            self._journal.retire_missions(
                *((run.mission_id, wanted) for wanted in (run.revision, run.next_revision))
            )
        self._unstored.clear()
        if not known:
            self._newest_mission = mission
            self._adopt(run, ordered=run.over)
        return None

    def waits(self, mission: Mission) -> bool:
        """Whether the mission is to be followed from the next stop on."""
        run = self._run
        return (run.mission_id, run.next_revision) == (mission.id, mission.revision)

    def _taking(self, mission: Mission) -> Change:
        run = self._run
        return Change(runs.installed(run, mission)) if run.over else revision.waits(run, mission)

    def _out_of_time(self, commit: Commit, known: bool) -> Refused | None:
        """Why a commit comes too late, or once more."""
        if self._command_clock.now_ns() >= commit.not_after_ns:
            return Refused("expired", "the commit is older than it allows; push again")
        if not known and commit.boot_id not in (None, self.boot_id):
            return Refused("expired", "the robot has been started anew since the commit; push again")
        if not known and self._journal.nonce(commit.nonce) is not None:
            return Refused("replayed", "this commit was taken before, and another mission since; push again")
        return None

    def on_link_silence(self, silent_s: float) -> None:
        """Told how long no station has been heard; the mission's policy may want something of it."""
        with self._lock:
            self._silent_s = silent_s
            self._store_late()
            run, mission = self._run, self._mission
            if mission is None or not self._link_is_lost(mission) or run.state != "RUNNING":
                return
            at_once = mission.policy.link_loss in ("hold", "home")
            if at_once and run.stop_state in ("WAITING", "NAVIGATING", "SETTLING"):
                change = runs.link_lost(run, mission, silent_s)
                self._adopt(self._write(change), ordered=True)

    def _link_is_lost(self, mission: Mission) -> bool:
        """Whether it is, and matters."""
        policy = mission.policy
        return policy.link_loss != "continue" and self._silent_s >= policy.link_loss_after_s

    # The work, in the controller's own thread

    def serve(self) -> None:
        """Work until closed, and then stand still."""
        try:
            while not self._closing:
                self._wake.clear()
                if not self._stepped():
                    self._wake.wait()
        finally:
            self._base.stop()

    def _stepped(self) -> bool:
        """Whether there was something to do, and it could be stored."""
        try:
            return self.step()
        except sqlite3.OperationalError as error:
            self._halt_unstored(error)
            return False

    def close(self) -> None:
        """Stop where the robot is; the next boot finds the run as it was."""
        with self._lock:
            self._closing = True
            self._interrupt.set()
            self._wake.set()

    def step(self) -> bool:
        """The next piece of work; false if there is none."""
        with self._lock:
            run, mission = self._run, self._mission
            if self._closing or mission is None or not has_work(run):
                return False
            self._interrupt.clear()
        if run.state == "HOMING":
            self._drive_home(run, mission)
        else:
            WORK[run.stop_state](self, run, mission)
        return True

    def _leave(self, run: Run, mission: Mission) -> None:
        battery, silent_s = self._base.battery(), self._silent_s
        if self._link_is_lost(mission):
            self._advance(run, lambda now: runs.link_lost(now, mission, silent_s))
        elif battery < mission.policy.battery_min:
            reason = f"battery at {battery:.0%}, below {mission.policy.battery_min:.0%}"
            self._advance(run, lambda now: runs.sent_home(now, mission, then="PAUSED", reason=reason))
        else:
            self._advance(run, runs.leaving)

    def _navigate(self, run: Run, mission: Mission) -> None:
        """Drive what is left of the leg, or the correction to the stop."""
        stop, pose = mission.stops[run.at], self._base.pose()
        at_stop = run.leg > run.at
        path = (
            ((stop.x, stop.y),) if at_stop else route_position.forward(mission.stops[run.leg].approach, pose)
        )
        outcome = "arrived"
        stands = at_stop and not is_outside(deviation(pose, stop), stop.tolerance_m)
        if not (stands and faces(pose, stop)):
            heading = stop.heading if run.leg >= run.at else None
            outcome = self._base.goto(path, heading=heading, limits=mission.robot, interrupt=self._interrupt)
        here = self._base.pose()
        if outcome == "blocked":
            reason = self._blocked(f"the way to {stop.id}", here)
            self._advance(run, lambda now: runs.held(now, reason))
        elif outcome == "arrived":
            self._advance(run, lambda now: runs.reached(now, mission, here, deviation(here, stop)))

    def _settle(self, run: Run, mission: Mission) -> None:
        stop = mission.stops[run.at]
        still = self._stands_still(stop.settle_s)
        if still is None:
            return
        if not still:
            reason = f"not still within {stop.settle_s + SETTLE_LIMIT_S:g} s"
            self._advance(run, lambda now: runs.failed(now, mission, reason))
            return
        here = self._base.pose()
        self._advance(run, lambda now: runs.settled(now, mission, here, deviation(here, stop)))

    def _stands_still(self, settle_s: float) -> bool | None:
        """Whether the robot came to a stand for `settle_s`; `None` if interrupted."""
        waited, still_for, resting = 0.0, 0.0, self._base.pose()
        while still_for < settle_s:
            if waited > settle_s + SETTLE_LIMIT_S:
                return False
            pause = min(SETTLE_SAMPLE_S, settle_s - still_for)
            if self._clock.wait(pause, self._interrupt):
                return None
            waited, still_for, pose = waited + pause, still_for + pause, self._base.pose()
            if moved(resting, pose, self._base.rest()):
                still_for, resting = 0.0, pose
        return True

    def _scan(self, run: Run, mission: Mission) -> None:
        stop = mission.stops[run.at]
        result = self._scanner.scan(label(run, stop), stop.scan, interrupt=self._interrupt)
        self._advance(run, lambda now: runs.scan_ended(now, mission, result))

    def _verify(self, run: Run, mission: Mission) -> None:
        here = self._base.pose()
        self._advance(run, lambda now: runs.verified(now, mission, here))

    def _drive_home(self, run: Run, mission: Mission) -> None:
        legs, pose = route_position.legs_of(mission), self._base.pose()
        returning = run.leg == len(mission.stops)
        leg = legs[run.leg]
        path = route_position.forward(leg, pose) if returning else route_position.backward(leg, pose)
        outcome = self._base.goto(path, heading=None, limits=mission.robot, interrupt=self._interrupt)
        if outcome == "blocked":
            here = self._base.pose()
            reason = self._blocked("the way home", here)
            self._advance(run, lambda now: runs.held(now, reason))
        elif outcome == "arrived":
            self._advance(run, lambda now: runs.home_leg_driven(now, mission))

    def _blocked(self, way: str, here: Pose) -> str:
        why = self._base.blocked_by()
        return f"{way} is blocked at ({here.x:.2f}, {here.y:.2f})" + (f": {why}" if why else "")

    # Storing

    def _advance(self, run: Run, move: Callable[[Run], Change]) -> None:
        """Store what the work led to, unless an order has meanwhile made it meaningless."""
        with self._lock:
            if self._closing or not same_work(run, self._run):
                return
            self._keep(move(self._run))

    def _keep(self, change: Change) -> None:
        self._adopt(self._write(change))

    def _write(self, change: Change) -> Run:
        """Store the change, and the one to a revision that waited for it; the run that is then."""
        change = revision.dropped(change)
        run = change.run
        with self._journal.transaction():
            self._unstored.store(self._journal)
            self._put(change)
            if run.next_revision is None or run.at <= self._run.at:
                return run
            mission = self._stored(run.mission_id, run.next_revision)
            assert mission is not None
            revised = revision.taken(run, mission)
            self._put(revised)
        return revised.run

    def _put(self, change: Change) -> None:
        self._journal.store_change(
            change, robot=self.robot, boot_id=self.boot_id, now_ns=self._clock.now_ns()
        )

    def _told_of(self, change: Change) -> Iterator[AnyEvent]:
        now_ns = self._clock.now_ns()
        return runs.events_of(change, robot=self.robot, boot_id=self.boot_id, now_ns=now_ns)

    def _adopt(self, run: Run, *, ordered: bool = False) -> None:
        """What is stored is now what is; an order interrupts the work, except a scan that may end."""
        self._unstored.clear()
        self._become(run, ordered=ordered)

    def _become(self, run: Run, *, ordered: bool) -> None:
        self._run = run
        held = self._mission
        if (run.mission_id, run.revision) != (held and held.id, held and held.revision):
            self._hold(self._stored(run.mission_id, run.revision))
        if ordered and run.stop_state != "SCANNING":
            self._interrupt.set()
        self._wake.set()
        self.changed()

    def _halt_unstored(self, error: sqlite3.OperationalError) -> Refused:
        """Stand still, for what cannot be stored must not be done; held until the journal takes it again."""
        reason = f"the journal cannot be written: {error}"
        with self._lock:
            self._base.stop()
            if not self._run.over:
                held = runs.held(self._run, reason)
                self._unstored.add(self._told_of(held))
                self._become(held.run, ordered=True)
        return Refused("storage", reason)

    def _obeyed_unstored(
        self, order: Order, decision: Decision | Refused, error: sqlite3.OperationalError
    ) -> Answer:
        """A stop is carried out whatever the disk says, and stored later; any other order is refused."""
        if order.verb not in FREE_VERBS:
            return self._answer(order, self._halt_unstored(error))
        answer = self._answer(order, decision)
        if isinstance(decision, Refused):
            return answer
        answer = msgspec.structs.replace(answer, message=f"done; the journal cannot be written yet: {error}")
        self._unstored.add(self._told_of(decision.change), order, answer)
        self._become(decision.change.run, ordered=True)
        return answer

    def _store_late(self) -> None:
        """Once there is room again; until then the robot stands as it was told to."""
        if self._unstored:
            with contextlib.suppress(sqlite3.OperationalError):
                self._keep(Change(self._run))

    # What others may know

    def snapshot(self) -> tuple[Run, Mission | None]:
        with self._lock:
            return self._run, self._mission

    def position(self) -> Position:
        ns = self._clock.now_ns()
        return Position(self._base.pose(), self._base.speed(), ns)

    def battery(self) -> float:
        return self._base.battery()


WORK: dict[str, Callable[[Controller, Run, Mission], None]] = {
    "WAITING": Controller._leave,
    "NAVIGATING": Controller._navigate,
    "SETTLING": Controller._settle,
    "SCANNING": Controller._scan,
    "VERIFYING": Controller._verify,
}
