"""What was answered to each order: one that comes again gets its answer again, and is carried out once."""

from __future__ import annotations

import hashlib

from bridge.commands import Refused
from bridge.journal import ANSWERS_KEPT, Journal
from bridge.protocol import Answer, Command, encode
from bridge.run import Run


def answered(journal: Journal, command: Command, run: Run) -> Answer | None:
    """The answer that this very order got before; another order under its id is refused."""
    before = journal.answer(command.cmd_id)
    if before is None:
        return None
    order, answer = before
    if order == _order(command):
        return answer
    reused = Refused("id_reused", f"command id {command.cmd_id} was used for another order")
    return answer_to(command, reused, run)


def answer_to(command: Command, refused: Refused | None, run: Run) -> Answer:
    """What is answered to an order, and what the run is then."""
    return Answer(
        cmd_id=command.cmd_id, verb=command.verb, outcome="refused" if refused else "ok",
        reason=refused.reason if refused else None, message=refused.message if refused else "",
        run_id=run.run_id, state=run.state,
    )  # fmt: skip


def remember_answer(journal: Journal, command: Command, answer: Answer, *, keep: int = ANSWERS_KEPT) -> None:
    """Store it with the order it belongs to, and forget all but the newest."""
    with journal.transaction():
        journal.store_answer(_order(command), answer)
        journal.forget_answers(keep=keep)


def _order(command: Command) -> str:
    return hashlib.sha256(encode(command)).hexdigest()
