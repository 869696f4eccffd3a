"""Engines that work on many entries: processes of this machine, or the workers of a dask cluster.

Both are `concurrent.futures.Executor`. A slot takes one entry at a time. An entry whose process ended
(killed, or out of memory) is tried a second time, alone, when all others have ended; then it has failed.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import forkserver, get_context, parent_process
from multiprocessing.context import BaseContext
from typing import Protocol

from stopgo.batches.cluster_engine import ClusterEngine
from stopgo.batches.work import PlanOutcome, PlanTask, work
from stopgo.mission.console.process import kill_workers, without_ctrl_c

TRIES = 2
TICK_S = 0.5
PLANS_EACH = 10
"""Plans of one process; its memory grows by some megabytes with each."""


PRELOADED = "stopgo.planning_modules"


class Engine(Protocol):
    """Slots that work on one entry each."""

    @property
    def slots(self) -> int:
        """Entries at the same time; on a cluster the number may change."""
        ...

    @property
    def memory(self) -> float:
        """Bytes that all entries in progress may use together."""
        ...

    def submit(self, slot: int, task: PlanTask, *, roomiest: bool = False) -> Future[PlanOutcome]:
        """Begin an entry on a free slot, or where most memory is.

        Raises
        ------
        OutcomeUnknown
            When the machines that work are gone.
        """
        ...

    def renew(self, slot: int) -> bool:
        """Make a slot usable again; False if more than the slot's own process had ended."""
        ...

    def look(self) -> None:
        """Look at the machines that work; called while entries are in progress."""
        ...

    def close(self, *, at_once: bool) -> None:
        """End all slots; `at_once` ends what they are working on, too."""
        ...


class LocalEngine:
    """A process for each slot on this machine; one that dies takes no other with it."""

    def __init__(self, workers: int) -> None:
        self.slots = workers
        self.memory = free_memory()
        self._pools: list[Executor | None] = [None] * workers
        self._worked = [0] * workers
        """Plans that each slot's process has made."""

    def submit(self, slot: int, task: PlanTask, *, roomiest: bool = False) -> Future[PlanOutcome]:
        if self._worked[slot] >= PLANS_EACH:
            self.renew(slot)
        self._worked[slot] += 1
        pool = self._pools[slot]
        if pool is None:
            pool = self._pools[slot] = worker_process()
        return pool.submit(work, task)

    def renew(self, slot: int) -> bool:
        pool, self._pools[slot] = self._pools[slot], None
        self._worked[slot] = 0
        if pool is not None:
            pool.shutdown(wait=False, cancel_futures=True)
        return True

    def look(self) -> None:
        """A pool itself notices that its process ended."""

    def close(self, *, at_once: bool) -> None:
        for pool in self._pools:
            if pool is None:
                continue
            if at_once:
                kill_workers(pool)
            else:
                pool.shutdown(cancel_futures=True)
        if at_once:
            _end_forking()


def worker_process(count: int = 1) -> ProcessPoolExecutor:
    """Return processes that work on entries; they end with this one, and leave Ctrl-C to it."""
    return ProcessPoolExecutor(count, mp_context=_context(), initializer=_begin_worker)


