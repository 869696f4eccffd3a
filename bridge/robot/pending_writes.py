"""Events and answers that the journal could not take; they are stored when the disk has space again."""

from __future__ import annotations

from collections.abc import Iterable

from stopgo.bridge.robot.answers import remember_answer
from stopgo.bridge.robot.journal import Journal
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_commands import Answer, RunCommand


class PendingWrites:
    """Events and answers in their order, in memory only: lost if the power fails before they are stored."""

    def __init__(self) -> None:
        self._events: list[AnyEvent] = []
        self._answers: dict[str, tuple[RunCommand, Answer]] = {}

    def __bool__(self) -> bool:
        return bool(self._events or self._answers)

    def add(
        self, events: Iterable[AnyEvent], order: RunCommand | None = None, answer: Answer | None = None
    ) -> None:
        self._events += events
        if order is not None and answer is not None:
            self._answers[order.cmd_id] = (order, answer)

    def answered(self, order: RunCommand) -> Answer | None:
        """Return the answer to this same command; `None` if there is none."""
        before = self._answers.get(order.cmd_id)
        return before[1] if before is not None and before[0] == order else None

    def store(self, journal: Journal) -> None:
        """Write all of it in the caller's transaction; call `clear` after the commit."""
        for event in self._events:
            journal.append(event)
        for order, answer in self._answers.values():
            remember_answer(journal, order, answer)

    def clear(self) -> None:
        self._events.clear()
        self._answers.clear()
