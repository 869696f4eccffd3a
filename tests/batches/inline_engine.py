"""An engine for tests: entries end at once, in the process of the test."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from stopgo.batches.work import PlanOutcome, PlanTask

Work = Callable[[PlanTask], PlanOutcome]


class InlineEngine:
    """Slots that work on an entry as soon as it is submitted."""

    def __init__(self, slots: int, work: Work, memory: float = 1e12) -> None:
        self.slots = slots
        self.memory = memory
        self.work = work
        self.begun: list[tuple[int, str]] = []
        self.renewed: list[int] = []
        self.closed = False
        self.own_fault = True
        """Answer of `renew`: only the slot's own process had ended."""

    def submit(self, slot: int, task: PlanTask, *, roomiest: bool = False) -> Future[PlanOutcome]:
        self.begun.append((slot, task.name))
        future: Future[PlanOutcome] = Future()
        try:
            future.set_result(self.work(task))
        except Exception as error:  # noqa: BLE001  where the fake process ends
            future.set_exception(error)
        return future

    def renew(self, slot: int) -> bool:
        self.renewed.append(slot)
        return self.own_fault

    def look(self) -> None: ...

    def close(self, *, at_once: bool) -> None:
        self.closed = True
