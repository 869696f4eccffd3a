"""Answers to commands, stored so that a command that comes again is carried out once."""

from __future__ import annotations

import hashlib
import uuid
from typing import Any

import msgspec

from stopgo.bridge.link.protocol import encode
from stopgo.bridge.robot.journal import ANSWERS_KEPT, Journal
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import Situation
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.run_commands import Answer, Refused, RunCommand
from stopgo.mission.run.states import Run


def answered(journal: Journal, order: RunCommand, run: Run) -> Answer | None:
    """Return the earlier answer to this same command; another command under its id is refused."""
    before = journal.answer(order.cmd_id)
    if before is None:
        return None
    sha256, answer = before
    if sha256 == _sha256(order):
        return answer
    reused = Refused("id_reused", f"command id {order.cmd_id} was used for another command")
    return answer_to(order, reused, run)


def answer_to(order: RunCommand, refused: Refused | None, run: Run, note: str = "") -> Answer:
    """Return the answer to a command, with the state of the run after it; `note` is added if it was done."""
    return Answer(
        cmd_id=order.cmd_id, verb=order.verb, outcome="refused" if refused else "ok",
        reason=refused.reason if refused else None, message=refused.message if refused else note,
        run_id=run.run_id, state=run.state,
    )  # fmt: skip


def not_stopped(answer: Answer, fault: Exception) -> Answer:
    """Return the answer to a stop that the base did not take; the run is paused or aborted all the same."""
    message = (
        f"the base did not take the command to stand ({fault or type(fault).__name__}): use the emergency"
        f" stop; the run is {answer.state}, and the robot's program ends"
    )
    return msgspec.structs.replace(answer, outcome="refused", reason="not_stopped", message=message)


def remember_answer(journal: Journal, order: RunCommand, answer: Answer, *, keep: int = ANSWERS_KEPT) -> None:
    """Store an answer with the hash of its command, and delete all but the newest."""
    with journal.transaction():
        journal.store_answer(_sha256(order), answer)
        journal.forget_answers(keep=keep)


def situation_of(journal: Journal | None, mission: Mission | None, **observed: Any) -> Situation:
    """Return all that a decision depends on: what was `observed`, and what the journal has.

    Without a journal it is enough for a pause or an abort.
    """
    has_run, lease, new_run_id = False, None, uuid.uuid4().hex[:12]
    if journal is not None:
        has_run = mission is not None and journal.has_run(mission.id, mission.revision)
        lease = journal.fact("lease", Lease)
    return Situation(mission=mission, has_run=has_run, lease=lease, new_run_id=new_run_id, **observed)


def _sha256(order: RunCommand) -> str:
    return hashlib.sha256(encode(order)).hexdigest()
