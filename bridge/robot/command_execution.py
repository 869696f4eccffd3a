"""Commands to a robot: each is decided, stored with its answer, and only then carried out.

`pause` and `abort` are the other way round: the base is commanded to stand before anything is decided,
read or stored, and no drive begins until the decision is in force. They are carried out even if the journal
cannot be written; every other command is then refused. A command that comes again under its id is answered as
before.
"""

from __future__ import annotations

import sqlite3
from collections import OrderedDict
from dataclasses import dataclass

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.answers import answer_to, answered, not_stopped, remember_answer, situation_of
from stopgo.bridge.robot.base import Base, finds_way
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.run_store import RunStore
from stopgo.bridge.robot.work_control import WorkControl
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import Decision, Situation, decide
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.run_commands import FREE_VERBS, Answer, Refused, RunCommand
from stopgo.mission.run.states import Run

STOPS_KEPT = 1000
"""Answers to stops of this boot that are kept in memory."""


@dataclass(frozen=True)
class TentativeDecision:
    """The decision on a command, valid only if run and lease are still the same."""

    run: Run
    lease: Lease | None
    decision: Decision | Refused


class CommandExecutor:
    """Decides and answers commands; called from the link's threads."""

    def __init__(
        self, store: RunStore, *, control: WorkControl, base: Base, clock: Clock, command_clock: Clock
    ) -> None:
        self._store = store
        self._control = control
        self._base = base
        self._clock = clock
        self._command_clock = command_clock
        self._stops: OrderedDict[str, tuple[RunCommand, Answer]] = OrderedDict()
        """Answered stops of this boot: one that comes again must not stop a resumed robot."""

    def execute(self, order: RunCommand) -> Answer:
        """Carry out a command once, however often it comes, and store the answer."""
        if order.verb in FREE_VERBS:
            return self._stop(order)
        try:
            return self._decide_and_store(order)
        except sqlite3.DatabaseError as error:
            return self._answer(order, self._store.hold_unstored(error))

    # Stops

    def _stop(self, order: RunCommand) -> Answer:
        """Command the base to stand, then decide a pause or an abort, and store it."""
        known = self._stops.get(order.cmd_id)
        if known is not None and known[0] == order:
            return known[1]
        store = self._store
        with self._control.standing() as fault, store.lock:
            answer = self._before(order) or self._carry_out_stop(
                order, decide(order, self._stop_situation()), fault
            )
        self._stops.setdefault(order.cmd_id, (order, answer))
        if len(self._stops) > STOPS_KEPT:
            self._stops.popitem(last=False)
        return answer

    def _before(self, order: RunCommand) -> Answer | None:
        """Return the earlier answer to a stop; `None` if there is none, or it cannot be read."""
        try:
            return self._store.pending.answered(order) or answered(
                self._store.journal, order, self._store.run
            )
        except sqlite3.DatabaseError:
            return None

    def _stop_situation(self) -> Situation:
        store = self._store
        return self._situation(store.run, store.current.mission, None)

    def _carry_out_stop(
        self, order: RunCommand, decision: Decision | Refused, fault: Exception | None
    ) -> Answer:
        """Carry out a stop whatever the disk says; what cannot be stored is stored later."""
        answer = self._answer(order, decision)
        if fault is not None:
            answer = not_stopped(answer, fault)
        try:
            run = self._store_decision(order, decision, answer)
        except sqlite3.DatabaseError as error:
            return self._carry_out_unstored(order, decision, answer, error)
        if isinstance(decision, Decision):
            self._store.adopt(run, interrupts=True)
        return answer

    def _carry_out_unstored(
        self, order: RunCommand, decision: Decision | Refused, answer: Answer, error: sqlite3.DatabaseError
    ) -> Answer:
        if isinstance(decision, Refused):
            return answer
        message = f"done; the journal cannot be written yet: {error}"
        noted = f"{message}; {answer.message}" if answer.message else message
        answer = msgspec.structs.replace(answer, message=noted)
        self._store.adopt_unstored(decision.change, order, answer)
        return answer

    # All other commands

    def _decide_and_store(self, order: RunCommand) -> Answer:
        """Decide without the lock, for a stop must not wait for it; again if the run changed meanwhile."""
        store = self._store
        while True:
            tentative = self._decide_unlocked(order)
            with store.lock:
                before = store.pending.answered(order) or answered(store.journal, order, store.run)
                if before is not None:
                    return before
                if (tentative.run, tentative.lease) == (store.run, store.lease):
                    return self._carry_out(order, tentative.decision)

    def _decide_unlocked(self, order: RunCommand) -> TentativeDecision:
        """Decide by the run and the lease of this moment."""
        store = self._store
        with store.lock:
            run, mission, lease = store.run, store.current.mission, store.lease
        return TentativeDecision(run, lease, decide(order, self._situation(run, mission, store.journal)))

    def _situation(self, run: Run, mission: Mission | None, journal: Journal | None) -> Situation:
        base = self._base
        return situation_of(
            journal, mission, run=run, pose=base.pose(), now_ns=self._clock.now_ns(),
            command_ns=self._command_clock.now_ns(), battery=base.battery(),
            endurance_s=base.endurance_s(), not_ready=base.not_ready(),
            finds_way=finds_way(base), boot_id=self._store.boot_id,
        )  # fmt: skip

    def _carry_out(self, order: RunCommand, decision: Decision | Refused) -> Answer:
        """Store the decision and its answer, then make it the current run."""
        answer = self._answer(order, decision)
        run = self._store_decision(order, decision, answer)
        if isinstance(decision, Decision):
            self._store.adopt(run, interrupts=True)
        return answer

    def _store_decision(self, order: RunCommand, decision: Decision | Refused, answer: Answer) -> Run:
        store = self._store
        run = store.run
        with store.journal.transaction():
            if isinstance(decision, Decision):
                run = store.store(decision.change)
                store.store_lease(decision.lease)
            remember_answer(store.journal, order, answer)
        return run

    def _answer(self, order: RunCommand, decision: Decision | Refused) -> Answer:
        if isinstance(decision, Refused):
            return answer_to(order, decision, self._store.run)
        return answer_to(order, None, decision.change.run, decision.note)