def _context() -> BaseContext:
    """Start method of the processes; on Linux they are forks of one that has loaded what every plan uses."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    with without_ctrl_c():
        forkserver.ensure_running()
    return context


def _end_forking() -> None:
    """End the process that forks workers: one that still loads would fork for a batch that is gone."""
    process = getattr(getattr(forkserver, "_forkserver", None), "_forkserver_pid", None)
    if process is not None:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def _begin_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when the batch's own is gone: its pool would wait for entries for ever."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def engine_for(*, workers: int, scheduler: str | None) -> Engine:
    """Return the engine that the options choose."""
    if scheduler is None:
        return LocalEngine(workers)
    return ClusterEngine(scheduler)


@dataclass
class Running:
    """Entries in progress; each outcome is yielded when it is there."""

    engine: Engine
    tasks: Sequence[PlanTask]
    begun: Callable[[str], None] = lambda name: None
    """Called with the name of an entry that begins."""
    waiting: Callable[[], None] = lambda: None
    """Called while entries are in progress."""
    _tries: dict[str, int] = field(default_factory=dict)
    _now: dict[Future[PlanOutcome], tuple[int, PlanTask]] = field(default_factory=dict)

    def __enter__(self) -> Running:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: object) -> None:
        self.engine.close(at_once=kind is not None)

    def outcomes(self, stopped: Callable[[], bool] = lambda: False) -> Iterator[PlanOutcome]:
        """Work on all entries, the largest files first; once `stopped`, begin no more."""
        queue = deque(sorted(self.tasks, key=lambda task: task.memory, reverse=True))
        alone: deque[PlanTask] = deque()
        while queue or alone or self._now:
            if stopped():
                queue.clear()
                alone.clear()
            self._fill(queue)
            if not queue and not self._now and alone:
                self._start(0, alone.popleft(), roomiest=True)
            done, _ = wait(self._now, timeout=TICK_S, return_when=FIRST_COMPLETED)
            self.waiting()
            self.engine.look()
            ended = [self._ended(future, queue, alone) for future in done]
            if not stopped():
                self._fill(queue)  # the caller may need a while for each outcome
            yield from (outcome for outcome in ended if outcome is not None)

    def _ended(
        self, future: Future[PlanOutcome], queue: deque[PlanTask], alone: deque[PlanTask]
    ) -> PlanOutcome | None:
        """The outcome of an entry that ended; None if it is put into one of the queues for another try."""
        slot, task = self._now.pop(future)
        outcome = self._outcome_of(future, slot, task)
        if outcome is None:
            (alone if self._tries[task.name] else queue).append(task)
        return outcome

    def _fill(self, queue: deque[PlanTask]) -> None:
        """Begin entries while there are free slots and memory; one always runs."""
        free = [slot for slot in range(self.engine.slots) if slot not in {s for s, _ in self._now.values()}]
        for slot in free:
            used = sum(task.memory for _, task in self._now.values())
            fitting = next((t for t in queue if not self._now or used + t.memory <= self.engine.memory), None)
            if fitting is None:
                return
            queue.remove(fitting)
            self._start(slot, fitting)

    def _start(self, slot: int, task: PlanTask, *, roomiest: bool = False) -> None:
        future = self.engine.submit(slot, task, roomiest=roomiest)
        self._tries[task.name] = self._tries.get(task.name, 0) + 1
        self.begun(task.name)
        self._now[future] = (slot, task)

    def _outcome_of(self, future: Future[PlanOutcome], slot: int, task: PlanTask) -> PlanOutcome | None:
        """The outcome; None if the entry is to be tried again."""
        try:
            return future.result()
        except (BrokenProcessPool, CancelledError):
            if not self.engine.renew(slot):
                self._tries[task.name] -= 1  # the entry has no part in this
                return None
        except Exception as error:  # noqa: BLE001  where the entry's process ends
            if type(error).__name__ != "KilledWorker":  # dask's word for a process that ended
                return _failed(task, f"unexpected error ({type(error).__name__}: {error}); please report it")
        if self._tries[task.name] < TRIES:
            return None
        problem = "its process ended twice (killed, or out of memory), the second time alone"
        return _failed(task, f"{problem}; give it a machine with more memory")


def _failed(task: PlanTask, problem: str) -> PlanOutcome:
    return PlanOutcome(name=task.name, status="failed", exit_code=2, problem=f"{task.floor}: {problem}")


def free_memory() -> float:
    """Memory that this machine can give to processes, bytes; nine tenths of what is available."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            available = next(int(line.split()[1]) for line in file if line.startswith("MemAvailable"))
        return 0.9 * 1024 * available
    except (OSError, StopIteration, ValueError):
        return 4e9
