"""Commands to a robot: each is decided, stored with its answer, and only then carried out.

A command that comes again under its id is answered as before. `pause` and `abort` are carried out even if
the journal cannot be written; every other command is then refused.
"""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.answers import answer_to, answered, remember_answer, situation_of
from stopgo.bridge.robot.base import Base
from stopgo.bridge.robot.run_store import RunStore
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import Decision, Situation, decide
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.orders import FREE_VERBS, Answer, Order, Refused
from stopgo.mission.run.states import Run


@dataclass(frozen=True)
class TentativeDecision:
    """The decision on a command, valid only if run and lease are still the same."""

    run: Run
    lease: Lease | None
    decision: Decision | Refused


class CommandExecutor:
    """Decides and answers commands; called from the link's threads."""

    def __init__(self, store: RunStore, *, base: Base, clock: Clock, command_clock: Clock) -> None:
        self._store = store
        self._base = base
        self._clock = clock
        self._command_clock = command_clock

    def execute(self, order: Order) -> Answer:
        """Carry out a command once, however often it comes, and store the answer.

        To decide whether a robot may drive takes long for a long mission, and is done without the lock:
        a pause or an abort must not wait for it. These two are decided at once.
        """
        store = self._store
        while True:
            tentative = None if order.verb in FREE_VERBS else self._decide_unlocked(order)
            with store.lock:
                before = store.pending.answered(order) or answered(store.journal, order, store.run)
                if before is not None:
                    return before
                if tentative is None:
                    situation = self._situation(store.run, store.current.mission)
                    return self._carry_out(order, decide(order, situation))
                if (tentative.run, tentative.lease) == (store.run, store.lease):
                    return self._carry_out(order, tentative.decision)

    def _decide_unlocked(self, order: Order) -> TentativeDecision:
        """Decide by the run and the lease of this moment."""
        store = self._store
        with store.lock:
            run, mission, lease = store.run, store.current.mission, store.lease
        return TentativeDecision(run, lease, decide(order, self._situation(run, mission)))

    def _situation(self, run: Run, mission: Mission | None) -> Situation:
        base = self._base
        return situation_of(
            self._store.journal, mission, run=run, pose=base.pose(), now_ns=self._clock.now_ns(),
            command_ns=self._command_clock.now_ns(), battery=base.battery(),
            endurance_s=base.endurance_s(), not_ready=base.not_ready(), boot_id=self._store.boot_id,
        )  # fmt: skip

    def _carry_out(self, order: Order, decision: Decision | Refused) -> Answer:
        """Store the decision and its answer, then make it the current run."""
        answer = self._answer(order, decision)
        try:
            run = self._store_decision(order, decision, answer)
        except sqlite3.OperationalError as error:
            return self._carry_out_unstored(order, decision, error)
        if isinstance(decision, Decision):
            self._store.adopt(run, interrupts=True)
        return answer

    def _store_decision(self, order: Order, decision: Decision | Refused, answer: Answer) -> Run:
        store = self._store
        run = store.run
        with store.journal.transaction():
            if isinstance(decision, Decision):
                run = store.store(decision.change)
                store.store_lease(decision.lease)
            remember_answer(store.journal, order, answer)
        return run

    def _carry_out_unstored(
        self, order: Order, decision: Decision | Refused, error: sqlite3.OperationalError
    ) -> Answer:
        """Carry out a pause or an abort whatever the disk says, and store it later; refuse other commands."""
        if order.verb not in FREE_VERBS:
            return self._answer(order, self._store.hold_unstored(error))
        answer = self._answer(order, decision)
        if isinstance(decision, Refused):
            return answer
        answer = msgspec.structs.replace(answer, message=f"done; the journal cannot be written yet: {error}")
        self._store.adopt_unstored(decision.change, order, answer)
        return answer

    def _answer(self, order: Order, decision: Decision | Refused) -> Answer:
        refused = decision if isinstance(decision, Refused) else None
        run = decision.change.run if isinstance(decision, Decision) else self._store.run
        return answer_to(order, refused, run)
