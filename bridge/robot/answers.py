"""What an order is decided by, and what was answered: one that comes again is carried out once."""

from __future__ import annotations

import hashlib
import uuid
from typing import Any

from stopgo.bridge.link.protocol import encode
from stopgo.bridge.robot.journal import ANSWERS_KEPT, Journal
from stopgo.mission.document import Mission
from stopgo.mission.run.decision import Situation
from stopgo.mission.run.lease import Lease
from stopgo.mission.run.orders import Answer, Order, Refused
from stopgo.mission.run.states import Run


def answered(journal: Journal, order: Order, run: Run) -> Answer | None:
    """The answer that this very order got before; another order under its id is refused."""
    before = journal.answer(order.cmd_id)
    if before is None:
        return None
    sha256, answer = before
    if sha256 == _sha256(order):
        return answer
    reused = Refused("id_reused", f"command id {order.cmd_id} was used for another order")
    return answer_to(order, reused, run)


def answer_to(order: Order, refused: Refused | None, run: Run) -> Answer:
    """What is answered to an order, and what the run is then."""
    return Answer(
        cmd_id=order.cmd_id, verb=order.verb, outcome="refused" if refused else "ok",
        reason=refused.reason if refused else None, message=refused.message if refused else "",
        run_id=run.run_id, state=run.state,
    )  # fmt: skip


def remember_answer(journal: Journal, order: Order, answer: Answer, *, keep: int = ANSWERS_KEPT) -> None:
    """Store it with the order it belongs to, and forget all but the newest."""
    with journal.transaction():
        journal.store_answer(_sha256(order), answer)
        journal.forget_answers(keep=keep)


def situation_of(journal: Journal, mission: Mission | None, **seen: Any) -> Situation:
    """All that an order is decided by: what is seen now, and what the journal knows of it."""
    has_run = mission is not None and journal.has_run(mission.id, mission.revision)
    lease, new_run_id = journal.fact("lease", Lease), uuid.uuid4().hex[:12]
    return Situation(mission=mission, has_run=has_run, lease=lease, new_run_id=new_run_id, **seen)


def _sha256(order: Order) -> str:
    return hashlib.sha256(encode(order)).hexdigest()
